"""How long the queue is: the place of a job in the order of turns, and about when it will begin.

Counts go over indexes alone: with 10,000 queued jobs they take some milliseconds.
"""

from __future__ import annotations

from dataclasses import dataclass

from sqlalchemy import and_, func, select

from app.database import Session, database_time
from app.jobs.chunk_rows import HANDED_OUT, RUNNING
from app.jobs.records import HELD, Job, JobStatus
from app.jobs.turns import waiting_owners
from app.tables import job_chunks, jobs, owners, workers

ALIVE_S = 60.0  # a worker that was not seen for so long is not counted on
RECENT = 50  # finished jobs that tell how long jobs take


@dataclass(frozen=True, slots=True)
class QueuePlace:
    """Where a queued job stands.

    Attributes
    ----------
    position : int
        1 for the job whose turn is next, if nobody posts anything from now on.
    eta_s : float or None
        Until it begins, from what jobs took lately; None while nothing is known.
    """

    position: int
    eta_s: float | None


@dataclass(frozen=True, slots=True)
class _Line:
    """One owner's part of the queue."""

    queued: int
    running: int
    served_at: float


def queue_place(session: Session, job: Job) -> QueuePlace | None:
    """Find the place of a job; None for one that does not wait."""
    if job.status is not JobStatus.QUEUED:
        return None
    ahead = _mine_ahead(session, job.owner, job.priority, job.id)
    return _place(session, job.owner, job.operation, ahead)


def place_of_next(session: Session, owner: str, operation: str, priority: int) -> QueuePlace:
    """Find the place that a job would have which this owner posted now."""
    return _place(session, owner, operation, _mine_ahead(session, owner, priority, None))


def live_slots(session: Session) -> int:
    """Jobs that the workers can run at once, as far as they told; 0 when none did."""
    alive = and_(workers.c.stopped_at.is_(None), workers.c.seen_at > database_time() - ALIVE_S)
    return int(session.scalar(select(func.coalesce(func.sum(workers.c.slots), 0)).where(alive)) or 0)


def running(session: Session) -> int:
    """Jobs, and chunks of spread ones, in workers' hands."""
    held = select(func.count()).select_from(jobs).where(jobs.c.status.in_(HELD), ~HANDED_OUT)
    flown = select(func.count()).select_from(job_chunks).where(job_chunks.c.status == RUNNING)
    return int(session.scalar(held) or 0) + int(session.scalar(flown) or 0)


def idle_slots(session: Session) -> int:
    """Jobs that workers could begin now; never less than nothing."""
    return max(live_slots(session) - running(session), 0)


def _place(session: Session, owner: str, operation: str, mine_ahead: int) -> QueuePlace:
    lines = _lines(session, owner)
    ahead = mine_ahead + _others_ahead(lines, owner, mine_ahead)
    took_s = _usual_duration(session, operation)
    if took_s is None:
        return QueuePlace(ahead + 1, None)
    slots = max(live_slots(session), 1)
    ends_needed = ahead + 1 + sum(line.running for line in lines.values()) - slots
    return QueuePlace(ahead + 1, max(ends_needed, 0) * took_s / slots)


def _mine_ahead(session: Session, owner: str, priority: int, job_id: str | None) -> int:
    """Count the owner's own jobs that run before this one (None: before a new one)."""
    mine = and_(jobs.c.status == JobStatus.QUEUED.value, jobs.c.owner == owner)
    older = jobs.c.priority == priority
    if job_id is not None:
        older = and_(older, jobs.c.id < job_id)
    # two counts, each a stretch of the index; with "or" SQLite would look at all that the owner has queued
    urgent, before = (
        select(func.count()).select_from(jobs).where(mine, part).scalar_subquery()
        for part in (jobs.c.priority > priority, older)
    )
    return int(session.scalar(select(urgent + before)) or 0)


def _lines(session: Session, mine: str) -> dict[str, _Line]:
    """Every owner's part of the queue; how much of it is one's own was counted already."""
    waiting = waiting_owners()
    count = select(func.count()).select_from(jobs)
    count = count.where(jobs.c.status == JobStatus.QUEUED.value, jobs.c.owner == waiting.c.owner)
    others = session.execute(
        select(waiting.c.owner, count.scalar_subquery().label("jobs")).where(waiting.c.owner != mine)
    )
    queued = {row.owner: row.jobs for row in others}
    by_owner = select(jobs.c.owner, func.count().label("jobs")).where(jobs.c.status.in_(HELD))
    held = {row.owner: row.jobs for row in session.execute(by_owner.group_by(jobs.c.owner))}
    served = {row.owner: row.served_at for row in session.execute(select(owners))}
    return {
        owner: _Line(queued.get(owner, 0), held.get(owner, 0), served.get(owner, 0.0))
        for owner in queued.keys() | held.keys() | {mine}
    }


def _others_ahead(lines: dict[str, _Line], owner: str, mine_ahead: int) -> int:
    """Count the other owners' jobs that have their turn before the owner's job number `mine_ahead`.

    An owner's job number k (from 0) has its turn when running + k jobs of that owner have begun. In turns of
    the same number who runs more comes first, since he was not served in the turns before, then who was
    served least recently.
    """
    mine = lines[owner]
    turn = mine.running + mine_ahead
    ahead = 0
    for other, line in lines.items():
        if other != owner:
            first = (-line.running, line.served_at, other) < (-mine.running, mine.served_at, owner)
            ahead += min(max(turn - line.running + first, 0), line.queued)
    return ahead


def _usual_duration(session: Session, operation: str) -> float | None:
    """Mean time that recent jobs of the operation took, s; of all operations while there are none of it."""
    recent = (
        select(jobs.c.operation, (jobs.c.finished_at - jobs.c.started_at).label("took_s"))
        .where(jobs.c.status == JobStatus.SUCCEEDED.value, jobs.c.finished_at.is_not(None))
        .order_by(jobs.c.finished_at.desc())
        .limit(RECENT)
    )
    rows = session.execute(recent).all()
    times = [row.took_s for row in rows if row.operation == operation] or [row.took_s for row in rows]
    return sum(times) / len(times) if times else None
