"""Whose turn it is: owners take turns, and inside an owner the most urgent job goes first, then the oldest.

Among the owners with queued work the one with the fewest running jobs is next, then the one that was served
least recently: however many jobs one owner has queued, another waits for one turn and not for all of them.
Each question is a few steps down an index, whatever the length of the queue.
"""

from __future__ import annotations

from sqlalchemy import CTE, ColumnElement, ScalarSelect, func, or_, select, update

from app.database import Session, database_time
from app.jobs.records import HELD, JobStatus
from app.tables import jobs, owners

QUEUED = jobs.c.status == JobStatus.QUEUED.value
OWNERS_LOOKED_AT = 64  # in one turn; the others' jobs would all have to be locked by other workers


def waiting_owners() -> CTE:
    """Owners with queued jobs, each found by one step down the index: no look at all that is queued."""
    first = select(func.min(jobs.c.owner).label("owner")).where(QUEUED)
    waiting = first.cte("waiting", recursive=True)
    following = select(func.min(jobs.c.owner)).where(QUEUED, jobs.c.owner > waiting.c.owner)
    return waiting.union_all(select(following.scalar_subquery()).where(waiting.c.owner.is_not(None)))


def running_of(owner: ColumnElement[str]) -> ScalarSelect[int]:
    """How many jobs of an owner are in workers' hands."""
    held = select(func.count()).select_from(jobs).where(jobs.c.status.in_(HELD), jobs.c.owner == owner)
    return held.scalar_subquery()


def may_start() -> ColumnElement[bool]:
    """Whether a queued job's time is not over: one that is waits for the reaper alone."""
    return or_(jobs.c.deadline_at.is_(None), jobs.c.deadline_at > database_time())


def owners_in_turn(session: Session, limit: int = OWNERS_LOOKED_AT) -> list[str]:
    """Owners with queued jobs in the order of their turns."""
    waiting = waiting_owners()
    return list(
        session.scalars(
            select(waiting.c.owner)
            .outerjoin(owners, owners.c.owner == waiting.c.owner)
            .where(waiting.c.owner.is_not(None))
            .order_by(running_of(waiting.c.owner), func.coalesce(owners.c.served_at, 0.0), waiting.c.owner)
            .limit(limit)
        )
    )


def next_job_of(session: Session, owner: str) -> str | None:
    """Id of the owner's job that should run next; one that another worker is taking is passed over."""
    return session.execute(
        select(jobs.c.id)
        .where(QUEUED, jobs.c.owner == owner, may_start())
        .order_by(jobs.c.priority.desc(), jobs.c.id)
        .limit(1)
        .with_for_update(skip_locked=True)  # SQLite has one writer at a time and knows no such words
    ).scalar_one_or_none()


def next_unit(session: Session) -> str | None:
    """Id of the queued job that should run next, None when there is none to be had."""
    for owner in owners_in_turn(session):
        job_id = next_job_of(session, owner)
        if job_id is not None:
            return job_id
    return None


def note_served(session: Session, owner: str) -> None:
    """Remember that a worker took a job of this owner; workers that do so at once wait for nobody."""
    mine = select(owners.c.owner).where(owners.c.owner == owner).with_for_update(skip_locked=True)
    session.execute(
        update(owners).where(owners.c.owner.in_(mine.scalar_subquery())).values(served_at=database_time())
    )
