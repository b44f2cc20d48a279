"""The life of a job as rows: created, claimed, kept alive, finished.

The row is the truth, messages are hints. Every function takes a `Session` and leaves the commit to its caller
(a worker, or an endpoint's transaction). Jobs are leased work (`app.leases`): every change of state is a
compare-and-set that writes its event in the same transaction. Writes of a worker carry its claim's fence; a
stale one changes nothing and returns False.
"""

from __future__ import annotations

from collections.abc import Mapping

from sqlalchemy import case, delete, insert, literal, or_, select

from app.database import Session, database_time
from app.documents import Document, finite, packed, unpacked
from app.errors import JobNotFound
from app.jobs.artifacts import store_artifacts
from app.jobs.chunk_rows import CHUNKS, at_rest, deadline_passed, in_time
from app.jobs.creation import create_job
from app.jobs.records import FINISHED, HELD, ChunkClaim, Claim, Job, JobStatus, LeaseState
from app.jobs.rows import JOBS, get_job, job_from_row, thin_events
from app.jobs.turns import note_served
from app.leases import LeasedRow, Note
from app.tables import job_checkpoints, job_chunks, job_requests, job_results, jobs

__all__ = [
    "claim_job",
    "create_job",
    "finish_job",
    "get_job",
    "load_checkpoint",
    "load_request",
    "look_at_lease",
    "release_job",
    "renew_lease",
    "request_cancel",
    "save_progress",
]


def load_request(session: Session, job_id: str) -> Document:
    """Return the request document of a job, every sample inline."""
    data = session.execute(
        select(job_requests.c.document).where(job_requests.c.job_id == job_id)
    ).scalar_one_or_none()
    if data is None:
        raise JobNotFound(job_id)
    document: Document = unpacked(data)
    return document


def claim_job(session: Session, job_id: str, worker_name: str, lease_s: float = 60.0) -> Claim | None:
    """Take a queued job: fence and attempt rise by one, the lease runs from now (database time).

    It is the turn of another owner then. Returns None when the job is not queued any more (someone else was
    first, or it was cancelled) or its time is over.
    """
    now = database_time()
    first = jobs.c.started_at.is_(None)
    row = JOBS.claim(
        session,
        (job_id,),
        in_time(),
        lease_until=now + lease_s,
        note=Note("started", {"worker": worker_name}),
        worker=worker_name,
        started_at=case((first, now), else_=jobs.c.started_at),
        deadline_at=case((first, now + jobs.c.max_seconds), else_=jobs.c.deadline_at),
    )
    if row is None:
        return None
    note_served(session, row.owner)
    return claim_from_row(row, worker_name)


def claim_from_row(row: LeasedRow, worker_name: str) -> Claim:
    """Turn the row of a job that was just claimed into the claim."""
    return Claim(
        job_id=row.id,
        owner=row.owner,
        operation=row.operation,
        fence=row.fence,
        attempt=row.attempt,
        max_attempts=row.max_attempts,
        worker=worker_name,
        max_seconds=row.max_seconds,
        request_id=row.request_id,
        traceparent=row.traceparent,
        waited_s=row.updated_at - row.created_at,
    )


def renew_lease(session: Session, claim: Claim | ChunkClaim, lease_s: float = 60.0) -> LeaseState:
    """The heartbeat: push the lease out and learn whether to stop."""
    (CHUNKS if isinstance(claim, ChunkClaim) else JOBS).renew(session, claim, lease_s)
    return look_at_lease(session, claim)


def look_at_lease(session: Session, claim: Claim | ChunkClaim) -> LeaseState:
    """Learn whether to stop, writing nothing: cheap enough to ask several times a second.

    The database's clock judges deadlines: a worker's may be an hour wrong.
    """
    query = select(jobs.c.status, deadline_passed().label("deadline_passed"))
    if isinstance(claim, ChunkClaim):
        query = query.join(job_chunks, job_chunks.c.job_id == jobs.c.id).where(jobs.c.status.in_(HELD))
        query = query.where(*CHUNKS.held_by(claim))
    else:
        query = query.where(*JOBS.held_by(claim))
    row = session.execute(query).one_or_none()
    if row is None:
        return LeaseState(held=False)
    return LeaseState(
        held=True,
        cancel_requested=row.status == JobStatus.CANCELLING.value,
        deadline_passed=bool(row.deadline_passed),
    )


