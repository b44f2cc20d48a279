"""Jobs and chunks as leased work, the conditions that select them, and job rows as values.

A spread job is in state running and its work is in `job_chunks`. While workers fly its chunks the job itself
has no holder and no lease. The worker that stores the last chunk, or learns that the job was cancelled or ran
out of time, claims it.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from enum import Enum
from typing import Any

from sqlalchemy import ColumnElement, Row, Text, and_, cast, delete, exists, func, insert, or_, select, update

from app.database import Session, database_time
from app.documents import finite
from app.errors import JobNotFound
from app.jobs.records import FINISHED, HELD, Job, JobStatus, optional_moment
from app.leases import Key, LeasedRow, LeasedTable, Note
from app.tables import job_checkpoints, job_chunks, job_events, jobs

JOB_COLUMNS = tuple(jobs.c[field.name] for field in fields(Job) if field.name != "replayed")
MOMENTS = tuple(column.name for column in JOB_COLUMNS if column.name.endswith("_at"))
CLAIM_COLUMNS = (jobs.c.fence, jobs.c.request_id, jobs.c.traceparent)
QUOTA_COLUMNS = (jobs.c.key_id, jobs.c.flights_estimated, jobs.c.flights)

FULL_HISTORY = 7200  # events: an hour of a worker that writes two a second
SPARSE_STEP = 120  # of older events, one per minute is kept

OPEN, RUNNING, DONE = "open", "running", "done"  # states of a chunk
REST_S = 1.0  # s; workers take the next chunk within milliseconds; after this the job is at rest


def write_event(session: Session, row: LeasedRow, note: Note) -> None:
    """Write the event of a change, with the job's new ``status`` and ``attempt`` in its payload."""
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
    on_end=None,  # set by `app.on_end`
)
CHUNKS = LeasedTable(
    job_chunks,
    key=(job_chunks.c.job_id, job_chunks.c.generation, job_chunks.c.number),
    lease=job_chunks.c.lease_until,
    waiting=OPEN,
    held=(RUNNING,),
    ends=(DONE,),
    returning=(job_chunks.c.owner, job_chunks.c.fence, job_chunks.c.attempt),
    unheld={"worker": None, "lease_until": None},
    dated={"at": database_time()},
)

# handed out to several workers: running, and held by none
HANDED_OUT = and_(jobs.c.status.in_(HELD), jobs.c.lease_until.is_(None), jobs.c.spread)


class UnitKind(Enum):
    """Kinds of work that a worker can take."""

    JOB = "job"  # a queued job
    CHUNK = "chunk"  # an open chunk of a running job
    SPREAD = "spread"  # a spread job whose chunks are all stored, or that must end


@dataclass(frozen=True, slots=True)
class Unit:
    """The next piece of work; ``generation`` and ``number`` identify a chunk."""

    kind: UnitKind
    job_id: str
    generation: int = 0
    number: int = 0

    @property
    def key(self) -> Key:
        """Key of the chunk's or the job's row."""
        place = (self.generation, self.number) if self.kind is UnitKind.CHUNK else ()
        return (self.job_id, *place)


def deadline_passed() -> ColumnElement[bool]:
    """Whether a job's deadline has passed, by the database's clock."""
    return jobs.c.deadline_at < database_time()


def in_time() -> ColumnElement[bool]:
    """Whether a job's deadline has not passed."""
    return or_(jobs.c.deadline_at.is_(None), jobs.c.deadline_at > database_time())


def must_go_on() -> ColumnElement[bool]:
    """Whether a spread job without a holder is waiting for a worker to advance or end it."""
    unfinished = job_chunks.c.status.in_((OPEN, RUNNING))
    flown = ~exists().where(job_chunks.c.job_id == jobs.c.id, job_chunks.c.owner == jobs.c.owner, unfinished)
    return and_(HANDED_OUT, or_(jobs.c.status == JobStatus.CANCELLING.value, deadline_passed(), flown))


def at_rest() -> ColumnElement[bool]:
    """Whether a spread job has no holder and no worker is flying, or has just flown, one of its chunks."""
    lately = exists().where(
        job_chunks.c.job_id == jobs.c.id,
        or_(job_chunks.c.status == RUNNING, job_chunks.c.at > database_time() - REST_S),
    )
    return and_(HANDED_OUT, ~lately)


def job_from_row(row: Row[*tuple[Any, ...]], *, replayed: bool = False) -> Job:
    """Turn a row of `JOB_COLUMNS` into a value."""
    values = {column.name: getattr(row, column.name) for column in JOB_COLUMNS}
    values |= {name: optional_moment(values[name]) for name in MOMENTS}
    values |= {"status": JobStatus(row.status), "partial": bool(row.partial)}
    return Job(**values, replayed=replayed)


def get_job(session: Session, owner: str, job_id: str) -> Job:
    """Read one job; raise `JobNotFound` if this owner has none with this id."""
    row = session.execute(
        select(*JOB_COLUMNS).where(jobs.c.id == job_id, jobs.c.owner == owner)
    ).one_or_none()
    if row is None:
        raise JobNotFound(job_id)
    return job_from_row(row)


def drop_state(session: Session, row: LeasedRow, _note: Note) -> None:
    """Delete the data needed only to continue a job, and add the size of its history to its stored bytes."""
    session.execute(delete(job_chunks).where(job_chunks.c.job_id == row.id))
    session.execute(delete(job_checkpoints).where(job_checkpoints.c.job_id == row.id))
    history = (
        select(func.coalesce(func.sum(func.length(cast(job_events.c.payload, Text))), 0))
        .where(job_events.c.job_id == row.id)
        .scalar_subquery()
    )
    session.execute(update(jobs).where(jobs.c.id == row.id).values(size_bytes=jobs.c.size_bytes + history))


def thin_events(session: Session, job_id: str, newest: int) -> None:
    """Drop the progress event that is `FULL_HISTORY` older than the newest, except one in `SPARSE_STEP`.

    Called with every new event, so that the history of the longest job stays short without any search.
    """
    old = newest - FULL_HISTORY
    if old > 0 and old % SPARSE_STEP:
        session.execute(
            delete(job_events).where(
                job_events.c.job_id == job_id, job_events.c.seq == old, job_events.c.type == "progress"
            )
        )
