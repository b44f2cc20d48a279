"""The life of a spread job: its work handed out as chunks, claimed, stored exactly once, and taken up again.

Like the job store, every function takes a `Session` and leaves the commit to its caller. A chunk has a lease
and a fence of its own; an outcome is stored where job, generation, number, fence and state are the claim's,
and only there. The claim on the job itself is given up while its chunks are flown and taken again, with a
higher fence, by the worker that finds all stored or that must end the job.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from sqlalchemy import delete, insert, select

from app.database import Session, database_time
from app.documents import Document
from app.jobs.records import ChunkClaim, Claim
from app.jobs.rows import CHUNKS, DONE, HANDED_OUT, JOBS, OPEN, Unit, must_go_on
from app.jobs.store import claim_from_row, replace_checkpoint, save_progress
from app.jobs.turns import note_served
from app.tables import job_checkpoints, job_chunks, jobs


@dataclass(frozen=True, slots=True)
class Flown:
    """What the chunks of a generation brought."""

    outcomes: tuple[bytes, ...]  # in the order in which the tasks were handed out
    elapsed_s: float  # since they were handed out
    before: Document  # the progress shown until now


def hand_out(
    session: Session,
    claim: Claim,
    tasks: Sequence[bytes],
    checkpoint: bytes,
    progress: Document | None = None,
) -> bool:
    """Give a claimed job up for chunks; return False for a stale claim.

    Publish the job's id once for each task after the commit. The chunks of the generation before are deleted;
    `progress` is written when it is given.
    """
    if progress is not None and not save_progress(session, claim, progress, None):
        return False
    row = JOBS.settle(session, claim, spread=True, published_at=database_time(), **JOBS.unheld)
    if row is None:
        return False
    replace_checkpoint(session, claim, checkpoint)
    earlier = session.scalars(
        delete(job_chunks).where(job_chunks.c.job_id == claim.job_id).returning(job_chunks.c.generation)
    ).all()
    same = {
        "job_id": claim.job_id,
        "generation": max(earlier, default=-1) + 1,
        "owner": claim.owner,
        "status": OPEN,
        "attempt": 0,
        "fence": 0,
        "at": row.updated_at,
    }
    chunks = [{**same, "number": number, "task": task} for number, task in enumerate(tasks)]
    session.execute(insert(job_chunks), chunks)
    return True


def claim_chunk(session: Session, unit: Unit, worker_name: str, lease_s: float) -> ChunkClaim | None:
    """Take an open chunk; None when it is not open any more."""
    lease_until = database_time() + lease_s
    row = CHUNKS.claim(session, unit.key, lease_until=lease_until, worker=worker_name)
    if row is None:
        return None
    job = jobs.c.operation, jobs.c.max_attempts, jobs.c.request_id, jobs.c.traceparent
    found = session.execute(
        select(*job, job_chunks.c.task)
        .join(job_chunks, job_chunks.c.job_id == jobs.c.id)
        .where(*CHUNKS.at(unit.key))
    )
    note_served(session, row.owner)
    return ChunkClaim(
        job_id=unit.job_id,
        generation=unit.generation,
        number=unit.number,
        owner=row.owner,
        fence=row.fence,
        attempt=row.attempt,
        worker=worker_name,
        **found.mappings().one(),
    )


def finish_chunk(session: Session, chunk: ChunkClaim, outcome: bytes) -> bool:
    """Store the outcome of a chunk; return False when it is another worker's now, or deleted."""
    return CHUNKS.settle(session, chunk, status=DONE, outcome=outcome, **CHUNKS.unheld) is not None


def give_back_chunk(session: Session, chunk: ChunkClaim) -> bool:
    """Let another worker fly the chunk (graceful stop); the attempt is not counted."""
    return CHUNKS.give_back(session, chunk) is not None


def must_be_taken_over(session: Session, job_id: str) -> bool:
    """Whether a spread job waits for somebody to advance or to end it."""
    return session.scalar(select(jobs.c.id).where(jobs.c.id == job_id, must_go_on())) is not None


def take_over(
    session: Session, job_id: str, worker_name: str, lease_s: float, *, whatever: bool = False
) -> Claim | None:
    """Claim a spread job that must go on: the fence rises, the attempt does not.

    ``whatever`` claims it while chunks are still flown: one of them has shown that the job cannot be done.
    Returns None when another worker has it, or nothing is to be done.
    """
    row = JOBS.take(
        session,
        jobs.c.id == job_id,
        HANDED_OUT if whatever else must_go_on(),
        lease_until=database_time() + lease_s,
        worker=worker_name,
    )
    return None if row is None else replace(claim_from_row(row, worker_name), waited_s=0.0)


def flown(session: Session, claim: Claim) -> Flown | None:
    """Return what the chunks of a claimed job brought; None where there are none, or not all are stored."""
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
