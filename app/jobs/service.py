"""What endpoints ask of jobs beyond single rows."""

from __future__ import annotations

from app.database import Session
from app.errors import ResultNotReady
from app.jobs import repository, store
from app.jobs.records import Job as StoredJob
from app.jobs.repository import JobFilter
from app.jobs.schemas import Job, JobEvent, JobEventPage, JobPage
from app.jobs.waiting import QueueView

EVENT_PAGE = 500


def shown(session: Session, queue: QueueView, job: StoredJob) -> Job:
    """Show a job, while it is queued with its place in the queue."""
    return Job.of(job, queue.place(session, job))


def page(session: Session, owner: str, wanted: JobFilter, *, cursor: str | None, limit: int) -> JobPage:
    """One page of the owner's jobs, newest first."""
    found, next_cursor = repository.list_jobs(session, owner, wanted, cursor=cursor, limit=limit)
    return JobPage(jobs=[Job.of(job) for job in found], next_cursor=next_cursor)


def event_page(
    session: Session, owner: str, job_id: str, after: int, limit: int = EVENT_PAGE
) -> JobEventPage:
    """Events of a job after number `after`."""
    job = store.get_job(session, owner, job_id)
    events = repository.events_after(session, owner, job_id, after, limit)
    last = events[-1].seq if events else after
    return JobEventPage(
        events=[JobEvent(seq=e.seq, type=e.type, payload=dict(e.payload), at=e.at) for e in events],
        last_seq=last,
        finished=job.finished and last >= job.event_seq,
    )


def result(session: Session, owner: str, job_id: str) -> bytes:
    """Return the JSON text of the result.

    Raises
    ------
    ResultNotReady
        While there is none, or when the job ended without one; says which.
    """
    text = repository.result_json(session, owner, job_id)
    if text is not None:
        return text
    job = store.get_job(session, owner, job_id)
    if job.finished:
        reason = f" ({job.error['code']}: {job.error['detail']})" if job.error else ""
        hint = "It ended without a result; see its error, and submit a corrected request."
        raise ResultNotReady(f"Job {job_id} is {job.status.value}{reason}.", hint=hint)
    hint = f"Wait for the end: GET /jobs/{job_id} with Prefer: wait=30, or its events."
    raise ResultNotReady(f"Job {job_id} is still {job.status.value}.", hint=hint)