def save_progress(session: Session, claim: Claim, progress: Document, checkpoint: bytes | None) -> bool:
    """Write progress, its event and (when given) the checkpoint, all or nothing.

    Parameters
    ----------
    progress : dict
        ``fraction`` (0..1), ``generation``, ``best_cost``, ``flights``, ``flights_per_s``, ``eta_s``,
        ``phase``, ``message``; any may be missing. NaN and infinity become null.

    Returns
    -------
    bool
        False when the claim is stale; nothing was written then.
    """
    clean = finite(progress)
    values: Document = {"progress": clean}
    if clean.get("flights") is not None:
        values["flights"] = int(clean["flights"])
    row = JOBS.settle(session, claim, note=Note("progress", clean), **values)
    if row is None:
        return False
    thin_events(session, row.id, row.event_seq)
    if checkpoint is not None:
        replace_checkpoint(session, claim, checkpoint)
    return True


def replace_checkpoint(session: Session, claim: Claim, checkpoint: bytes) -> None:
    """Write the checkpoint of a claimed job; only in a transaction that has proved the claim."""
    session.execute(delete(job_checkpoints).where(job_checkpoints.c.job_id == claim.job_id))
    session.execute(
        insert(job_checkpoints).values(
            job_id=claim.job_id, data=checkpoint, fence=claim.fence, at=database_time()
        )
    )


def load_checkpoint(session: Session, claim: Claim) -> bytes | None:
    """Return the last checkpoint of the claimed job, whichever attempt wrote it."""
    data = session.execute(
        select(job_checkpoints.c.data).where(job_checkpoints.c.job_id == claim.job_id)
    ).scalar_one_or_none()
    return None if data is None else bytes(data)


def finish_job(
    session: Session,
    claim: Claim,
    status: JobStatus | str,
    *,
    result: Document | None = None,
    error: Document | None = None,
    artifacts: Mapping[str, bytes] | None = None,
) -> bool:
    """End a claimed job, with what it leaves behind.

    Parameters
    ----------
    status
        ``succeeded``, ``failed``, ``cancelled`` or ``expired``. Any but the first marks a result as partial.
    error : dict, optional
        ``{"code", "detail", "hint"?, "pointer"?}`` of a failure; stored and shown as it is.
    artifacts : mapping, optional
        File name -> content.

    Returns
    -------
    bool
        False when the claim is stale; nothing was written then.
    """
    ending = JobStatus(status).value
    if ending not in FINISHED:
        raise ValueError(f"{ending} is not an end")
    partial = result is not None and ending != JobStatus.SUCCEEDED.value
    values: Document = {
        "status": ending,
        "partial": partial,
        "lease_until": None,
        "finished_at": database_time(),
    }
    if error is not None:
        values["error"] = finite(error)
    payload = {"error": values["error"]} if error is not None else None
    if ending == JobStatus.SUCCEEDED.value:
        # work that counts no flights has flown once
        values["flights"] = case((jobs.c.flights > 0, jobs.c.flights), else_=1)
    document = None if result is None else packed({**result, "partial": True} if partial else result)
    files = artifacts or {}
    values["size_bytes"] = jobs.c.size_bytes + len(document or b"") + sum(map(len, files.values()))
    if JOBS.settle(session, claim, note=Note(ending, payload, result), **values) is None:
        return False
    if document is not None:
        session.execute(
            insert(job_results).values(
                job_id=claim.job_id, document=document, partial=partial, at=database_time()
            )
        )
    store_artifacts(session, claim.job_id, files)
    return True


def release_job(session: Session, claim: Claim) -> bool:
    """Give a running job back to the queue with its checkpoint (graceful stop); the attempt is not counted.

    A job that was being cancelled ends as cancelled instead. Publish the id after the commit.
    """
    cancelling = jobs.c.status == JobStatus.CANCELLING.value
    row = JOBS.give_back(
        session,
        claim,
        note=Note("released", {"worker": claim.worker}),
        status=case((cancelling, literal(JobStatus.CANCELLED.value)), else_=literal(JobStatus.QUEUED.value)),
        finished_at=case((cancelling, database_time()), else_=None),
        published_at=database_time(),
    )
    return row is not None


def request_cancel(session: Session, owner: str, job_id: str) -> Job:
    """Ask a job to end: a queued one does at once, a running one winds down, a finished one stays as it is.

    A spread job at which nobody works just now ends at once as well: there is nobody to wind it down.
    Otherwise publish the id after the commit, so that some worker does.

    Raises
    ------
    JobNotFound
        When `owner` has no such job.
    """
    mine = (jobs.c.id == job_id, jobs.c.owner == owner)
    row = JOBS.change(
        session,
        *mine,
        or_(jobs.c.status == JobStatus.QUEUED.value, at_rest()),
        note=Note("cancelled"),
        status=JobStatus.CANCELLED.value,
        fence=jobs.c.fence + 1,
        finished_at=database_time(),
    ) or JOBS.change(
        session,
        *mine,
        jobs.c.status == JobStatus.RUNNING.value,
        note=Note("cancelling"),
        status=JobStatus.CANCELLING.value,
    )
    return get_job(session, owner, job_id) if row is None else job_from_row(row)
