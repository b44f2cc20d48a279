"""Endpoints of jobs."""

from __future__ import annotations

from operator import attrgetter
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Header, Path, Query, Request, Response
from fastapi.responses import JSONResponse
from pydantic import AwareDatetime, BaseModel

from app.audit.records import Action
from app.audit.repository import note
from app.database import Session
from app.errors import (
    ArtifactNotFound,
    InvalidRequest,
    JobNotFinished,
    JobNotFound,
    ResultNotReady,
    TooManyStreams,
)
from app.http.context import CallerDep, OwnerDep, ServiceDep, demands
from app.http.parameters import ID_PATTERN, CursorQuery, LimitQuery, PreferHeader, wait_seconds
from app.http.problems import documented
from app.jobs import repository, store
from app.jobs.artifacts import MEDIA_TYPES, OTHER_FILES, artifact_headers, is_plain, media_type
from app.jobs.event_stream import EventStream, read_in_turn, wait_for_end
from app.jobs.records import Job as StoredJob
from app.jobs.records import JobStatus
from app.jobs.repository import JobFilter
from app.jobs.schemas import (
    EXAMPLE_ID,
    ArtifactList,
    Job,
    JobEventPage,
    JobPage,
    JobResult,
    OperationName,
)
from app.keys.records import Scope
from morphdata.execution import Label
from morphdata.operations import OPERATIONS
from morphdata.operations.descriptor import Operation

router = APIRouter(tags=["jobs"], generate_unique_id_function=attrgetter("name"))

JobId = Annotated[str, Path(pattern=ID_PATTERN, examples=[EXAMPLE_ID])]
FILE_KINDS: dict[str, Any] = {
    # any value for a JSON file; bytes for others
    kind.partition(";")[0]: {
        "schema": {} if kind == "application/json" else {"type": "string", "format": "binary"}
    }
    for kind in (OTHER_FILES, *MEDIA_TYPES.values())
}
EVENT_STREAM: dict[int | str, dict[str, Any]] = {
    200: {
        "model": JobEventPage,
        "description": "Events: a stream (`text/event-stream`), or a page (`Accept: application/json`).",
        "content": {
            "text/event-stream": {
                "schema": {"type": "string"},
                "example": 'id: 3\nevent: progress\ndata: {"fraction":0.25,"generation":5,"seq":3}\n\n',
            }
        },
    },
    204: {"description": "The job has ended and every event was seen: do not connect again."},
}

# by reference: the schemas of the bodies are already in the document
REQUEST: dict[str, Any] = {
    "description": "The request, in the form accepted by `POST /{operation}`.",
    "content": {
        "application/json": {
            "schema": {
                "anyOf": [
                    {"$ref": f"#/components/schemas/{operation.request.__name__}"} for operation in OPERATIONS
                ]
            }
        }
    },
}


def _files_of(operation: Operation[Any]) -> str:
    return f"Of `{operation.name}`: {', '.join(f'`{name}`' for name in operation.files)}."


def as_json(answer: BaseModel) -> Response:
    """Return a checked value directly; the framework would check and copy it once more."""
    return Response(answer.model_dump_json(), media_type="application/json")


def _wanted(
    status: Annotated[list[JobStatus] | None, Query(description="Any of these; repeatable.")] = None,
    operation: Annotated[OperationName | None, Query()] = None,
    label: Annotated[Label | None, Query(description="The `execution.label` of the request.")] = None,
    created_after: Annotated[
        AwareDatetime | None, Query(description="Created at or after this time.")
    ] = None,
    created_before: Annotated[AwareDatetime | None, Query(description="Created before this time.")] = None,
) -> JobFilter:
    return JobFilter(tuple(status or ()), operation, label, created_after, created_before)


JobFilterDep = Annotated[JobFilter, Depends(_wanted)]


@router.get(
    "/jobs",
    dependencies=[demands(Scope.JOBS_READ)],
    summary="List jobs",
    response_model=JobPage,
    responses=documented(InvalidRequest),
)
def list_jobs(
    app: ServiceDep,
    owner: OwnerDep,
    wanted: JobFilterDep,
    cursor: CursorQuery = None,
    limit: LimitQuery = 50,
) -> Response:
    """Your jobs, newest first, a page at a time."""
    with app.database.read() as session:
        found, next_cursor = repository.list_jobs(session, owner, wanted, cursor=cursor, limit=limit)
    return as_json(JobPage(jobs=[Job.of(job) for job in found], next_cursor=next_cursor))


@router.get(
    "/jobs/{job_id}",
    dependencies=[demands(Scope.JOBS_READ)],
    summary="Get a job",
    response_model=Job,
    responses=documented(InvalidRequest, JobNotFound, TooManyStreams),
)
async def get_job(app: ServiceDep, caller: CallerDep, job_id: JobId, prefer: PreferHeader = None) -> Response:
    """Status, progress, times and error of a job; with `Prefer: wait=n` it answers when the job has ended."""
    wait_s = wait_seconds(prefer, app.settings.max_wait_s)
    return as_json(await wait_for_end(app, caller, job_id, wait_s))


