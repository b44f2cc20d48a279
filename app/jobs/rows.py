"""Job rows as values, and the one way to change them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sqlalchemy import ColumnElement, Row, Text, cast, delete, func, insert, select, update

from app.database import Session, database_time
from app.documents import finite
from app.errors import JobNotFound
from app.jobs.records import FINISHED, Job, JobStatus, moment, optional_moment
from app.keys import quota
from app.observability.job_counts import note_transition
from app.tables import job_checkpoints, job_chunks, job_events, jobs
from app.webhooks.outbox import note_end

JOB_COLUMNS = (
    jobs.c.id,
    jobs.c.owner,
    jobs.c.operation,
    jobs.c.status,
    jobs.c.priority,
    jobs.c.summary,
    jobs.c.progress,
    jobs.c.error,
    jobs.c.attempt,
    jobs.c.max_attempts,
    jobs.c.event_seq,
    jobs.c.model_id,
    jobs.c.partial,
    jobs.c.created_at,
    jobs.c.started_at,
    jobs.c.updated_at,
    jobs.c.finished_at,
    jobs.c.deadline_at,
    jobs.c.label,
)
CLAIM_COLUMNS = (jobs.c.fence, jobs.c.max_seconds, jobs.c.request_id, jobs.c.traceparent)
QUOTA_COLUMNS = (jobs.c.key_id, jobs.c.flights_estimated, jobs.c.flights)

FULL_HISTORY = 7200  # events: an hour of a worker that writes two a second
SPARSE_STEP = 120  # of what is older, one event a minute stays


def job_from_row(row: Row[*tuple[Any, ...]], *, replayed: bool = False) -> Job:
    """Turn a row of `JOB_COLUMNS` into a value."""
    return Job(
        id=row.id,
        owner=row.owner,
        operation=row.operation,
        status=JobStatus(row.status),
        priority=row.priority,
        summary=row.summary,
        progress=row.progress,
        error=row.error,
        attempt=row.attempt,
        max_attempts=row.max_attempts,
        event_seq=row.event_seq,
        model_id=row.model_id,
        partial=bool(row.partial),
        created_at=moment(row.created_at),
        started_at=optional_moment(row.started_at),
        updated_at=moment(row.updated_at),
        finished_at=optional_moment(row.finished_at),
        deadline_at=optional_moment(row.deadline_at),
        label=row.label,
        replayed=replayed,
    )


def get_job(session: Session, owner: str, job_id: str) -> Job:
    """Read one job of `owner`.

    Raises
    ------
    JobNotFound
        When there is none with this id, or it is another owner's.
    """
    row = session.execute(
        select(*JOB_COLUMNS).where(jobs.c.id == job_id, jobs.c.owner == owner)
    ).one_or_none()
    if row is None:
        raise JobNotFound(job_id)
    return job_from_row(row)


def transition(
    session: Session,
    *conditions: ColumnElement[bool],
    event: str | None,
    payload: Mapping[str, Any] | None = None,
    **values: Any,
) -> Row[*tuple[Any, ...]] | None:
    """Compare-and-set on one job row, with its event.

    An end, of whatever kind, also settles the job's share of the key's quota and drops the state of its work.

    Parameters
    ----------
    *conditions
        What must hold of the row (its id, and its state or fence).
    event, payload
        Type and content of the event; the job's new ``status`` and ``attempt`` are added.
        None writes no event.
    **values
        Columns to set.

    Returns
    -------
    Row or None
        The row as it is now (`JOB_COLUMNS` and `CLAIM_COLUMNS`), or None when the conditions did not hold.
    """
    if event is not None:
        values["event_seq"] = jobs.c.event_seq + 1
    row = session.execute(
        update(jobs)
        .where(*conditions)
        .values(**values, updated_at=database_time())
        .returning(*JOB_COLUMNS, *CLAIM_COLUMNS, *QUOTA_COLUMNS)
    ).one_or_none()
    if row is not None and event is not None:
        insert_event(session, row.id, row.event_seq, event, row.status, row.attempt, payload)
        note_transition(session, row, event, payload)
    if row is not None and row.status in FINISHED:
        quota.settle(
            session,
            row.key_id,
            estimated=row.flights_estimated,
            flown=row.flights,
            day=quota.usage_day(row.created_at),
        )
        note_end(session, row)
        _drop_state(session, row.id)
    return row


def _drop_state(session: Session, job_id: str) -> None:
    """Delete what only somebody who goes on with a job needs, and count what stays: nothing grows any more.

    What an end leaves of its best so far is in its result by then, or lost with its worker.
    """
    session.execute(delete(job_chunks).where(job_chunks.c.job_id == job_id))
    session.execute(delete(job_checkpoints).where(job_checkpoints.c.job_id == job_id))
    history = (
        select(func.coalesce(func.sum(func.length(cast(job_events.c.payload, Text))), 0))
        .where(job_events.c.job_id == job_id)
        .scalar_subquery()
    )
    session.execute(update(jobs).where(jobs.c.id == job_id).values(size_bytes=jobs.c.size_bytes + history))


def insert_event(
    session: Session,
    job_id: str,
    seq: int,
    event: str,
    status: str,
    attempt: int,
    payload: Mapping[str, Any] | None,
) -> None:
    """Write one event; only for a number that the job's row has given out."""
    content = {**(payload or {}), "status": status, "attempt": attempt}
    session.execute(
        insert(job_events).values(
            job_id=job_id, seq=seq, type=event, payload=finite(content), at=database_time()
        )
    )


def thin_events(session: Session, job_id: str, newest: int) -> None:
    """Drop the progress event that is `FULL_HISTORY` older than the newest, but for one in `SPARSE_STEP`.

    Called with every new one: the history of the longest job stays short, and nobody ever looks through it.
    """
    old = newest - FULL_HISTORY
    if old > 0 and old % SPARSE_STEP:
        session.execute(
            delete(job_events).where(
                job_events.c.job_id == job_id, job_events.c.seq == old, job_events.c.type == "progress"
            )
        )
