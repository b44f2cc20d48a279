"""Job rows as values, and as leased work."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from sqlalchemy import Row, Text, cast, delete, func, insert, select, update

from app.database import Session, database_time
from app.documents import finite
from app.errors import JobNotFound
from app.jobs.records import FINISHED, HELD, Job, JobStatus, optional_moment
from app.leases import LeasedRow, LeasedTable, Note
from app.tables import job_checkpoints, job_chunks, job_events, jobs

JOB_COLUMNS = tuple(jobs.c[field.name] for field in fields(Job) if field.name != "replayed")
MOMENTS = tuple(column.name for column in JOB_COLUMNS if column.name.endswith("_at"))
CLAIM_COLUMNS = (jobs.c.fence, jobs.c.max_seconds, jobs.c.request_id, jobs.c.traceparent)
QUOTA_COLUMNS = (jobs.c.key_id, jobs.c.flights_estimated, jobs.c.flights)

FULL_HISTORY = 7200  # events: an hour of a worker that writes two a second
SPARSE_STEP = 120  # of what is older, one event a minute stays


def write_event(session: Session, row: LeasedRow, note: Note) -> None:
    """Write the event of a change; its number is the one that the change has given out.

    The job's new ``status`` and ``attempt`` are added to its payload.
    """
    content = {**(note.payload or {}), "status": row.status, "attempt": row.attempt}
    session.execute(
        insert(job_events).values(
            job_id=row.id, seq=row.event_seq, type=note.event, payload=finite(content), at=database_time()
        )
    )


JOBS = LeasedTable(
    jobs,
    key=(jobs.c.id,),
    lease=jobs.c.lease_until,
    waiting=JobStatus.QUEUED.value,
    held=HELD,
    ends=FINISHED,
    returning=(*JOB_COLUMNS, *CLAIM_COLUMNS, *QUOTA_COLUMNS),
    unheld={"worker": None, "lease_until": None},
    dated={"updated_at": database_time()},
    noted={"event_seq": jobs.c.event_seq + 1},
    on_change=[write_event],
    on_end=None,  # `app.on_end` says it
)


def job_from_row(row: Row[*tuple[Any, ...]], *, replayed: bool = False) -> Job:
    """Turn a row of `JOB_COLUMNS` into a value."""
    values = {column.name: getattr(row, column.name) for column in JOB_COLUMNS}
    values |= {name: optional_moment(values[name]) for name in MOMENTS}
    values |= {"status": JobStatus(row.status), "partial": bool(row.partial)}
    return Job(**values, replayed=replayed)


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


def drop_state(session: Session, row: LeasedRow, _note: Note) -> None:
    """Delete what only somebody who goes on with a job needs, and count what stays: nothing grows any more.

    What an end leaves of its best so far is in its result by then, or lost with its worker.
    """
    session.execute(delete(job_chunks).where(job_chunks.c.job_id == row.id))
    session.execute(delete(job_checkpoints).where(job_checkpoints.c.job_id == row.id))
    history = (
        select(func.coalesce(func.sum(func.length(cast(job_events.c.payload, Text))), 0))
        .where(job_events.c.job_id == row.id)
        .scalar_subquery()
    )
    session.execute(update(jobs).where(jobs.c.id == row.id).values(size_bytes=jobs.c.size_bytes + history))


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
