"""Endpoints of identified models."""

from __future__ import annotations

from operator import attrgetter
from typing import Annotated, Any

from fastapi import APIRouter, Query, Response
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import JSONResponse

from app.audit.records import Action
from app.audit.repository import note
from app.database import Session
from app.errors import ExportFailed, InvalidRequest, ModelNotFound, QuotaExceeded
from app.http.context import CallerDep, OwnerDep, ServiceDep, demands
from app.http.parameters import CursorQuery, IdPath, LimitQuery, PreferHeader, wait_seconds
from app.http.problems import documented
from app.jobs.artifacts import artifact_headers
from app.jobs.schemas import Job
from app.keys.records import Scope
from app.models import repository, service
from app.models.schemas import IdentifiedModel, ModelPage
from morphdata.export import FormatName
from morphdata.formats import FORMATS, format_named

router = APIRouter(tags=["models"], generate_unique_id_function=attrgetter("name"))

EXPORT_WAIT_S = 5.0  # unless the client prefers another time; a free worker needs about a second
ASK_AGAIN_S = 2  # while the job that writes the file is under way
FORMATS_TEXT = " ".join(f"`{each.name}`: {each.title}" for each in FORMATS)
EXPORTED: dict[int | str, dict[str, Any]] = {
    200: {
        "description": "The file.",
        "headers": {"Content-Disposition": {"description": "The file's name.", "schema": {"type": "string"}}},
        "content": {
            each.media_type: {
                "schema": {}
                if each.media_type == "application/json"
                else {"type": "string", "format": "binary"}
            }
            for each in FORMATS
        },
    },
    202: {
        "model": Job,
        "description": "The job that writes the file; retry later.",
        "headers": {
            "Location": {"description": "The job.", "schema": {"type": "string"}},
            "Retry-After": {"description": "When to retry, s.", "schema": {"type": "string"}},
        },
    },
}


@router.get(
    "/models",
    dependencies=[demands(Scope.DATA_READ)],
    summary="List identified models",
    responses=documented(InvalidRequest),
)
def list_models(
    app: ServiceDep,
    owner: OwnerDep,
    cursor: CursorQuery = None,
    limit: LimitQuery = 50,
) -> ModelPage:
    """Your identified models, newest first."""
    with app.database.read() as session:
        return repository.list_models(session, owner, cursor=cursor, limit=limit)


@router.get(
    "/models/{model_id}",
    dependencies=[demands(Scope.DATA_READ)],
    summary="Get an identified model",
    responses=documented(InvalidRequest, ModelNotFound),
)
def get_model(app: ServiceDep, owner: OwnerDep, model_id: IdPath) -> IdentifiedModel:
    """Return parameters, fit, aircraft and flight of one model."""
    with app.database.read() as session:
        summary, document = repository.get_model(session, owner, model_id)
    return IdentifiedModel(**summary.model_dump(), **document)


@router.delete(
    "/models/{model_id}",
    dependencies=[demands(Scope.DATA_WRITE)],
    summary="Delete an identified model",
    status_code=204,
    responses=documented(InvalidRequest, ModelNotFound),
)
def delete_model(app: ServiceDep, caller: CallerDep, model_id: IdPath) -> None:
    """Delete a model; its job keeps the result, and jobs that were started with it have copies."""

    def remove(session: Session) -> None:
        repository.delete_model(session, caller.owner, model_id)
        note(session, caller, Action.MODEL_DELETE, model_id)

    app.database.write_even_if_full(remove)


@router.get(
    "/models/{model_id}/export",
    dependencies=[demands(Scope.DATA_READ, Scope.JOBS_WRITE)],
    summary="Export an identified model as a file",
    description="Answer with the file if it is there within 5 s (or as long as `Prefer: wait=n` says), else "
    f"with the job that writes it: one for each model and format.\n\n{FORMATS_TEXT}",
    response_class=Response,
    responses={
        **EXPORTED,
        **documented(InvalidRequest, ModelNotFound, ExportFailed, QuotaExceeded),
    },
)
async def export_model(
    app: ServiceDep,
    caller: CallerDep,
    model_id: IdPath,
    name: Annotated[FormatName, Query(alias="format", description="Of the file.")],
    prefer: PreferHeader = None,
) -> Response:
    """Answer with the file, or with the job that writes it."""
    file_format = format_named(name)
    max_s = app.settings.max_wait_s
    wait_s = min(EXPORT_WAIT_S, max_s) if prefer is None else wait_seconds(prefer, max_s)
    job = await service.export_job(app, caller, model_id, file_format, wait_s)
    if job.finished_at is None:
        headers = {"Location": f"/jobs/{job.id}", "Retry-After": str(ASK_AGAIN_S)}
        return JSONResponse(job.model_dump(mode="json"), 202, headers)
    data = await run_in_threadpool(service.exported_file, app, caller, job, file_format)
    file_name = f"{model_id}{file_format.ending}"
    headers = {**artifact_headers(file_name), "Content-Disposition": f'attachment; filename="{file_name}"'}
    return Response(data, media_type=file_format.media_type, headers=headers)
