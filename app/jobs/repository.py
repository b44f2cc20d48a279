"""SQL of jobs as their owner sees them; every read is filtered by owner."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import ColumnElement, delete, select

from app.database import Session
from app.documents import unpacked_json
from app.errors import ArtifactNotFound, JobNotFinished, JobNotFound
from app.jobs.records import FINISHED, Event, Job, StoredArtifact, moment
from app.jobs.rows import JOB_COLUMNS, get_job, job_from_row
from app.tables import artifacts, idempotency_keys, job_events, job_results, jobs

ROUNDED_S = 0.5e-6  # moments are shown in whole microseconds: one that was shown means the job it came from


@dataclass(frozen=True, slots=True)
class JobFilter:
    """Which jobs a list shows; what is empty or None does not narrow it.

    Attributes
    ----------
    statuses : tuple of str
        Any of these.
    operation, label : str or None
        Exactly this.
    created_after, created_before : datetime or None
        The first moment that counts, and the first that counts no more.
    """

    statuses: tuple[str, ...] = ()
    operation: str | None = None
    label: str | None = None
    created_after: datetime | None = None
    created_before: datetime | None = None

    def conditions(self) -> Iterator[ColumnElement[bool]]:
        """The same in SQL."""
        if self.statuses:
            yield jobs.c.status.in_(self.statuses)
        if self.operation is not None:
            yield jobs.c.operation == self.operation
        if self.label is not None:
            yield jobs.c.label == self.label
        if self.created_after is not None:
            yield jobs.c.created_at >= self.created_after.timestamp() - ROUNDED_S
        if self.created_before is not None:
            yield jobs.c.created_at < self.created_before.timestamp() - ROUNDED_S


def list_jobs(
    session: Session, owner: str, wanted: JobFilter, *, before: str | None, limit: int
) -> list[Job]:
    """Newest jobs first, older than the id `before` when given."""
    query = select(*JOB_COLUMNS).where(jobs.c.owner == owner, *wanted.conditions())
    if before is not None:
        query = query.where(jobs.c.id < before)
    rows = session.execute(query.order_by(jobs.c.id.desc()).limit(limit))
    return [job_from_row(row) for row in rows]


def events_after(session: Session, owner: str, job_id: str, seq: int, limit: int) -> list[Event]:
    """Events of a job after number `seq`, oldest first; empty for a job that is not the owner's."""
    rows = session.execute(
        select(job_events.c.seq, job_events.c.type, job_events.c.payload, job_events.c.at)
        .join(jobs, jobs.c.id == job_events.c.job_id)
        .where(jobs.c.owner == owner, job_events.c.job_id == job_id, job_events.c.seq > seq)
        .order_by(job_events.c.seq)
        .limit(limit)
    )
    return [Event(row.seq, row.type, row.payload, moment(row.at)) for row in rows]


def result_json(session: Session, owner: str, job_id: str) -> bytes | None:
    """Return the JSON text of a job's result, None while there is none.

    Raises
    ------
    JobNotFound
        When `owner` has no such job.
    """
    row = session.execute(
        select(job_results.c.document)
        .select_from(jobs)
        .outerjoin(job_results, job_results.c.job_id == jobs.c.id)
        .where(jobs.c.id == job_id, jobs.c.owner == owner)
    ).one_or_none()
    if row is None:
        raise JobNotFound(job_id)
    return None if row.document is None else unpacked_json(row.document)


def list_artifacts(session: Session, owner: str, job_id: str) -> list[StoredArtifact]:
    """Files of a job, by name.

    Raises
    ------
    JobNotFound
        When `owner` has no such job.
    """
    get_job(session, owner, job_id)
    rows = session.execute(
        select(artifacts.c.name, artifacts.c.media_type, artifacts.c.size_bytes)
        .where(artifacts.c.job_id == job_id)
        .order_by(artifacts.c.name)
    )
    return [StoredArtifact(row.name, row.media_type, row.size_bytes) for row in rows]


def artifact_data(session: Session, owner: str, job_id: str, name: str) -> tuple[str, bytes]:
    """Return media type and content of one file.

    Raises
    ------
    ArtifactNotFound
        When the job left no such file, or is not the owner's.
    """
    row = session.execute(
        select(artifacts.c.media_type, artifacts.c.data)
        .join(jobs, jobs.c.id == artifacts.c.job_id)
        .where(jobs.c.id == job_id, jobs.c.owner == owner, artifacts.c.name == name)
    ).one_or_none()
    if row is None:
        raise ArtifactNotFound(job_id, name)
    return row.media_type, bytes(row.data)


def delete_job(session: Session, owner: str, job_id: str) -> None:
    """Delete a finished job with its events, result and files; its model stays.

    Raises
    ------
    JobNotFound
        When `owner` has no such job.
    JobNotFinished
        When it has not ended.
    """
    deleted = session.execute(
        delete(jobs)
        .where(jobs.c.id == job_id, jobs.c.owner == owner, jobs.c.status.in_(FINISHED))
        .returning(jobs.c.id)
    ).one_or_none()
    if deleted is None:
        raise JobNotFinished(job_id, get_job(session, owner, job_id).status.value)
    session.execute(delete(idempotency_keys).where(idempotency_keys.c.job_id == job_id))
