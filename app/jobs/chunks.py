"""The life of a spread job: its work handed out as chunks, claimed, stored exactly once, and taken up again.

Like the job store, every function takes a `Session` and leaves the commit to its caller. A chunk has a lease
and a fence of its own; an outcome is stored where job, generation, number, fence and state are the claim's,
and only there. The claim on the job itself is given up while its chunks are flown and taken again, with a
higher fence, by whoever finds that all are stored or that the job must end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from sqlalchemy import ColumnElement, delete, insert, select, update

from app.database import Session, database_time
from app.documents import Document
from app.jobs.chunk_rows import DONE, HANDED_OUT, OPEN, RUNNING, Unit, must_go_on
from app.jobs.records import HELD, Claim, LeaseState
from app.jobs.rows import transition
from app.jobs.store import (
    LEASE_COLUMNS,
    claim_from_row,
    held_by,
    lease_state,
    replace_checkpoint,
    save_progress,
)
from app.jobs.turns import note_served
from app.tables import job_checkpoints, job_chunks, jobs


@dataclass(frozen=True, slots=True)
class ChunkClaim:
    """A worker's right to store the outcome of one chunk."""

    job_id: str
    owner: str
    operation: str
    generation: int
    number: int
    fence: int
    attempt: int
    worker: str
    task: bytes
    request_id: str | None = None
    traceparent: str | None = None


@dataclass(frozen=True, slots=True)
class Flown:
    """What the chunks of a generation brought.

    outcomes : in the order in which the tasks were handed out. elapsed_s : since they were handed out.
    before : the progress shown until now.
    """

    outcomes: tuple[bytes, ...]
    elapsed_s: float
    before: Document


def hand_out(
    session: Session,
    claim: Claim,
    tasks: Sequence[bytes],
    checkpoint: bytes,
    progress: Document | None = None,
) -> bool:
    """Give a claimed job up for chunks: progress, checkpoint and tasks, all or nothing.

    Publish the job's id once for each task after the commit.

    Parameters
    ----------
    tasks : what to fly, in order; the chunks of a generation before are forgotten.
    checkpoint : the state that the outcomes will be told to.
    progress : when it is news.

    Returns
    -------
    bool
        False when the claim is stale; nothing was written then.
    """
    if progress is not None and not save_progress(session, claim, progress, None):
        return False
    row = transition(
        session,
        *held_by(claim),
        event=None,
        spread=True,
        worker=None,
        lease_until=None,
        published_at=database_time(),
    )
    if row is None:
        return False
    replace_checkpoint(session, claim, checkpoint)
    earlier = session.scalars(
        delete(job_chunks).where(job_chunks.c.job_id == claim.job_id).returning(job_chunks.c.generation)
    ).all()
    generation = max(earlier, default=-1) + 1
    session.execute(
        insert(job_chunks),
        [
            {
                "job_id": claim.job_id,
                "generation": generation,
                "number": number,
                "owner": claim.owner,
                "status": OPEN,
                "attempt": 0,
                "fence": 0,
                "task": task,
                "at": row.updated_at,
            }
            for number, task in enumerate(tasks)
        ],
    )
    return True


def claim_chunk(session: Session, unit: Unit, worker_name: str, lease_s: float) -> ChunkClaim | None:
    """Take an open chunk; None when it is not open any more."""
    row = session.execute(
        update(job_chunks)
        .where(*_place(unit.job_id, unit.generation, unit.number), job_chunks.c.status == OPEN)
        .values(
            status=RUNNING,
            attempt=job_chunks.c.attempt + 1,
            fence=job_chunks.c.fence + 1,
            worker=worker_name,
            lease_until=database_time() + lease_s,
            at=database_time(),
        )
        .returning(job_chunks.c.owner, job_chunks.c.fence, job_chunks.c.attempt, job_chunks.c.task)
    ).one_or_none()
    if row is None:
        return None
    job = session.execute(
        select(jobs.c.operation, jobs.c.request_id, jobs.c.traceparent).where(jobs.c.id == unit.job_id)
    ).one()
    note_served(session, row.owner)
    return ChunkClaim(
        job_id=unit.job_id,
        owner=row.owner,
        operation=job.operation,
        generation=unit.generation,
        number=unit.number,
        fence=row.fence,
        attempt=row.attempt,
        worker=worker_name,
        task=bytes(row.task),
        request_id=job.request_id,
        traceparent=job.traceparent,
    )


