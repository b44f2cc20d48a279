"""SQL of health and metrics; counts of all owners, no content. Each query walks along an index."""

from __future__ import annotations

from sqlalchemy import and_, case, func, select, true

from app.database import Session, database_time
from app.health.presence import REMEMBERED_S
from app.health.records import Snapshot, WorkerCounts
from app.jobs.records import HELD, JobStatus
from app.observability.counters import read_counters
from app.tables import STATUSES, job_chunks, jobs, webhook_deliveries, workers

SILENT_BEATS = 3  # a worker that missed so many of its signs of life is stalled


def snapshot(session: Session, beat_s: float) -> Snapshot:
    """Count everything once.

    Parameters
    ----------
    beat_s : how often workers show that they are there.
    """
    return Snapshot(
        jobs=_jobs(session),
        oldest_queued_s=_oldest_queued_s(session),
        flights_per_s=_flights_per_s(session),
        chunks=_chunks(session),
        deliveries_waiting=_deliveries_waiting(session),
        workers=count_workers(session, beat_s),
        counters=read_counters(session),
    )


def count_workers(session: Session, beat_s: float, *, host: str | None = None) -> WorkerCounts:
    """Count workers, of one host or of all; the time since their last sign of life is the database's."""
    age = database_time() - workers.c.seen_at
    here = workers.c.stopped_at.is_(None)
    alive = and_(here, age <= SILENT_BEATS * beat_s, workers.c.slots > 0)
    stalled = and_(here, ~and_(age <= SILENT_BEATS * beat_s, workers.c.slots > 0))
    row = session.execute(
        select(
            func.coalesce(func.sum(case((alive, 1), else_=0)), 0).label("alive"),
            func.coalesce(func.sum(case((stalled, 1), else_=0)), 0).label("stalled"),
            func.coalesce(func.sum(case((alive, workers.c.slots), else_=0)), 0).label("slots"),
            func.coalesce(func.sum(case((alive, workers.c.busy), else_=0)), 0).label("busy"),
        ).where(
            workers.c.seen_at > database_time() - REMEMBERED_S,
            true() if host is None else workers.c.name.startswith(f"{host}:", autoescape=True),
        )
    ).one()
    return WorkerCounts(int(row.alive), int(row.stalled), int(row.slots), int(row.busy))


def _jobs(session: Session) -> dict[str, int]:
    counts = dict.fromkeys(STATUSES, 0)
    for status, number in session.execute(select(jobs.c.status, func.count()).group_by(jobs.c.status)):
        counts[status] = number
    return counts


def _oldest_queued_s(session: Session) -> float:
    # ids rise with time: the least id stands in the index, the least time of creation does not
    oldest = select(func.min(jobs.c.id)).where(jobs.c.status == JobStatus.QUEUED.value).scalar_subquery()
    age = session.scalar(select(database_time() - jobs.c.created_at).where(jobs.c.id == oldest))
    return max(age or 0.0, 0.0)


def _flights_per_s(session: Session) -> float:
    progress = session.scalars(select(jobs.c.progress).where(jobs.c.status.in_(HELD)))
    return float(sum((each or {}).get("flights_per_s") or 0.0 for each in progress))


def _chunks(session: Session) -> dict[str, int]:
    counts = {"open": 0, "running": 0}
    found = session.execute(
        select(job_chunks.c.status, func.count().label("number"))
        .where(job_chunks.c.status.in_(tuple(counts)))
        .group_by(job_chunks.c.status)
    )
    return counts | {row.status: row.number for row in found}


def _deliveries_waiting(session: Session) -> int:
    return int(
        session.scalar(
            select(func.count())
            .select_from(webhook_deliveries)
            .where(webhook_deliveries.c.status == "waiting")
        )
        or 0
    )
