"""SQL of jobs as their owner sees them; every read is filtered by owner."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import ColumnElement, delete, func, select, union_all

from app.database import Session
from app.documents import unpacked_json
from app.errors import ArtifactNotFound, JobNotFinished, JobNotFound, ResultNotReady
from app.jobs.records import FINISHED, Job
from app.jobs.rows import JOB_COLUMNS, get_job, job_from_row
from app.jobs.schemas import Artifact, ArtifactList, JobEvent, JobEventPage
from app.pages import read_page
from app.tables import (
    STATUSES,
    artifacts,
    idempotency_keys,
    job_events,
    job_requests,
    job_results,
    jobs,
)

EVENT_PAGE = 500
EVERY_STATUS = (None,)
ROUNDED_S = 0.5e-6  # times are shown in whole microseconds; a shown time must match the job it came from


@dataclass(frozen=True, slots=True)
class JobFilter:
    """Filter of a list of jobs; empty or None fields do not restrict it."""

    statuses: tuple[str, ...] = ()  # any of these
    operation: str | None = None
    label: str | None = None
    created_after: datetime | None = None  # inclusive
    created_before: datetime | None = None

    @property
    def ranges(self) -> tuple[str | None, ...]:
        """Statuses to list and merge; None if jobs of all statuses are read in one order."""
        if self.label is not None or (not self.statuses and self.operation is None):
            return EVERY_STATUS
        return tuple(dict.fromkeys(self.statuses)) or STATUSES

    def kinds(self) -> Iterator[ColumnElement[bool]]:
        """What kind of job, in SQL."""
        if self.label is None:
            if self.operation is not None:
                yield jobs.c.operation == self.operation
            return
        yield jobs.c.label == self.label
        # few jobs have the label: the other conditions are written so that no other index is chosen
        if self.operation is not None:
            yield func.lower(jobs.c.operation) == self.operation
        if self.statuses:
            yield func.lower(jobs.c.status).in_(self.statuses)

    def times(self) -> Iterator[ColumnElement[bool]]:
        """When they were made, in SQL."""
        if self.created_after is not None:
            yield jobs.c.created_at >= self.created_after.timestamp() - ROUNDED_S
        if self.created_before is not None:
            yield jobs.c.created_at < self.created_before.timestamp() - ROUNDED_S


def list_jobs(
    session: Session, owner: str, wanted: JobFilter, *, cursor: str | None, limit: int
) -> tuple[list[Job], str | None]:
    """One page of the owner's jobs, and the cursor of the next page; None on the last."""
    places = [] if cursor is None else [jobs.c.id < cursor]
    times = list(wanted.times())
    if times:
        ends = session.execute(
            select(func.min(jobs.c.id), func.max(jobs.c.id)).where(jobs.c.owner == owner, *places, *times)
        ).one()
        if ends[0] is None:
            return [], None
        # ids rise with time except for clock differences between hosts: hardly any job lies in between
        places = [jobs.c.id.between(*ends), *times]
    matches = [jobs.c.owner == owner, *wanted.kinds(), *places]
    if len(wanted.ranges) > 1:
        matches = [jobs.c.id.in_(_newest_ids(session, wanted.ranges, matches, limit + 1))]
    elif wanted.ranges != EVERY_STATUS:
        matches.append(jobs.c.status == wanted.ranges[0])
    query = select(*JOB_COLUMNS).where(*matches)
    rows, next_cursor = read_page(session, query, jobs.c.id, cursor=None, limit=limit)  # it is in `places`
    return [job_from_row(row) for row in rows], next_cursor


def _newest_ids(
    session: Session, statuses: Iterable[str | None], matches: list[ColumnElement[bool]], limit: int
) -> list[str]:
    """Ids of the newest jobs of each status: one range of an index for each, in order.

    With several statuses in one condition the database would read and sort every match.
    """
    newest = select(jobs.c.id).where(*matches).order_by(jobs.c.id.desc()).limit(limit)
    ranges = (newest.where(jobs.c.status == status).subquery() for status in statuses)
    found = session.scalars(union_all(*(select(part.c.id) for part in ranges)))
    return sorted(found, reverse=True)[:limit]


