"""The life cycle of a spread job: work handed out as chunks, claimed, stored exactly once, and resumed.

As in the job store, every function takes a `Session` and leaves the commit to its caller. A chunk has its own
lease and fence; an outcome is stored only if job, generation, number, fence and state match the claim. The
claim on the job itself is released while its chunks are flown. It is taken again, with a higher fence, by the
worker that finds all chunks stored or must end the job.
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
    """The outcomes of a generation's chunks."""

    outcomes: tuple[bytes, ...]  # in the order of the tasks
    elapsed_s: float  # s since they were handed out
    before: Document  # the progress shown so far


def hand_out(
    session: Session,
    claim: Claim,
    tasks: Sequence[bytes],
    checkpoint: bytes,
    progress: Document | None = None,
) -> bool:
    """Release a claimed job as chunks; return False for a stale claim.

    Publish the job's id once for each task after the commit. The chunks of the previous generation are
    deleted; `progress` is written if given.
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
    """Claim an open chunk; None if it is no longer open."""
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
    """Store the outcome of a chunk; return False if it now belongs to another worker or was deleted."""
    return CHUNKS.settle(session, chunk, status=DONE, outcome=outcome, **CHUNKS.unheld) is not None


def give_back_chunk(session: Session, chunk: ChunkClaim) -> bool:
    """Let another worker fly the chunk (graceful stop); the attempt is not counted."""
    return CHUNKS.give_back(session, chunk) is not None


def must_be_taken_over(session: Session, job_id: str) -> bool:
    """Whether a spread job is waiting for a worker to advance or end it."""
    return session.scalar(select(jobs.c.id).where(jobs.c.id == job_id, must_go_on())) is not None


def take_over(
    session: Session, job_id: str, worker_name: str, lease_s: float, *, whatever: bool = False
) -> Claim | None:
    """Claim a spread job that must continue: the fence rises, the attempt does not.

    ``whatever`` claims it even while chunks are being flown, because one of them showed that the job cannot
    be done. Returns None if another worker has it, or there is nothing to do.
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
    """Return the outcomes of a claimed job's chunks; None if there are none, or not all are stored."""
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
