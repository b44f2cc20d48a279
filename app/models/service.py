"""Export of an identified model: the job that writes the file, and its outcome."""

from __future__ import annotations

import hashlib
from typing import Any

from fastapi import Response
from fastapi.concurrency import run_in_threadpool

from app.errors import ExportFailed
from app.http.context import Caller, Service
from app.jobs import repository as jobs
from app.jobs.records import JobStatus
from app.jobs.schemas import Job
from app.models import repository
from app.operations.endpoints import Submission
from morphdata.export import ExportRequest
from morphdata.formats import ExportFormat
from morphdata.operations.export import EXPORT
from morphdata.version import VERSION

GIVEN_UP = frozenset({JobStatus.CANCELLED, JobStatus.EXPIRED})


async def export_job(
    app: Service, caller: Caller, model_id: str, file_format: ExportFormat, wait_s: float
) -> Job:
    """Find or create the job that exports a model, and wait for its end.

    There is one such job for each model, format and version of the program, as long as it is kept. If it was
    cancelled or has expired, it is replaced by a new one.

    Raises
    ------
    ModelNotFound
        The caller has no such model.
    InvalidInput
        This version cannot export the stored model.
    QuotaExceeded
        The quota of the caller's key does not allow another job.
    """
    request = await run_in_threadpool(_request, app, caller, model_id, file_format)
    words = f"export {VERSION} {model_id} {file_format.name}"
    while True:
        answer = Response()
        job = await Submission(app, caller, answer, _key(words), wait_s).accept(EXPORT, request)
        if job.status not in GIVEN_UP or "Idempotency-Replayed" not in answer.headers:
            return job
        words = f"{words} {job.id}"


def exported_file(app: Service, caller: Caller, job: Job, file_format: ExportFormat) -> bytes:
    """Read the file of a job that has ended.

    Raises
    ------
    ExportFailed
        The job did not succeed.
    """
    if job.status is not JobStatus.SUCCEEDED:
        error: Any = job.error
        raise ExportFailed(
            job.id,
            f"job_{job.status.value}" if error is None else error.code,
            f"Job {job.id} is {job.status.value}." if error is None else error.detail,
            "" if error is None else error.pointer,
            "" if error is None else error.hint,
        )
    with app.database.read() as session:
        return jobs.artifact_data(session, caller.owner, job.id, file_format.file)


def _request(app: Service, caller: Caller, model_id: str, file_format: ExportFormat) -> ExportRequest:
    with app.database.read() as session:
        _, stored = repository.get_model(session, caller.owner, model_id)
    return ExportRequest.parse(
        {
            "aircraft": stored["aircraft"],
            "flight": stored["flight"],
            "model": {"model_id": model_id},
            "format": file_format.name,
            "origin": {"id": model_id, "fit": stored["fit"]},
        }
    )


def _key(words: str) -> str:
    """An idempotency key that no client can send: theirs have no spaces."""
    return f"GET {hashlib.sha256(words.encode()).hexdigest()}"
