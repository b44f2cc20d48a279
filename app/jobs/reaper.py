"""The reaper: ends overdue jobs, releases work of dead workers, repeats lost wake-up messages.

Any number of reapers may run at once: each change is a compare-and-set on the fence that was read.
"""

from __future__ import annotations

import logging
from collections import Counter
from typing import Any

from sqlalchemy import ColumnElement, Row, and_, case, func, literal, or_, select, update

from app.database import Session, database_time
from app.documents import Document
from app.jobs.records import HELD, JobStatus, ReapReport
from app.jobs.rows import CHUNKS, HANDED_OUT, JOBS, OPEN, RUNNING, must_go_on
from app.jobs.waiting import idle_slots
from app.leases import Note
from app.observability.counters import count
from app.observability.job_counts import CHUNK_LEASES_LOST
from app.tables import job_chunks, jobs

# s; a worker that notices the deadline itself keeps its best result; after this the reaper ends the job
DEADLINE_GRACE_S = 30.0
ROUND_LIMIT = 500  # rows per round, so that a round is a short transaction whatever the backlog
PUBLISH_LIMIT = 100  # messages per round, for queued jobs and for chunks
# A job may start `max_attempts` times; each of its chunks may be lost three times as often. If one chunk in a
# hundred is lost, one in forty jobs of 25,600 chunks would lose some chunk three times by chance.
LOSSES_PER_ATTEMPT = 3
ADVANCE_WITHIN_S = (
    2.0  # the worker that stores the last chunk takes the job over immediately, unless it has died
)
WIND_DOWN_WITHIN_S = 15.0  # a woken worker ends a cancelled job at once; if none is free, we do
MEMORY_HINT = "This happens if a search runs out of memory: use fewer particles, or see its log."

Rows = list[Row[*tuple[Any, ...]]]

log = logging.getLogger(__name__)


def reap(
    session: Session,
    now: float | None = None,
    *,
    republish_after_s: float = 15.0,
    deadline_grace_s: float = DEADLINE_GRACE_S,
) -> ReapReport:
    """Run one round and report what was done; publish the ids in ``publish`` after the commit.

    Parameters
    ----------
    now : float, optional
        Seconds since 1970 UTC; the database's own clock when None.
    republish_after_s : float
        A job still queued this long after its last message gets another.
    deadline_grace_s : float
        How long a running job may outlive its deadline while its worker winds down.
    """
    clock: ColumnElement[float] = database_time() if now is None else literal(now)
    done: dict[str, list[str]] = {"requeued": [], "failed": [], "cancelled": [], "expired": []}
    for row in _overdue(session, clock, deadline_grace_s):
        event, values = _verdict(row)
        if _change(session, row, jobs.c.status == row.status, event, row.reason, values):
            done[event].append(row.id)
    # jobs before chunks, as everywhere: different locking orders would deadlock
    lost = _lost_chunks(session, clock)
    for row in lost:
        if row.lost_attempt >= row.max_attempts * LOSSES_PER_ATTEMPT:
            attempts = f"{row.lost_attempt} attempts at a part of a generation"
            detail = f"The worker died or stalled in each of {attempts}."
            values = _end(JobStatus.FAILED, "worker_lost", detail, MEMORY_HINT)
            if _change(session, row, HANDED_OUT, "failed", "lease_lost", values):
                done["failed"].append(row.id)
    for row in _never_wound_down(session, clock):
        if _change(session, row, HANDED_OUT, "cancelled", None, _end(JobStatus.CANCELLED)):
            done["cancelled"].append(row.id)
    again = Counter(row.id for row in lost if row.id not in done["failed"] and _reopen(session, row))
    count(session, CHUNK_LEASES_LOST, by=again.total())
    again |= Counter(_unheard_chunks(session, clock, republish_after_s))
    chunks = tuple(again.elements())[:PUBLISH_LIMIT]
    unheard = _unheard(session, clock, republish_after_s, set(done["requeued"]))
    ends = {event: tuple(ids) for event, ids in done.items()}
    return ReapReport(**ends, publish=(*done["requeued"], *chunks, *unheard))


def log_ends(report: ReapReport) -> None:
    """Log the jobs that a round has changed."""
    for kind in ("requeued", "failed", "cancelled", "expired"):
        for job_id in getattr(report, kind):
            log.warning("reaper: job %s %s", job_id, kind)


def _change(
    session: Session,
    row: Row[Any],
    condition: ColumnElement[bool],
    event: str,
    reason: str | None,
    values: Document,
) -> bool:
    """Requeue or end a job in the state that was read; False if it has changed since."""
    error = {"error": values["error"]} if "error" in values else {}
    note = Note(event, None if reason is None else {"reason": reason, **error})
    return JOBS.reap(session, (row.id,), row.fence, condition, note=note, **values) is not None


def _end(status: JobStatus, code: str = "", detail: str = "", hint: str = "") -> Document:
    """Columns of a job that ends, with its error when there is one."""
    error = {"error": {"code": code, "detail": detail, "hint": hint}} if code else {}
    return {"status": status.value, "finished_at": database_time(), **error}


