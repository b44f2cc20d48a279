"""The order of work: owners take turns; an owner's most urgent job goes first, then the oldest.

Among the owners with waiting work the one with the fewest workers is next, then the one that was served least
recently: however many jobs one owner has queued, another owner waits for one turn only. Work is a queued job
or an open chunk of a running one; an owner's chunks go before queued jobs that are not more urgent. Each
query takes a few steps in an index, whatever the length of the queue.
"""

from __future__ import annotations

from typing import Any

from sqlalchemy import CTE, Column, ColumnElement, Row, func, select, union, update

from app.database import Session, database_time
from app.jobs.records import HELD, JobStatus
from app.jobs.rows import HANDED_OUT, OPEN, RUNNING, Unit, UnitKind, in_time, must_go_on
from app.tables import job_chunks, jobs, owners

QUEUED = jobs.c.status == JobStatus.QUEUED.value
OWNERS_LOOKED_AT = (
    64  # owners per query; more are needed only if the jobs of all these are locked by other workers
)


def _owners(column: Column[str], condition: ColumnElement[bool], name: str) -> CTE:
    """Owners of some rows, each found by one step in an index."""
    first = select(func.min(column).label("owner")).where(condition)
    found = first.cte(name, recursive=True)
    following = select(func.min(column)).where(condition, column > found.c.owner)
    return found.union_all(select(following.scalar_subquery()).where(found.c.owner.is_not(None)))


def running(*owner: ColumnElement[str]) -> ColumnElement[int]:
    """Number of jobs, and chunks of spread jobs, that are being worked on: of one owner, or of all."""
    held = select(func.count()).select_from(jobs).where(jobs.c.status.in_(HELD), ~HANDED_OUT)
    flown = select(func.count()).select_from(job_chunks).where(job_chunks.c.status == RUNNING)
    for each in owner:
        held, flown = held.where(jobs.c.owner == each), flown.where(job_chunks.c.owner == each)
    return held.scalar_subquery() + flown.scalar_subquery()


def owners_in_turn(session: Session) -> list[str]:
    """Owners with waiting work in the order of their turns."""
    queued = _owners(jobs.c.owner, QUEUED, "waiting")
    flying = _owners(job_chunks.c.owner, job_chunks.c.status == OPEN, "flying")
    waiting = union(select(queued.c.owner), select(flying.c.owner)).subquery()
    return list(
        session.scalars(
            select(waiting.c.owner)
            .outerjoin(owners, owners.c.owner == waiting.c.owner)
            .where(waiting.c.owner.is_not(None))
            .order_by(running(waiting.c.owner), func.coalesce(owners.c.served_at, 0.0), waiting.c.owner)
            .limit(OWNERS_LOOKED_AT)
        )
    )


def next_job_of(session: Session, owner: str, *, above: int | None = None) -> str | None:
    """Id of the owner's next job, of a higher priority than ``above`` if that is given.

    A job that another worker is taking is skipped.
    """
    urgent = () if above is None else (jobs.c.priority > above,)
    return session.execute(
        select(jobs.c.id)
        .where(QUEUED, jobs.c.owner == owner, in_time(), *urgent)
        .order_by(jobs.c.priority.desc(), jobs.c.id)
        .limit(1)
        .with_for_update(skip_locked=True)  # SQLite has one writer at a time and no such clause
    ).scalar_one_or_none()


def _next_spread_job(session: Session) -> str | None:
    """Id of a spread job that must continue; one that another worker is taking is skipped."""
    return session.execute(
        select(jobs.c.id).where(must_go_on()).order_by(jobs.c.id).limit(1).with_for_update(skip_locked=True)
    ).scalar_one_or_none()


def _next_chunk_of(session: Session, owner: str) -> Row[*tuple[Any, ...]] | None:
    """The owner's next open chunk: of the most urgent job, then of the oldest."""
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


def next_unit(session: Session) -> Unit | None:
    """The next work to be done; None if there is none.

    A spread job that must continue takes precedence over turns: many workers are waiting for it.
    """
    spread = _next_spread_job(session)
    if spread is not None:
        return Unit(UnitKind.SPREAD, spread)
    for owner in owners_in_turn(session):
        chunk = _next_chunk_of(session, owner)
        job_id = next_job_of(session, owner, above=None if chunk is None else chunk.priority)
        if job_id is not None:
            return Unit(UnitKind.JOB, job_id)
        if chunk is not None:
            return Unit(UnitKind.CHUNK, chunk.job_id, chunk.generation, chunk.number)
    return None


def note_served(session: Session, owner: str) -> None:
    """Record that a worker took a job of this owner; concurrent records do not block each other."""
    mine = select(owners.c.owner).where(owners.c.owner == owner).with_for_update(skip_locked=True)
    session.execute(
        update(owners).where(owners.c.owner.in_(mine.scalar_subquery())).values(served_at=database_time())
    )
