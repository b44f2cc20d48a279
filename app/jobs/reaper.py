"""The reaper: ends what ran out of time, gives back what a dead worker held, repeats lost wake-up messages.

Any number of reapers may run at once: each change is a compare-and-set on the fence that the reaper saw.
"""

from __future__ import annotations

import logging
from typing import Any

from sqlalchemy import ColumnElement, Row, case, literal, or_, select, update

from app.database import Session, database_time
from app.documents import Document
from app.jobs.chunk_reaper import reap_chunks
from app.jobs.records import HELD, JobStatus, ReapReport
from app.jobs.rows import JOBS
from app.jobs.waiting import idle_slots
from app.leases import Note
from app.tables import jobs

# a worker that notices the deadline itself keeps its best so far; after this the reaper ends the job
DEADLINE_GRACE_S = 30.0
ROUND_LIMIT = 500  # rows per round: a round stays a short transaction whatever the backlog
PUBLISH_LIMIT = 100  # messages per round

log = logging.getLogger(__name__)


def reap(
    session: Session,
    now: float | None = None,
    *,
    republish_after_s: float = 15.0,
    deadline_grace_s: float = DEADLINE_GRACE_S,
) -> ReapReport:
    """Make one round and report what was done.

    Parameters
    ----------
    now : float, optional
        Seconds since 1970 UTC; the database's own clock when None.
    republish_after_s : float
        A job queued this long after its last message gets another.
    deadline_grace_s : float
        How long a running job may outlive its deadline while its worker winds down.

    Returns
    -------
    ReapReport
        Publish the ids in ``publish`` after the commit.
    """
    clock: ColumnElement[float] = database_time() if now is None else literal(now)
    done: dict[str, list[str]] = {"requeued": [], "failed": [], "cancelled": [], "expired": []}
    for row in _overdue(session, clock, deadline_grace_s):
        event, values = _verdict(row)
        error = {"error": values["error"]} if "error" in values else {}
        changed = JOBS.reap(
            session,
            (row.id,),
            row.fence,
            jobs.c.status == row.status,
            note=Note(event, {"reason": row.reason, **error}),
            **values,
        )
        if changed is not None:
            done[event].append(row.id)
    spread = reap_chunks(session, clock, republish_after_s)
    unheard = _unheard(session, clock, republish_after_s, set(done["requeued"]))
    return ReapReport(
        requeued=tuple(done["requeued"]),
        failed=(*done["failed"], *spread.failed),
        cancelled=(*done["cancelled"], *spread.cancelled),
        expired=tuple(done["expired"]),
        publish=(*done["requeued"], *spread.publish, *unheard),
    )


def log_ends(report: ReapReport) -> None:
    """Log the jobs that a round has changed."""
    for kind in ("requeued", "failed", "cancelled", "expired"):
        for job_id in getattr(report, kind):
            log.warning("reaper: job %s %s", job_id, kind)


def _overdue(session: Session, clock: ColumnElement[float], grace_s: float) -> list[Row[Any]]:
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
    """Decide what becomes of an overdue job: event type and columns to set."""
    end: Document = {"finished_at": database_time()}
    if row.status == JobStatus.CANCELLING.value:
        return "cancelled", {**end, "status": JobStatus.CANCELLED.value}
    if row.deadline_passed and row.started_at is None:
        error = {
            "code": "not_started_in_time",
            "detail": "No worker was free before the time that execution.expires_in_s set.",
            "hint": "Submit it again with a longer execution.expires_in_s, or without one.",
        }
        return "expired", {**end, "status": JobStatus.EXPIRED.value, "error": error}
    if row.deadline_passed:
        error = {
            "code": "deadline_exceeded",
            "detail": "The job did not end before its deadline.",
            "hint": "Raise search.max_seconds, or search with fewer particles, generations or links.",
        }
        return "expired", {**end, "status": JobStatus.EXPIRED.value, "error": error}
    if row.attempt >= row.max_attempts:
        error = {
            "code": "worker_lost",
            "detail": f"The worker died or stalled in each of {row.attempt} attempts.",
            "hint": "This happens if a search runs out of memory: use fewer particles, or see its log.",
        }
        return "failed", {**end, "status": JobStatus.FAILED.value, "error": error}
    return "requeued", {"status": JobStatus.QUEUED.value, "published_at": database_time()}


def _unheard(
    session: Session, clock: ColumnElement[float], after_s: float, fresh: set[str]
) -> tuple[str, ...]:
    """Queued jobs whose message may have been lost; they are marked as published now.

    As many as there are idle workers: a message is a wake-up for whatever job is next, and whoever ends a job
    passes on the next one. So the longest queue sends no more messages than somebody has a use for.
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