def _overdue(session: Session, clock: ColumnElement[float], grace_s: float) -> Rows:
    """Jobs whose lease ran out, or whose deadline has passed."""
    lease_lost = JOBS.lost(clock)
    overrun = jobs.c.status.in_(HELD) & (jobs.c.deadline_at + grace_s < clock)
    waited_too_long = (jobs.c.status == JobStatus.QUEUED.value) & (jobs.c.deadline_at < clock)
    rows = session.execute(
        select(
            jobs.c.id,
            jobs.c.fence,
            jobs.c.status,
            jobs.c.attempt,
            jobs.c.max_attempts,
            case((lease_lost, "lease_lost"), else_="deadline").label("reason"),
            (jobs.c.deadline_at < clock).label("deadline_passed"),
            jobs.c.started_at,
        )
        .where(or_(lease_lost, overrun, waited_too_long))
        .order_by(jobs.c.id)
        .limit(ROUND_LIMIT)
    )
    return list(rows.all())


def _verdict(row: Row[Any]) -> tuple[str, Document]:
    """Decide the fate of an overdue job: event type and columns to set."""
    if row.status == JobStatus.CANCELLING.value:
        return "cancelled", _end(JobStatus.CANCELLED)
    if row.deadline_passed and row.started_at is None:
        detail = "No worker was free before the time that execution.expires_in_s set."
        hint = "Submit it again with a longer execution.expires_in_s, or without one."
        return "expired", _end(JobStatus.EXPIRED, "not_started_in_time", detail, hint)
    if row.deadline_passed:
        detail = "The job did not end before its deadline."
        hint = "Raise search.max_seconds, or search with fewer particles, generations or links."
        return "expired", _end(JobStatus.EXPIRED, "deadline_exceeded", detail, hint)
    if row.attempt >= row.max_attempts:
        detail = f"The worker died or stalled in each of {row.attempt} attempts."
        return "failed", _end(JobStatus.FAILED, "worker_lost", detail, MEMORY_HINT)
    return "requeued", {"status": JobStatus.QUEUED.value, "published_at": database_time()}


def _unheard(
    session: Session, clock: ColumnElement[float], after_s: float, fresh: set[str]
) -> tuple[str, ...]:
    """Queued jobs whose message may have been lost; they are marked as published now.

    At most as many as there are idle workers: a message wakes a worker for whichever job is next, and a
    worker that ends a job announces the next one. So even the longest queue sends no useless messages.
    """
    wanted = min(max(idle_slots(session), 1), PUBLISH_LIMIT)
    ids = session.scalars(
        select(jobs.c.id)
        .where(jobs.c.status == JobStatus.QUEUED.value, jobs.c.published_at < clock - after_s)
        .order_by(jobs.c.published_at)
        .limit(wanted)
    ).all()
    lost = [job_id for job_id in ids if job_id not in fresh]
    if lost:
        session.execute(update(jobs).where(jobs.c.id.in_(lost)).values(published_at=clock))
    return tuple(lost)


# spread jobs


def _lost_chunks(session: Session, clock: ColumnElement[float]) -> Rows:
    """Chunks whose lease ran out, with their jobs."""
    rows = session.execute(
        select(
            jobs.c.id,
            jobs.c.fence,
            jobs.c.max_attempts,
            job_chunks.c.generation,
            job_chunks.c.number,
            job_chunks.c.fence.label("lost_fence"),
            job_chunks.c.attempt.label("lost_attempt"),
        )
        .join(jobs, jobs.c.id == job_chunks.c.job_id)
        .where(CHUNKS.lost(clock), jobs.c.status.in_(HELD))
        .order_by(job_chunks.c.job_id, job_chunks.c.number)
        .limit(ROUND_LIMIT)
    )
    return list(rows.all())


def _reopen(session: Session, row: Row[Any]) -> bool:
    key = (row.id, row.generation, row.number)
    still = job_chunks.c.status == RUNNING
    return CHUNKS.reap(session, key, row.lost_fence, still, status=OPEN) is not None


def _never_wound_down(session: Session, clock: ColumnElement[float]) -> Rows:
    """Cancelled jobs without a holder that no worker has ended."""
    cancelling = jobs.c.status == JobStatus.CANCELLING.value
    rows = session.execute(
        select(jobs.c.id, jobs.c.fence)
        .where(HANDED_OUT, cancelling, jobs.c.updated_at < clock - WIND_DOWN_WITHIN_S)
        .limit(ROUND_LIMIT)
    )
    return list(rows.all())


def _unheard_chunks(session: Session, clock: ColumnElement[float], after_s: float) -> dict[str, int]:
    """Jobs whose messages must have been lost, and how many chunks of each wait; marked as published now."""
    last = select(func.max(job_chunks.c.at)).where(job_chunks.c.job_id == jobs.c.id).scalar_subquery()
    waiting = (
        select(func.count())
        .select_from(job_chunks)
        .where(job_chunks.c.job_id == jobs.c.id, job_chunks.c.status == OPEN)
        .scalar_subquery()
    )
    nobody_came = and_(last < clock - after_s, jobs.c.published_at < clock - after_s, waiting > 0)
    not_advanced = and_(must_go_on(), last < clock - min(ADVANCE_WITHIN_S, after_s))
    rows = session.execute(
        select(jobs.c.id, waiting.label("open"))
        .where(HANDED_OUT, nobody_came | not_advanced)
        .order_by(jobs.c.id)
        .limit(PUBLISH_LIMIT)
    ).all()
    if rows:
        heard = jobs.c.id.in_([row.id for row in rows])
        session.execute(update(jobs).where(heard, HANDED_OUT).values(published_at=clock))
    return {row.id: max(int(row.open), 1) for row in rows}
