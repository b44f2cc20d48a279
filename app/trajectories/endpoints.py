"""Endpoints of uploaded trajectories."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Path, Request, Response
from fastapi.concurrency import run_in_threadpool
from fastapi.exceptions import RequestValidationError
from pydantic import ValidationError
from starlette.datastructures import UploadFile
from starlette.exceptions import HTTPException

from app.errors import (
    BodyTooLarge,
    InvalidRequest,
    MalformedBody,
    TrajectoryNotFound,
    UnsupportedMediaType,
)
from app.http.context import OwnerDep, Service, ServiceDep, demands
from app.http.json_body import parse_json
from app.http.problems import documented
from app.keys.records import Scope
from app.trajectories import repository, service
from app.trajectories.schemas import Trajectory, TrajectorySummary, TrajectoryUpload

router = APIRouter(tags=["trajectories"])

MAX_NAME_BYTES = 1024
FORM_SCHEMA: dict[str, Any] = {
    "title": "TrajectoryFile",
    "type": "object",
    "required": ["file"],
    "properties": {
        "file": {
            "type": "string",
            "format": "binary",
            "description": "CSV: t, sweep_left, sweep_right, phi, theta, psi; or with units: `theta_deg`.",
        },
        "name": {
            "type": "string",
            "description": "Name of the sample; that of the file when left out.",
            "examples": ["rate_0.5"],
        },
    },
}
REQUEST_BODY: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "content": {
            "multipart/form-data": {"schema": {"$ref": "#/components/schemas/TrajectoryFile"}},
            "application/json": {"schema": {"$ref": "#/components/schemas/TrajectoryUpload"}},
        },
    }
}


@router.post(
    "/trajectories",
    dependencies=[demands(Scope.DATA_WRITE)],
    operation_id="upload_trajectory",
    summary="Upload a sample flight",
    status_code=201,
    responses=documented(MalformedBody, BodyTooLarge, UnsupportedMediaType, InvalidRequest),
    openapi_extra=REQUEST_BODY,
)
async def upload_trajectory(
    request: Request, response: Response, app: ServiceDep, owner: OwnerDep
) -> TrajectorySummary:
    """Store a flight once and refer to it from any number of requests as `{"trajectory_id": ...}`."""
    kind = request.headers.get("content-type", "").split(";")[0].strip().lower()
    if kind == "multipart/form-data":
        stored = await _from_form(request, app, owner)
    elif kind == "application/json" or kind.endswith("+json"):
        body = await request.body()
        stored = await run_in_threadpool(_from_json, body, app, owner)
    else:
        raise UnsupportedMediaType(
            f"The body is announced as {kind or 'nothing'!r}.",
            "#header/Content-Type",
            "Send multipart/form-data with a CSV `file` (curl -F file=@flight.csv), or application/json.",
        )
    response.headers["Location"] = f"/trajectories/{stored.id}"
    return _summary(stored)


async def _from_form(request: Request, app: Service, owner: str) -> repository.StoredTrajectory:
    try:
        form = await request.form(max_files=1, max_fields=4, max_part_size=MAX_NAME_BYTES)
    except HTTPException as error:
        hint = "One part `file` with the CSV and optionally one part `name`."
        raise MalformedBody(f"The form cannot be read: {error.detail}", hint=hint) from None
    try:
        file, name = form.get("file"), form.get("name")
        if not isinstance(file, UploadFile):
            raise InvalidRequest(
                "The form has no file.", "/file", "Send the CSV as the part `file`: curl -F file=@flight.csv"
            )
        unknown = set(form) - {"file", "name"}
        if unknown:
            raise InvalidRequest(
                "The form has unknown parts.", f"/{min(unknown)[:60]}", "Only `file` and `name` are read."
            )

        def read_and_store() -> repository.StoredTrajectory:
            upload = service.from_csv(file.file, file.filename or "", name if isinstance(name, str) else None)
            with app.database.write() as session:
                return service.store_trajectory(session, owner, upload, "/file")

        return await run_in_threadpool(read_and_store)
    finally:
        await form.close()


def _from_json(body: bytes, app: Service, owner: str) -> repository.StoredTrajectory:
    document = parse_json(body)
    try:
        upload = TrajectoryUpload.model_validate(document)
    except ValidationError as error:
        items = [{**item, "loc": ("body", *item["loc"])} for item in error.errors(include_url=False)]
        raise RequestValidationError(items, body=document) from None
    with app.database.write() as session:
        return service.store_trajectory(session, owner, upload, "")


def _summary(stored: repository.StoredTrajectory) -> TrajectorySummary:
    return TrajectorySummary(
        id=stored.id,
        name=stored.name,
        rows=stored.rows,
        duration_s=stored.duration_s,
        created_at=stored.created_at,
    )


@router.get(
    "/trajectories/{trajectory_id}",
    dependencies=[demands(Scope.DATA_READ)],
    operation_id="get_trajectory",
    summary="Read a sample flight back",
    responses=documented(InvalidRequest, TrajectoryNotFound),
)
def get_trajectory(
    app: ServiceDep,
    owner: OwnerDep,
    trajectory_id: Annotated[str, Path(pattern=r"^[A-Za-z0-9_]{1,64}$")],
) -> Trajectory:
    """Return an uploaded flight with its rows, in s and rad."""
    with app.database.read() as session:
        stored, columns = repository.get_trajectory(session, owner, trajectory_id)
    return Trajectory(**_summary(stored).model_dump(), **columns)
