"""The life cycle of a job as rows: created, claimed, kept alive, finished.

The row is authoritative, messages are hints. Every function takes a `Session` and leaves the commit to its
caller (a worker, or an endpoint's transaction). Jobs are leased work (`app.leases`): every change of state is
a compare-and-set that writes its event in the same transaction. Writes of a worker carry its claim's fence; a
stale one changes nothing and returns False.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass

from sqlalchemy import case, delete, insert, literal, or_, select

from app.database import Session, database_time, insert_new
from app.documents import Document, Sealed, finite, packed, sealed, unpacked
from app.errors import IdempotencyConflict, JobNotFound
from app.identifiers import new_identifier
from app.jobs.artifacts import store_artifacts
from app.jobs.records import FINISHED, HELD, ChunkClaim, Claim, Job, JobStatus, StopReason
from app.jobs.rows import (
    CHUNKS,
    JOB_COLUMNS,
    JOBS,
    at_rest,
    deadline_passed,
    get_job,
    in_time,
    job_from_row,
    thin_events,
    write_event,
)
from app.jobs.turns import note_served
from app.keys import quota
from app.leases import LeasedRow, Note
from app.tables import (
    idempotency_keys,
    job_checkpoints,
    job_chunks,
    job_requests,
    job_results,
    jobs,
    owners,
)


@dataclass(frozen=True, slots=True)
class Origin:
    """The call that posted a job."""

    key_id: str | None = None  # the API key whose quota the job uses
    request_id: str | None = None  # connects the call's logs with the worker's
    traceparent: str | None = None  # W3C trace context


@dataclass(frozen=True, slots=True)
class Terms:
    """Conditions under which a job is run."""

    priority: int = 0  # among the owner's jobs the highest runs first
    label: str | None = None  # chosen by the owner
    max_attempts: int = 3  # number of claims after which a job whose workers are lost fails
    max_seconds: float | None = None  # deadline, counted from the first claim
    expires_in_s: float | None = None  # a job that has not started after this time is not started any more


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
        Summary of the request for listings.
    flights_estimated : int
        Charged to the key until the job ends and its number of flights is known.
    idempotency_key : str, optional
        With a key seen before and the same request, the earlier job is returned with ``replayed`` set.

    Raises
    ------
    IdempotencyConflict
        The key was used for another request.
    QuotaExceeded
        The API key's quota does not allow another such job.
    """
    job_id = new_identifier("job")
    document = request if isinstance(request, Sealed) else sealed(request)
    if idempotency_key is not None:
        earlier = _take_idempotency_key(session, owner, idempotency_key, operation, document.sha256, job_id)
        if earlier is not None:
            return earlier
    size_bytes = len(document.data)
    quota.charge(session, origin.key_id, new_jobs=1, flights=flights_estimated, size_bytes=size_bytes)
    agreed = {**asdict(origin), **asdict(terms)}
    expires_in_s = agreed.pop("expires_in_s")
    row = session.execute(
        insert(jobs)
        .values(
            id=job_id,
            owner=owner,
            operation=operation,
            status=JobStatus.QUEUED.value,
            summary=finite(summary or {}),
            attempt=0,
            fence=0,
            event_seq=1,
            partial=False,
            deadline_at=None if expires_in_s is None else database_time() + expires_in_s,
            published_at=database_time(),
            created_at=database_time(),
            updated_at=database_time(),
            flights_estimated=flights_estimated,
            size_bytes=size_bytes,
            **agreed,
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
    """Write the key, or return the job that has it. The unique constraint decides between racing requests.

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
        # waits only for a transaction that is deleting the job
        row = session.execute(kept.with_for_update(read=True, key_share=True)).one_or_none()
        if row is not None:
            return job_from_row(row, replayed=True)
    return None


def load_request(session: Session, job_id: str) -> Document:
    """Return the request document of a job, every sample inline."""
    data = session.execute(
        select(job_requests.c.document).where(job_requests.c.job_id == job_id)
    ).scalar_one_or_none()
    if data is None:
        raise JobNotFound(job_id)
    document: Document = unpacked(data)
    return document


def claim_job(session: Session, job_id: str, worker_name: str, lease_s: float = 60.0) -> Claim | None:
    """Claim a queued job: fence and attempt rise by one, the lease runs from now, another owner is next.

    Returns None if the job is no longer queued (claimed by another worker, or cancelled) or its time is over.
    """
    now = database_time()
    first = jobs.c.started_at.is_(None)
    row = JOBS.claim(
        session,
        (job_id,),
        in_time(),
        lease_until=now + lease_s,
        note=Note("started", {"worker": worker_name}),
        worker=worker_name,
        started_at=case((first, now), else_=jobs.c.started_at),
        deadline_at=case((first, now + jobs.c.max_seconds), else_=jobs.c.deadline_at),
    )
    if row is None:
        return None
    note_served(session, row.owner)
    return claim_from_row(row, worker_name)


def claim_from_row(row: LeasedRow, worker_name: str) -> Claim:
    """Turn the row of a job that was just claimed into the claim."""
    return Claim(
        job_id=row.id,
        owner=row.owner,
        operation=row.operation,
        fence=row.fence,
        attempt=row.attempt,
        max_attempts=row.max_attempts,
        worker=worker_name,
        request_id=row.request_id,
        traceparent=row.traceparent,
        waited_s=row.updated_at - row.created_at,
    )


def renew_lease(session: Session, claim: Claim, lease_s: float = 60.0) -> StopReason | None:
    """Extend the lease, and return why the work should stop."""
    (CHUNKS if isinstance(claim, ChunkClaim) else JOBS).renew(session, claim, lease_s)
    return look_at_lease(session, claim)


def look_at_lease(session: Session, claim: Claim) -> StopReason | None:
    """Return why the work should stop, without writing: cheap enough to call several times a second.

    The database's clock judges deadlines: a worker's may be an hour wrong.
    """
    query = select(jobs.c.status, deadline_passed().label("deadline_passed"))
    if isinstance(claim, ChunkClaim):
        query = query.join(job_chunks, job_chunks.c.job_id == jobs.c.id).where(jobs.c.status.in_(HELD))
        query = query.where(*CHUNKS.held_by(claim))
    else:
        query = query.where(*JOBS.held_by(claim))
    row = session.execute(query).one_or_none()
    if row is None:
        return StopReason.LOST
    if row.status == JobStatus.CANCELLING.value:
        return StopReason.CANCEL
    return StopReason.DEADLINE if row.deadline_passed else None


def save_progress(session: Session, claim: Claim, progress: Document, checkpoint: bytes | None) -> bool:
    """Write progress, its event and (when given) the checkpoint; return False for a stale claim.

    ``progress`` may have ``fraction`` (0..1), ``generation``, ``best_cost``, ``flights``, ``flights_per_s``,
    ``eta_s``, ``phase`` and ``message``. NaN and infinity become null.
    """
    clean = finite(progress)
    values: Document = {"progress": clean}
    if clean.get("flights") is not None:
        values["flights"] = int(clean["flights"])
    row = JOBS.settle(session, claim, note=Note("progress", clean), **values)
    if row is None:
        return False
    thin_events(session, row.id, row.event_seq)
    if checkpoint is not None:
        replace_checkpoint(session, claim, checkpoint)
    return True


def replace_checkpoint(session: Session, claim: Claim, checkpoint: bytes) -> None:
    """Write the checkpoint of a claimed job; only in a transaction that has proved the claim."""
    session.execute(delete(job_checkpoints).where(job_checkpoints.c.job_id == claim.job_id))
    session.execute(
        insert(job_checkpoints).values(
            job_id=claim.job_id, data=checkpoint, fence=claim.fence, at=database_time()
        )
    )


def load_checkpoint(session: Session, claim: Claim) -> bytes | None:
    """Return the last checkpoint of the claimed job, whichever attempt wrote it."""
    data = session.execute(
        select(job_checkpoints.c.data).where(job_checkpoints.c.job_id == claim.job_id)
    ).scalar_one_or_none()
    return None if data is None else bytes(data)


def finish_job(
    session: Session,
    claim: Claim,
    status: JobStatus | str,
    *,
    result: Document | None = None,
    error: Document | None = None,
    artifacts: Mapping[str, bytes] | None = None,
) -> bool:
    """End a claimed job with its result and files; return False for a stale claim.

    Parameters
    ----------
    status
        ``succeeded``, ``failed``, ``cancelled`` or ``expired``. Any but the first marks a result as partial.
    error : dict, optional
        ``{"code", "detail", "hint"?, "pointer"?}`` of a failure; stored and shown as it is.
    artifacts : mapping, optional
        File name -> content.
    """
    ending = JobStatus(status).value
    if ending not in FINISHED:
        raise ValueError(f"{ending} is not an end")
    partial = result is not None and ending != JobStatus.SUCCEEDED.value
    values: Document = {
        "status": ending,
        "partial": partial,
        "lease_until": None,
        "finished_at": database_time(),
    }
    if error is not None:
        values["error"] = finite(error)
    payload = {"error": values["error"]} if error is not None else None
    if ending == JobStatus.SUCCEEDED.value:
        # work that counts no flights counts as one
        values["flights"] = case((jobs.c.flights > 0, jobs.c.flights), else_=1)
    document = None if result is None else packed({**result, "partial": True} if partial else result)
    files = artifacts or {}
    values["size_bytes"] = jobs.c.size_bytes + len(document or b"") + sum(map(len, files.values()))
    if JOBS.settle(session, claim, note=Note(ending, payload, result), **values) is None:
        return False
    if document is not None:
        session.execute(
            insert(job_results).values(
                job_id=claim.job_id, document=document, partial=partial, at=database_time()
            )
        )
    store_artifacts(session, claim.job_id, files)
    return True


def release_job(session: Session, claim: Claim) -> bool:
    """Return a running job to the queue with its checkpoint (graceful stop); the attempt is not counted.

    A job that was being cancelled ends as cancelled instead. Publish the id after the commit.
    """
    cancelling = jobs.c.status == JobStatus.CANCELLING.value
    row = JOBS.give_back(
        session,
        claim,
        note=Note("released", {"worker": claim.worker}),
        status=case((cancelling, literal(JobStatus.CANCELLED.value)), else_=literal(JobStatus.QUEUED.value)),
        finished_at=case((cancelling, database_time()), else_=None),
        published_at=database_time(),
    )
    return row is not None


def request_cancel(session: Session, owner: str, job_id: str) -> Job:
    """Request the end of a job: a queued one ends at once, a running one winds down, a finished one stays.

    A spread job on which no worker is working also ends at once. Otherwise publish the id after the commit,
    so that a worker winds it down.
    """
    mine = (jobs.c.id == job_id, jobs.c.owner == owner)
    row = JOBS.change(
        session,
        *mine,
        or_(jobs.c.status == JobStatus.QUEUED.value, at_rest()),
        note=Note("cancelled"),
        status=JobStatus.CANCELLED.value,
        fence=jobs.c.fence + 1,
        finished_at=database_time(),
    ) or JOBS.change(
        session,
        *mine,
        jobs.c.status == JobStatus.RUNNING.value,
        note=Note("cancelling"),
        status=JobStatus.CANCELLING.value,
    )
    return get_job(session, owner, job_id) if row is None else job_from_row(row)
