"""How a job comes into being: its row, its request, its first event, and its share of the key's quota."""

from __future__ import annotations

from dataclasses import dataclass

from sqlalchemy import insert, select

from app.database import Session, database_time, insert_new
from app.documents import Document, Sealed, finite, sealed
from app.errors import IdempotencyConflict
from app.identifiers import new_identifier
from app.jobs.records import Job, JobStatus
from app.jobs.rows import JOB_COLUMNS, JOBS, job_from_row, write_event
from app.keys import quota
from app.leases import Note
from app.tables import idempotency_keys, job_requests, jobs, owners


@dataclass(frozen=True, slots=True)
class Origin:
    """Which call a job comes from.

    Attributes
    ----------
    key_id : str or None
        The API key, whose quota the job uses.
    request_id : str or None
        Of the call: leads from its logs to the worker's.
    traceparent : str or None
        W3C trace context of the call.
    """

    key_id: str | None = None
    request_id: str | None = None
    traceparent: str | None = None


@dataclass(frozen=True, slots=True)
class Terms:
    """What was agreed on how a job is run.

    Attributes
    ----------
    priority : int
        Inside its owner the highest runs first.
    label : str or None
        The owner's own word for it.
    max_attempts : int
        Claims before a job whose workers are lost is given up.
    max_seconds : float or None
        Deadline counted from the first claim, s.
    expires_in_s : float or None
        A job that has not begun after this time is not begun any more.
    """

    priority: int = 0
    label: str | None = None
    max_attempts: int = 3
    max_seconds: float | None = None
    expires_in_s: float | None = None


NO_ORIGIN = Origin()
USUAL_TERMS = Terms()


def create_job(
    session: Session,
    *,
    owner: str,
    operation: str,
    request: Document | Sealed,
    summary: Document | None = None,
    flights_estimated: int = 0,
    terms: Terms = USUAL_TERMS,
    origin: Origin = NO_ORIGIN,
    idempotency_key: str | None = None,
) -> Job:
    """Write a queued job; publish its id after the commit.

    Parameters
    ----------
    request : dict or Sealed
        The whole request, every sample inline: what `load_request` gives the worker.
    summary : dict, optional
        The few small facts of the request that listings show.
    flights_estimated : int
        Charged to the key until the job has ended and its flights are known.
    idempotency_key : str, optional
        With a key seen before and the same request, the earlier job is returned with ``replayed`` set.

    Raises
    ------
    IdempotencyConflict
        The key was used for another request.
    QuotaExceeded
        The API key may not have another such job.
    """
    job_id = new_identifier("job")
    document = request if isinstance(request, Sealed) else sealed(request)
    if idempotency_key is not None:
        earlier = _take_idempotency_key(session, owner, idempotency_key, operation, document.sha256, job_id)
        if earlier is not None:
            return earlier
    size_bytes = len(document.data)
    quota.charge(session, origin.key_id, flights=flights_estimated, size_bytes=size_bytes)
    starts_by = None if terms.expires_in_s is None else database_time() + terms.expires_in_s
    row = session.execute(
        insert(jobs)
        .values(
            id=job_id,
            owner=owner,
            operation=operation,
            status=JobStatus.QUEUED.value,
            priority=terms.priority,
            label=terms.label,
            summary=finite(summary or {}),
            attempt=0,
            max_attempts=terms.max_attempts,
            fence=0,
            event_seq=1,
            partial=False,
            max_seconds=terms.max_seconds,
            deadline_at=starts_by,
            published_at=database_time(),
            created_at=database_time(),
            updated_at=database_time(),
            key_id=origin.key_id,
            request_id=origin.request_id,
            traceparent=origin.traceparent,
            flights_estimated=flights_estimated,
            size_bytes=size_bytes,
        )
        .returning(*JOBS.returning)
    ).one()
    session.execute(
        insert(job_requests).values(job_id=job_id, document=document.data, sha256=document.sha256)
    )
    write_event(session, row, Note("queued"))
    session.execute(insert_new(session, owners).values(owner=owner).on_conflict_do_nothing())
    return job_from_row(row)


def _take_idempotency_key(
    session: Session, owner: str, key: str, operation: str, fingerprint: str, job_id: str
) -> Job | None:
    """Write the key, or return the job that holds it. The unique key decides between two racing requests.

    A job is deleted together with its key, and on Postgres that may be committed between any two statements
    here: then the key is free, and is written after all. A job that is returned is there until the commit.
    """
    keys = idempotency_keys
    values = {
        "owner": owner,
        "key": key,
        "operation": operation,
        "sha256": fingerprint,
        "job_id": job_id,
        "at": database_time(),
    }
    taking = insert_new(session, keys).values(**values).on_conflict_do_nothing().returning(keys.c.job_id)
    holding = select(keys).where(keys.c.owner == owner, keys.c.key == key)
    while session.execute(taking).one_or_none() is None:
        earlier = session.execute(holding).one_or_none()
        if earlier is None:
            continue
        if (earlier.operation, earlier.sha256) != (operation, fingerprint):
            raise IdempotencyConflict(key)
        kept = select(*JOB_COLUMNS).where(jobs.c.id == earlier.job_id, jobs.c.owner == owner)
        # waits for whoever is deleting the job, and for nobody else
        row = session.execute(kept.with_for_update(read=True, key_share=True)).one_or_none()
        if row is not None:
            return job_from_row(row, replayed=True)
    return None
