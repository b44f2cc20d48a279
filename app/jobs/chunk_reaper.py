"""The reaper's part for spread jobs: chunks of lost workers, generations left alone, lost messages."""

from __future__ import annotations

from collections import Counter
from typing import Any

from sqlalchemy import ColumnElement, Row, and_, func, select, update

from app.database import Session, database_time
from app.documents import Document
from app.jobs.chunk_rows import CHUNKS, HANDED_OUT, OPEN, RUNNING, must_go_on
from app.jobs.records import HELD, JobStatus, ReapReport
from app.jobs.rows import JOBS
from app.leases import Note
from app.observability.counters import count
from app.observability.job_counts import CHUNK_LEASES_LOST
from app.tables import job_chunks, jobs

ROUND_LIMIT = 500  # rows per round
PUBLISH_LIMIT = 100  # messages per round
# A job may begin `max_attempts` times; each of its chunks may be lost three times as often. Where one chunk
# in a hundred is lost, one job in forty of 25,600 chunks would lose some chunk three times by mere chance.
LOSSES_PER_ATTEMPT = 3
ADVANCE_WITHIN_S = 2.0  # who stores the last chunk takes the job over in the same breath, or has died
WIND_DOWN_WITHIN_S = 15.0  # a woken worker ends a cancelled job at once; if none is free, we do


def reap_chunks(session: Session, clock: ColumnElement[float], republish_after_s: float) -> ReapReport:
    """Make one round; publish each id of ``publish``, one for each chunk, after the commit."""
    lost = _lost_chunks(session, clock)
    # jobs before chunks, as everywhere: who locks in another order waits for each other
    failed = tuple(dict.fromkeys(row.job_id for row in lost if _given_up(row) and _fail(session, row)))
    cancelled = tuple(row.id for row in _never_wound_down(session, clock) if _cancel(session, row))
    again = Counter(row.job_id for row in lost if row.job_id not in failed and _reopen(session, row))
    count(session, CHUNK_LEASES_LOST, by=again.total())
    unheard = _unheard(session, clock, republish_after_s)
    again |= Counter(unheard)
    publish = tuple(again.elements())
    return ReapReport(failed=failed, cancelled=cancelled, publish=publish[:PUBLISH_LIMIT])


def _lost_chunks(session: Session, clock: ColumnElement[float]) -> list[Row[*tuple[Any, ...]]]:
    """Chunks whose lease ran out."""
    rows = session.execute(
        select(
            job_chunks.c.job_id,
            job_chunks.c.generation,
            job_chunks.c.number,
            job_chunks.c.fence,
            job_chunks.c.attempt,
            jobs.c.max_attempts,
            jobs.c.fence.label("job_fence"),
        )
        .join(jobs, jobs.c.id == job_chunks.c.job_id)
        .where(CHUNKS.lost(clock), jobs.c.status.in_(HELD))
        .order_by(job_chunks.c.job_id, job_chunks.c.number)
        .limit(ROUND_LIMIT)
    )
    return list(rows.all())


def _given_up(row: Row[*tuple[Any, ...]]) -> bool:
    return bool(row.attempt >= row.max_attempts * LOSSES_PER_ATTEMPT)


def _reopen(session: Session, row: Row[*tuple[Any, ...]]) -> bool:
    key = (row.job_id, row.generation, row.number)
    still = job_chunks.c.status == RUNNING
    return CHUNKS.reap(session, key, row.fence, still, status=OPEN) is not None


def _fail(session: Session, row: Row[*tuple[Any, ...]]) -> bool:
    error: Document = {
        "code": "worker_lost",
        "detail": f"The worker died or stalled in each of {row.attempt} attempts at a part of a generation.",
        "hint": "This happens if a search runs out of memory: use fewer particles, or see its log.",
    }
    return _end(session, row.job_id, row.job_fence, JobStatus.FAILED, {"error": error})


def _never_wound_down(session: Session, clock: ColumnElement[float]) -> list[Row[*tuple[Any, ...]]]:
    """Cancelled jobs in nobody's hands that no worker came to end."""
    cancelling = jobs.c.status == JobStatus.CANCELLING.value
    rows = session.execute(
        select(jobs.c.id, jobs.c.fence)
        .where(HANDED_OUT, cancelling, jobs.c.updated_at < clock - WIND_DOWN_WITHIN_S)
        .limit(ROUND_LIMIT)
    )
    return list(rows.all())


def _cancel(session: Session, row: Row[*tuple[Any, ...]]) -> bool:
    return _end(session, row.id, row.fence, JobStatus.CANCELLED, {})


def _end(session: Session, job_id: str, fence: int, status: JobStatus, more: Document) -> bool:
    ended = JOBS.reap(
        session,
        (job_id,),
        fence,
        HANDED_OUT,
        note=Note(status.value, {"reason": "lease_lost", **more} if more else None),
        status=status.value,
        finished_at=database_time(),
        **more,
    )
    return ended is not None


def _unheard(session: Session, clock: ColumnElement[float], after_s: float) -> dict[str, int]:
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
