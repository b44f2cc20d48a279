"""SQL of health and metrics; counts of all owners, no content."""

from __future__ import annotations

from dataclasses import dataclass

from sqlalchemy import func, select

from app.database import Session, database_time
from app.jobs.records import JobStatus
from app.tables import STATUSES, jobs


@dataclass(frozen=True, slots=True)
class JobCounts:
    """Jobs per state, and how long the oldest queued one has waited, s."""

    by_status: dict[str, int]
    oldest_queued_s: float


def job_counts(session: Session) -> JobCounts:
    """Count jobs per state."""
    counts = dict.fromkeys(STATUSES, 0)
    for status, number in session.execute(select(jobs.c.status, func.count()).group_by(jobs.c.status)):
        counts[status] = number
    oldest = session.scalar(
        select(database_time() - func.min(jobs.c.created_at)).where(jobs.c.status == JobStatus.QUEUED.value)
    )
    return JobCounts(counts, max(oldest or 0.0, 0.0))