def _place(job_id: str, generation: int, number: int) -> tuple[ColumnElement[bool], ...]:
    return (
        job_chunks.c.job_id == job_id,
        job_chunks.c.generation == generation,
        job_chunks.c.number == number,
    )


def _held(chunk: ChunkClaim) -> tuple[ColumnElement[bool], ...]:
    place = _place(chunk.job_id, chunk.generation, chunk.number)
    return (*place, job_chunks.c.fence == chunk.fence, job_chunks.c.status == RUNNING)


def look_at_chunk(session: Session, chunk: ChunkClaim) -> LeaseState:
    """Learn whether to stop, writing nothing."""
    return lease_state(
        session.execute(
            select(*LEASE_COLUMNS)
            .join(job_chunks, jobs.c.id == job_chunks.c.job_id)
            .where(*_held(chunk), jobs.c.status.in_(HELD))
        ).one_or_none()
    )


def renew_chunk(session: Session, chunk: ChunkClaim, lease_s: float) -> LeaseState:
    """The heartbeat: push the chunk's lease out and learn whether to stop."""
    session.execute(update(job_chunks).where(*_held(chunk)).values(lease_until=database_time() + lease_s))
    return look_at_chunk(session, chunk)


def finish_chunk(session: Session, chunk: ChunkClaim, outcome: bytes) -> bool:
    """Store what came of a chunk; False when it is another's now, or forgotten."""
    return _leave(session, chunk, status=DONE, outcome=outcome)


def give_back_chunk(session: Session, chunk: ChunkClaim) -> bool:
    """Let another worker fly the chunk (graceful stop); the attempt is not counted."""
    return _leave(session, chunk, status=OPEN, attempt=job_chunks.c.attempt - 1)


def _leave(session: Session, chunk: ChunkClaim, **values: Any) -> bool:
    left = (
        update(job_chunks)
        .where(*_held(chunk))
        .values(worker=None, lease_until=None, at=database_time(), **values)
        .returning(job_chunks.c.number)
    )
    return session.execute(left).one_or_none() is not None


def must_be_taken_over(session: Session, job_id: str) -> bool:
    """Whether a spread job waits for somebody to advance or to end it: a look that writes nothing."""
    return session.scalar(select(jobs.c.id).where(jobs.c.id == job_id, must_go_on())) is not None


def take_over(
    session: Session, job_id: str, worker_name: str, lease_s: float, *, whatever: bool = False
) -> Claim | None:
    """Claim a spread job that must go on: the fence rises, the attempt does not.

    Parameters
    ----------
    whatever : claim it though chunks are still flown: one of them has told that the job cannot be done.

    Returns
    -------
    Claim or None
        None when another worker has it, or nothing is to be done.
    """
    row = transition(
        session,
        jobs.c.id == job_id,
        HANDED_OUT if whatever else must_go_on(),
        event=None,
        fence=jobs.c.fence + 1,
        worker=worker_name,
        lease_until=database_time() + lease_s,
    )
    return None if row is None else replace(claim_from_row(row, worker_name), waited_s=0.0)


def flown(session: Session, claim: Claim) -> Flown | None:
    """What the chunks of a claimed job brought; None where there are none, or not all are stored."""
    rows = session.execute(
        select(job_chunks.c.status, job_chunks.c.outcome)
        .where(job_chunks.c.job_id == claim.job_id)
        .order_by(job_chunks.c.number)
    ).all()
    if not rows or any(row.status != DONE for row in rows):
        return None
    job = session.execute(
        select(jobs.c.progress, (database_time() - job_checkpoints.c.at).label("elapsed_s"))
        .join(job_checkpoints, job_checkpoints.c.job_id == jobs.c.id)
        .where(jobs.c.id == claim.job_id)
    ).one()
    return Flown(tuple(bytes(row.outcome) for row in rows), float(job.elapsed_s), dict(job.progress or {}))
