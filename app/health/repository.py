"""SQL of health and metrics: counts over all owners, no content. Each query uses an index."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from sqlalchemy import func, select, true

from app.database import Session, database_time
from app.health.presence import REMEMBERED_S, is_gone
from app.health.schemas import WorkerState
from app.jobs.records import HELD, JobStatus
from app.observability.counters import Counted, read_counters
from app.tables import STATUSES, job_chunks, jobs, webhook_deliveries, workers

SILENT_BEATS = 3  # a worker that missed this many signs of life is stalled
GONE_S = 60.0  # a worker that is silent for longer, and whose process is not visible from here, is gone


@dataclass(frozen=True, slots=True)
class Snapshot:
    """Counts of the service's rows."""

    jobs: Mapping[str, int]  # by state, each state there
    oldest_queued_s: float
    flights_per_s: float  # of all running jobs
    chunks: Mapping[str, int]  # of spread jobs: open, running
    deliveries_waiting: int  # of webhooks
    workers: WorkerState
    counters: Sequence[Counted]


def snapshot(session: Session, beat_s: float) -> Snapshot:
    """Count everything once; workers write a sign of life every `beat_s`."""
    return Snapshot(
        jobs=_jobs(session),
        oldest_queued_s=_oldest_queued_s(session),
        flights_per_s=_flights_per_s(session),
        chunks=_chunks(session),
        deliveries_waiting=_deliveries_waiting(session),
        workers=count_workers(session, beat_s),
        counters=read_counters(session),
    )


def count_workers(session: Session, beat_s: float, *, host: str | None = None) -> WorkerState:
    """Count workers, of one host or of all; ages of signs of life are by the database's clock.

    A worker whose process has ended is not counted: at once if its process is visible from here, otherwise
    after `GONE_S` of silence. An existing but silent worker is stalled.
    """
    silence = (database_time() - workers.c.seen_at).label("silent_s")
    rows = session.execute(
        select(silence, workers.c.slots, workers.c.busy, workers.c.process).where(
            workers.c.stopped_at.is_(None),
            workers.c.seen_at > database_time() - REMEMBERED_S,
            true() if host is None else workers.c.name.startswith(f"{host}:", autoescape=True),
        )
    )
    silent_s = SILENT_BEATS * beat_s
    alive, stalled = [], 0
    for row in rows:
        gone = is_gone(row.process)
        if gone is None:
            gone = row.silent_s > max(GONE_S, silent_s)
        if not gone and row.silent_s <= silent_s and row.slots > 0:
            alive.append(row)
        elif not gone:
            stalled += 1
    return WorkerState(
        status="ok" if alive else "stalled" if stalled else "none",
        alive=len(alive),
        stalled=stalled,
        slots=sum(row.slots for row in alive),
        busy=sum(row.busy for row in alive),
    )


def _jobs(session: Session) -> dict[str, int]:
    counts = dict.fromkeys(STATUSES, 0)
    for status, number in session.execute(select(jobs.c.status, func.count()).group_by(jobs.c.status)):
        counts[status] = number
    return counts


def _oldest_queued_s(session: Session) -> float:
    # ids rise with time: the smallest id is in the index, the earliest time of creation is not
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
    waiting = webhook_deliveries.c.status == "waiting"
    return int(session.scalar(select(func.count()).select_from(webhook_deliveries).where(waiting)) or 0)
