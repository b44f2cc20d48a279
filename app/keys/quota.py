"""Quotas of a key, counted in the transaction that uses them: two posts at the limit cannot both pass.

SQLite write transactions hold the only write lock from their beginning; on Postgres the key's row is locked
until the commit. In both cases charges of one key wait for one another, and only for those.
"""

from __future__ import annotations

from sqlalchemy import case, func, select, update

from app.database import Session, current_time, insert_new
from app.errors import QuotaExceeded
from app.jobs.records import FINISHED
from app.keys.records import Usage
from app.leases import LeasedRow, Note
from app.tables import (
    STATUSES,
    api_keys,
    job_checkpoints,
    job_chunks,
    jobs,
    key_usage,
    models,
    trajectories,
)

DAY_S = 86_400
IN_FLIGHT = tuple(status for status in STATUSES if status not in FINISHED)
SOON_S = 30  # s after which to retry, when other jobs of the key may have released their share


def usage_day(at_s: float) -> int:
    """Day to which a database time belongs, days since 1970 UTC."""
    return int(at_s // DAY_S)


def charge(
    session: Session, key_id: str | None, *, new_jobs: int = 0, flights: int = 0, size_bytes: int = 0
) -> None:
    """Take a share of a key's quota; call it before writing the rows that use it.

    Rows count jobs and bytes by themselves; flights are an estimate that `settle` corrects when the job has
    ended. If keys are off (`key_id` is None) nothing is limited.

    Raises
    ------
    QuotaExceeded
        Contains limit and use.
    """
    if key_id is None:
        return
    limits = (api_keys.c.max_jobs_in_flight, api_keys.c.max_flights_per_day, api_keys.c.max_stored_bytes)
    row = session.execute(
        select(*limits).where(api_keys.c.id == key_id).with_for_update()  # nothing on SQLite: see above
    ).one_or_none()
    now = current_time(session)
    max_jobs, max_flights, max_bytes = (None, None, None) if row is None else row
    if max_jobs is not None and new_jobs:
        _compare("jobs_in_flight", max_jobs, _jobs_in_flight(session, key_id), new_jobs, SOON_S)
    if max_flights is not None and flights:
        used = _flights(session, key_id, usage_day(now))
        _compare("flights_per_day", max_flights, used, flights, DAY_S - int(now % DAY_S))
    if max_bytes is not None:
        _compare("stored_bytes", max_bytes, _stored(session, key_id), size_bytes, SOON_S)
    if flights:
        row = insert_new(session, key_usage).values(key_id=key_id, day=usage_day(now), flights=flights)
        raised = {"flights": key_usage.c.flights + flights}
        session.execute(row.on_conflict_do_update(index_elements=list(key_usage.primary_key), set_=raised))


def settle(session: Session, job: LeasedRow, _note: Note) -> None:
    """Replace the estimate of an ended job by its actual flights, on the day to which it was charged."""
    if job.key_id is None or job.flights_estimated == job.flights:
        return
    corrected = key_usage.c.flights + (job.flights - job.flights_estimated)
    session.execute(
        update(key_usage)
        .where(key_usage.c.key_id == job.key_id, key_usage.c.day == usage_day(job.created_at))
        # never below zero: a job posted in the millisecond of midnight was charged to the day before
        .values(flights=case((corrected > 0, corrected), else_=0))
    )


def usage(session: Session, key_id: str) -> Usage:
    """Count the present use of a key."""
    today = usage_day(current_time(session))
    return Usage(_jobs_in_flight(session, key_id), _flights(session, key_id, today), _stored(session, key_id))


def _compare(name: str, limit: int, used: int, needed: int, retry_after_s: int) -> None:
    if used + needed > limit:
        raise QuotaExceeded(name, limit=limit, used=used, requested=needed, retry_after_s=retry_after_s)


def _jobs_in_flight(session: Session, key_id: str) -> int:
    held = select(func.count()).select_from(jobs).where(jobs.c.key_id == key_id, jobs.c.status.in_(IN_FLIGHT))
    return int(session.scalar(held) or 0)


def _flights(session: Session, key_id: str, day: int) -> int:
    row = select(key_usage.c.flights).where(key_usage.c.key_id == key_id, key_usage.c.day == day)
    return int(session.scalar(row) or 0)


def _stored(session: Session, key_id: str) -> int:
    """Bytes of the key's jobs, uploads and models, and of the state of its jobs that have not ended."""
    sizes = [
        select(func.sum(table.c.size_bytes)).where(table.c.key_id == key_id)
        for table in (jobs, trajectories, models)
    ]
    # measured now: it changes twice a second, and is gone when the job ends
    chunk_bytes = func.length(job_chunks.c.task) + func.coalesce(func.length(job_chunks.c.outcome), 0)
    for state, bytes_ in ((job_checkpoints, func.length(job_checkpoints.c.data)), (job_chunks, chunk_bytes)):
        live = select(func.sum(bytes_)).select_from(state).join(jobs, jobs.c.id == state.c.job_id)
        sizes.append(live.where(jobs.c.key_id == key_id, jobs.c.status.in_(IN_FLIGHT)))
    return sum(int(session.scalar(size) or 0) for size in sizes)