def event_page(session: Session, owner: str, job_id: str, after: int) -> JobEventPage:
    """Events of a job after number `after`, oldest first."""
    job = get_job(session, owner, job_id)
    rows = session.execute(
        select(job_events.c.seq, job_events.c.type, job_events.c.payload, job_events.c.at)
        .where(job_events.c.job_id == job_id, job_events.c.seq > after)
        .order_by(job_events.c.seq)
        .limit(EVENT_PAGE)
    )
    events = [JobEvent.model_validate(row) for row in rows]
    last = events[-1].seq if events else after
    return JobEventPage(events=events, last_seq=last, finished=job.finished and last >= job.event_seq)


def result_json(session: Session, owner: str, job_id: str) -> bytes | None:
    """Return the JSON text of a job's result, None while there is none."""
    get_job(session, owner, job_id)
    document = session.scalar(select(job_results.c.document).where(job_results.c.job_id == job_id))
    return None if document is None else unpacked_json(document)


def required_result_json(session: Session, owner: str, job_id: str) -> bytes:
    """Return the JSON text of a job's result; raise `ResultNotReady`, with the reason, if there is none."""
    text = result_json(session, owner, job_id)
    if text is not None:
        return text
    job = get_job(session, owner, job_id)
    if job.finished:
        reason = f" ({job.error['code']}: {job.error['detail']})" if job.error else ""
        hint = "It ended without a result; see its error, and submit a corrected request."
        raise ResultNotReady(f"Job {job_id} is {job.status.value}{reason}.", hint=hint)
    hint = f"Wait for the end: GET /jobs/{job_id} with Prefer: wait=30, or its events."
    raise ResultNotReady(f"Job {job_id} is still {job.status.value}.", hint=hint)


def request_json(session: Session, owner: str, job_id: str) -> bytes:
    """Return the JSON text of a job's request, every sample and model inline."""
    document = session.execute(
        select(job_requests.c.document)
        .join(jobs, jobs.c.id == job_requests.c.job_id)
        .where(jobs.c.id == job_id, jobs.c.owner == owner)
    ).scalar_one_or_none()
    if document is None:
        raise JobNotFound(job_id)
    return unpacked_json(document)


def list_artifacts(session: Session, owner: str, job_id: str) -> ArtifactList:
    """Files of a job, by name."""
    get_job(session, owner, job_id)
    rows = session.execute(
        select(artifacts.c.name, artifacts.c.media_type, artifacts.c.size_bytes)
        .where(artifacts.c.job_id == job_id)
        .order_by(artifacts.c.name)
    )
    files = [Artifact(href=f"/jobs/{job_id}/artifacts/{row['name']}", **row) for row in rows.mappings()]
    return ArtifactList(artifacts=files)


def artifact_data(session: Session, owner: str, job_id: str, name: str) -> bytes:
    """Return the content of one file; raise `ArtifactNotFound` if the owner has no such job or file."""
    data = session.execute(
        select(artifacts.c.data)
        .join(jobs, jobs.c.id == artifacts.c.job_id)
        .where(jobs.c.id == job_id, jobs.c.owner == owner, artifacts.c.name == name)
    ).scalar_one_or_none()
    if data is None:
        raise ArtifactNotFound(job_id, name)
    return bytes(data)


def delete_job(session: Session, owner: str, job_id: str) -> None:
    """Delete a finished job with its events, result and files; its model stays."""
    deleted = session.execute(
        delete(jobs)
        .where(jobs.c.id == job_id, jobs.c.owner == owner, jobs.c.status.in_(FINISHED))
        .returning(jobs.c.id)
    ).one_or_none()
    if deleted is None:
        raise JobNotFinished(job_id, get_job(session, owner, job_id).status.value)
    session.execute(delete(idempotency_keys).where(idempotency_keys.c.job_id == job_id))