@router.get(
    "/jobs/{job_id}/events",
    dependencies=[demands(Scope.JOBS_READ)],
    summary="Follow a job",
    response_class=JSONResponse,
    response_model=JobEventPage,
    responses={**EVENT_STREAM, **documented(InvalidRequest, JobNotFound, TooManyStreams)},
)
async def get_job_events(
    request: Request,
    app: ServiceDep,
    caller: CallerDep,
    job_id: JobId,
    after: Annotated[int, Query(ge=0, le=2**31 - 1, description="Only events after this number.")] = 0,
    last_event_id: Annotated[
        str | None,
        Header(alias="Last-Event-ID", pattern=r"^\d{1,9}$", description="The same, as sent by browsers."),
    ] = None,
) -> Response:
    """Every event of the job from the beginning (or after a number), then new ones as they occur.

    The stream ends with the job. Comment lines in between are signs of life. `HEAD` gives the status and the
    headers, and opens no stream.
    """
    seen = max(after, int(last_event_id or 0))

    def read() -> JobEventPage:
        with app.database.read() as session:
            return repository.event_page(session, caller.owner, job_id, seen)

    page = await read_in_turn(app, caller.owner, read)
    accepted = request.headers.get("accept", "")
    if "application/json" in accepted and "text/event-stream" not in accepted:
        return JSONResponse(page.model_dump(mode="json"))
    if page.finished and not page.events:
        return Response(status_code=204)
    return EventStream(app, caller, job_id, seen)


@router.get(
    "/jobs/{job_id}/result",
    dependencies=[demands(Scope.JOBS_READ)],
    summary="Get the result of a job",
    response_model=JobResult,
    responses=documented(InvalidRequest, JobNotFound, ResultNotReady),
)
def get_job_result(app: ServiceDep, owner: OwnerDep, job_id: JobId) -> Response:
    """Return the result in the form of the job's operation.

    For a cancelled or expired search it is the best result so far, marked `"partial": true`.
    """
    with app.database.read() as session:
        text = repository.required_result_json(session, owner, job_id)
    return Response(text, media_type="application/json")


@router.get(
    "/jobs/{job_id}/request",
    dependencies=[demands(Scope.JOBS_READ)],
    summary="Get the request of a job",
    response_class=JSONResponse,
    responses={200: REQUEST, **documented(InvalidRequest, JobNotFound)},
)
def get_job_request(app: ServiceDep, owner: OwnerDep, job_id: JobId) -> Response:
    """Return the complete request, to inspect it or to post it again to the job's operation.

    It contains uploaded flights, identified models and defaults with their content at the time the job was
    posted. So it gives the same job even if they have been deleted since.
    """
    with app.database.read() as session:
        text = repository.request_json(session, owner, job_id)
    return Response(text, media_type="application/json")


@router.get(
    "/jobs/{job_id}/artifacts",
    dependencies=[demands(Scope.JOBS_READ)],
    summary="List the files of a job",
    description=" ".join(["Plots, tables and the result as files.", *map(_files_of, OPERATIONS)]),
    responses=documented(InvalidRequest, JobNotFound),
)
def list_job_artifacts(app: ServiceDep, owner: OwnerDep, job_id: JobId) -> ArtifactList:
    """List the files, by name."""
    with app.database.read() as session:
        return repository.list_artifacts(session, owner, job_id)


@router.get(
    "/jobs/{job_id}/artifacts/{name}",
    dependencies=[demands(Scope.JOBS_READ)],
    summary="Get a file of a job",
    response_class=Response,
    responses={
        200: {
            "description": "The file.",
            "content": FILE_KINDS,
        },
        **documented(InvalidRequest, ArtifactNotFound),
    },
)
def get_job_artifact(
    app: ServiceDep,
    owner: OwnerDep,
    job_id: JobId,
    name: Annotated[str, Path(min_length=1, max_length=200, examples=["convergence.svg"])],
) -> Response:
    """Return one file, with its own media type."""
    if not is_plain(name):  # also keeps the null character away from the database
        raise ArtifactNotFound(job_id, name)
    with app.database.read() as session:
        data = repository.artifact_data(session, owner, job_id, name)
    return Response(data, media_type=media_type(name), headers=artifact_headers(name))


@router.post(
    "/jobs/{job_id}/cancel",
    dependencies=[demands(Scope.JOBS_WRITE)],
    summary="Cancel a job",
    responses=documented(InvalidRequest, JobNotFound),
)
def cancel_job(app: ServiceDep, caller: CallerDep, job_id: JobId) -> Job:
    """Cancel a job in any state.

    A queued job ends at once; a running one within two seconds, with its best result so far as a partial
    result; a finished one is unchanged.
    """

    def cancel(session: Session) -> StoredJob:
        job = store.request_cancel(session, caller.owner, job_id)
        note(session, caller, Action.JOB_CANCEL, job_id)
        return job

    job = app.database.write_even_if_full(cancel)
    if job.status is JobStatus.CANCELLING:
        app.publisher.publish(job_id)  # a spread job has no holder: the worker that is woken winds it down
    return Job.of(job)


@router.delete(
    "/jobs/{job_id}",
    dependencies=[demands(Scope.JOBS_WRITE)],
    summary="Delete a finished job",
    status_code=204,
    responses=documented(InvalidRequest, JobNotFound, JobNotFinished),
)
def delete_job(app: ServiceDep, caller: CallerDep, job_id: JobId) -> None:
    """Delete a finished job with its events, result and files; its identified model stays."""

    def remove(session: Session) -> None:
        repository.delete_job(session, caller.owner, job_id)
        note(session, caller, Action.JOB_DELETE, job_id)

    app.database.write_even_if_full(remove)
