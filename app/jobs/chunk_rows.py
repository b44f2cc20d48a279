"""Which rows of spread jobs a worker may take: open chunks, and jobs that nobody holds and that must go on.

A spread job is running and its work lies in `job_chunks`. While workers fly its chunks nobody holds the job
itself: it has no lease. Who stored the last chunk, or learns that the job was cancelled or ran out of time,
takes it over like any claim.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Any

from sqlalchemy import ColumnElement, Row, and_, exists, or_, select

from app.database import Session, database_time
from app.jobs.records import HELD, JobStatus
from app.leases import Key, LeasedTable
from app.tables import job_chunks, jobs

OPEN, RUNNING, DONE = "open", "running", "done"  # states of a chunk
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
UNFINISHED = job_chunks.c.status.in_((OPEN, RUNNING))

# handed out: running, and in no single worker's hands
HANDED_OUT = and_(jobs.c.status.in_(HELD), jobs.c.lease_until.is_(None), jobs.c.spread)

REST_S = 1.0  # workers take the next chunk within milliseconds; after this nobody is at it


class UnitKind(Enum):
    """What a worker can take."""

    JOB = "job"  # a queued job
    CHUNK = "chunk"  # an open chunk of a running job
    SPREAD = "spread"  # a spread job whose chunks are all stored, or which must end


@dataclass(frozen=True, slots=True)
class Unit:
    """The next piece of work; of a chunk also its place."""

    kind: UnitKind
    job_id: str
    generation: int = 0
    number: int = 0

    @property
    def key(self) -> Key:
        """The row's key: a chunk's, or the job's."""
        place = (self.generation, self.number) if self.kind is UnitKind.CHUNK else ()
        return (self.job_id, *place)


def deadline_passed() -> ColumnElement[bool]:
    """Whether a job's time is over, by the database's clock."""
    return jobs.c.deadline_at < database_time()


def in_time() -> ColumnElement[bool]:
    """Whether a job's time is not over; that of one whose is ends by the reaper, or by who holds it."""
    return or_(jobs.c.deadline_at.is_(None), jobs.c.deadline_at > database_time())


def must_go_on() -> ColumnElement[bool]:
    """Whether a spread job in nobody's hands waits for one: to advance, or to end."""
    flown = ~exists().where(job_chunks.c.job_id == jobs.c.id, job_chunks.c.owner == jobs.c.owner, UNFINISHED)
    return and_(HANDED_OUT, or_(jobs.c.status == JobStatus.CANCELLING.value, deadline_passed(), flown))


def at_rest() -> ColumnElement[bool]:
    """Whether a spread job is in nobody's hands and nobody flies, or just flew, one of its chunks."""
    lately = exists().where(
        job_chunks.c.job_id == jobs.c.id,
        or_(job_chunks.c.status == RUNNING, job_chunks.c.at > database_time() - REST_S),
    )
    return and_(HANDED_OUT, ~lately)


def next_spread_job(session: Session) -> str | None:
    """Id of a spread job that must go on; one that another worker is taking is passed over."""
    return session.execute(
        select(jobs.c.id).where(must_go_on()).order_by(jobs.c.id).limit(1).with_for_update(skip_locked=True)
    ).scalar_one_or_none()


def next_chunk_of(session: Session, owner: str) -> Row[*tuple[Any, ...]] | None:
    """The owner's open chunk that should be flown next: of the most urgent job, then of the oldest."""
    return session.execute(
        select(job_chunks.c.job_id, job_chunks.c.generation, job_chunks.c.number, jobs.c.priority)
        .join(jobs, jobs.c.id == job_chunks.c.job_id)
        .where(
            job_chunks.c.status == OPEN,
            job_chunks.c.owner == owner,
            jobs.c.status == JobStatus.RUNNING.value,
            in_time(),
        )
        .order_by(jobs.c.priority.desc(), job_chunks.c.job_id, job_chunks.c.number)
        .limit(1)
        .with_for_update(skip_locked=True, of=job_chunks)
    ).one_or_none()
