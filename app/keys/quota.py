"""Quotas of a key, counted in the transaction that uses them: two posts at the limit cannot both pass.

SQLite transactions that write hold the only write lock from their beginning; on Postgres the key's row is
locked until the commit. Both make charges of one key wait for one another, and nobody else.
"""

from __future__ import annotations

from dataclasses import dataclass

from sqlalchemy import ColumnElement, case, func, select, update

from app.database import Session, current_time, insert_new
from app.errors import QuotaExceeded
from app.jobs.records import FINISHED
from app.keys.records import Quota, Usage
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
SOON_S = 30  # when to ask again for room that other jobs of the key give back


@dataclass(frozen=True, slots=True)
class _Asked:
    """What one request wants of a key's quota."""

    jobs: int
    flights: int
    size_bytes: int


def usage_day(at_s: float) -> int:
    """Day that a moment of database time is counted to, days since 1970 UTC."""
    return int(at_s // DAY_S)


def charge(session: Session, key_id: str | None, *, flights: int, size_bytes: int = 0) -> None:
    """Take a new job's share of its key's quota; call it before the job's row is written.

    Parameters
    ----------
    key_id
        None where keys are off: nothing is limited then.
    flights : int
        As estimated; `settle` corrects it when the job has ended.
    size_bytes : int
        That the job's rows take so far.

    Raises
    ------
    QuotaExceeded
        Naming limit and use.
    """
    _charge(session, key_id, _Asked(jobs=1, flights=flights, size_bytes=size_bytes))


def charge_bytes(session: Session, key_id: str | None, size_bytes: int) -> None:
    """Make sure that the key may store `size_bytes` more; the row that is written next does the counting.

    Raises
    ------
    QuotaExceeded
        Naming limit and use.
    """
    _charge(session, key_id, _Asked(jobs=0, flights=0, size_bytes=size_bytes))


def settle(session: Session, job: LeasedRow, _note: Note) -> None:
    """Replace the estimate of a job that has ended by what it flew, on the day that it was charged to."""
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
    """Count what a key uses now."""
    today = usage_day(current_time(session))
    return Usage(_jobs_in_flight(session, key_id), _flights(session, key_id, today), _stored(session, key_id))


def _charge(session: Session, key_id: str | None, asked: _Asked) -> None:
    if key_id is None:
        return
    limits = (api_keys.c.max_jobs_in_flight, api_keys.c.max_flights_per_day, api_keys.c.max_stored_bytes)
    row = session.execute(
        select(*limits).where(api_keys.c.id == key_id).with_for_update()  # nothing on SQLite: see above
    ).one_or_none()
    if row is not None:
        _refuse_excess(session, key_id, Quota(*row), asked)
    if asked.flights:
        _add_flights(session, key_id, usage_day(current_time(session)), asked.flights)


def _refuse_excess(session: Session, key_id: str, quota: Quota, asked: _Asked) -> None:
    now = current_time(session)
    if quota.max_jobs_in_flight is not None and asked.jobs:
        _compare("jobs_in_flight", quota.max_jobs_in_flight, _jobs_in_flight(session, key_id), 1, SOON_S)
    if quota.max_flights_per_day is not None and asked.flights:
        used = _flights(session, key_id, usage_day(now))
        until_tomorrow_s = DAY_S - int(now % DAY_S)
        _compare("flights_per_day", quota.max_flights_per_day, used, asked.flights, until_tomorrow_s)
    if quota.max_stored_bytes is not None:
        used = _stored(session, key_id)
        _compare("stored_bytes", quota.max_stored_bytes, used, asked.size_bytes, SOON_S)


def _compare(name: str, limit: int, used: int, asked: int, retry_after_s: int) -> None:
    if used + asked > limit:
        raise QuotaExceeded(name, limit=limit, used=used, asked=asked, retry_after_s=retry_after_s)


def _jobs_in_flight(session: Session, key_id: str) -> int:
    held = select(func.count()).select_from(jobs).where(jobs.c.key_id == key_id, jobs.c.status.in_(IN_FLIGHT))
    return int(session.scalar(held) or 0)


def _flights(session: Session, key_id: str, day: int) -> int:
    row = select(key_usage.c.flights).where(key_usage.c.key_id == key_id, key_usage.c.day == day)
    return int(session.scalar(row) or 0)


def _stored(session: Session, key_id: str) -> int:
    """Bytes of the key's jobs, uploads and models, and of the state of its jobs that have not ended."""
    total = 0
    for table in (jobs, trajectories, models):
        size = select(_sum(table.c.size_bytes)).where(table.c.key_id == key_id)
        total += int(session.scalar(size) or 0)
    # asked for as it is now: it changes twice a second, and is gone when the job ends
    sizes = (
        (job_checkpoints, func.length(job_checkpoints.c.data)),
        (job_chunks, func.length(job_chunks.c.task) + func.coalesce(func.length(job_chunks.c.outcome), 0)),
    )
    for state, size_bytes in sizes:
        live = (
            select(_sum(size_bytes))
            .select_from(state)
            .join(jobs, jobs.c.id == state.c.job_id)
            .where(jobs.c.key_id == key_id, jobs.c.status.in_(IN_FLIGHT))
        )
        total += int(session.scalar(live) or 0)
    return total


def _sum(size_bytes: ColumnElement[int]) -> ColumnElement[int]:
    return func.coalesce(func.sum(size_bytes), 0)


def _add_flights(session: Session, key_id: str, day: int, flights: int) -> None:
    session.execute(
        insert_new(session, key_usage)
        .values(key_id=key_id, day=day, flights=flights)
        .on_conflict_do_update(
            index_elements=[key_usage.c.key_id, key_usage.c.day],
            set_={"flights": key_usage.c.flights + flights},
        )
    )
