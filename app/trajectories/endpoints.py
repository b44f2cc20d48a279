"""Endpoints of uploaded trajectories."""

from __future__ import annotations

from operator import attrgetter
from typing import Any

from fastapi import APIRouter, Request, Response
from fastapi.concurrency import run_in_threadpool
from starlette.datastructures import UploadFile
from starlette.exceptions import HTTPException

from app.audit.records import Action
from app.audit.repository import note
from app.database import Session
from app.errors import (
    InvalidRequest,
    MalformedBody,
    QuotaExceeded,
    TrajectoryNotFound,
    UnsupportedMediaType,
)
from app.http.context import CallerDep, OwnerDep, Service, ServiceDep, demands
from app.http.json_body import BODY_ERRORS, is_json, json_document, media_type
from app.http.parameters import CursorQuery, IdPath, LimitQuery
from app.http.problems import documented
from app.keys.records import Scope
from app.trajectories import repository, service
from app.trajectories.schemas import (
    Trajectory,
    TrajectoryPage,
    TrajectorySummary,
    TrajectoryUpload,
)
from morphdata.refusals import escaped

router = APIRouter(tags=["trajectories"], generate_unique_id_function=attrgetter("name"))

MAX_PART_BYTES = 8192  # of a form, but for the file
SAID = ("earth", "body", "quaternion", "columns", "between")  # what a form may declare about its file
FORM_SCHEMA: dict[str, Any] = {
    "title": "TrajectoryFile",
    "type": "object",
    "required": ["file"],
    "properties": {
        "file": {
            "type": "string",
            "format": "binary",
            "description": "CSV, JSON, Parquet, MATLAB (`.mat`) or ULog (`.ulg`), recognised by the ending "
            "of its name: t, phi, theta, psi (or a quaternion qw, qx, qy, qz), and a column for each drive "
            "that moves, by its name: sweep_left, sweep_right, fold_left, ...; or with units: `theta_deg`. "
            "Columns of channels (p, q_deg_s, nz, tip_right_z_mm, ...) are kept and may have gaps.",
        },
        "name": {
            "type": "string",
            "description": "Name of the sample; that of the file when left out.",
            "examples": ["rate_0.5"],
        },
        "earth": {
            "type": "string",
            "enum": ["NED", "ENU"],
            "default": "NED",
            "description": "Axes of the earth that the file means: north, east, down, or east, north, up.",
        },
        "body": {
            "type": "string",
            "enum": ["FRD", "FLU"],
            "default": "FRD",
            "description": "Axes of the body: forward, right, down, or forward, left, up.",
        },
        "quaternion": {
            "type": "string",
            "enum": ["wxyz", "xyzw"],
            "description": "Order of a quaternion in columns that are numbered, q0 to q3.",
        },
        "columns": {
            "type": "string",
            "description": "JSON object of the file's columns by the names they shall have, with scale and "
            "offset; fields of a ULog file are `topic.field`.",
            "examples": ['{"sweep_left_deg": "actuator_outputs.output[0]*0.09-135"}'],
        },
        "between": {
            "type": "string",
            "description": "JSON array of the first and last time of the rows that are used, s.",
            "examples": ["[120, 180]"],
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
    summary="Upload a sample flight",
    status_code=201,
    responses=documented(*BODY_ERRORS, QuotaExceeded),
    openapi_extra=REQUEST_BODY,
)
async def upload_trajectory(
    request: Request, response: Response, app: ServiceDep, caller: CallerDep
) -> TrajectorySummary:
    """Store a flight once and refer to it from any number of requests as `{"trajectory_id": ...}`."""
    kind = media_type(request)
    if kind == "multipart/form-data":
        upload = await _from_form(request, app, caller.owner)
    elif is_json(kind):
        upload = TrajectoryUpload.parse(await json_document(request))
    else:
        raise UnsupportedMediaType(
            f"The Content-Type of the body is {kind[:60] or 'nothing'!r}.",
            "#header/Content-Type",
            "Send multipart/form-data with a `file` (curl -F file=@flight.csv), or application/json.",
        )

    caller.key.require_valid()  # the body and its reader may have taken a minute

    def store() -> TrajectorySummary:
        with app.database.write() as session:
            return service.store_trajectory(session, caller, upload)

    stored = await run_in_threadpool(store)
    response.headers["Location"] = f"/trajectories/{stored.id}"
    return stored


async def _from_form(request: Request, app: Service, owner: str) -> TrajectoryUpload:
    try:
        form = await request.form(max_files=1, max_fields=8, max_part_size=MAX_PART_BYTES)
    except HTTPException as error:
        hint = "One part `file` with the flight and optionally parts `name`, " + ", ".join(SAID) + "."
        raise MalformedBody(f"The form cannot be read: {error.detail}", hint=hint) from None
    try:
        file, name = form.get("file"), form.get("name")
        if not isinstance(file, UploadFile):
            raise InvalidRequest(
                "The form has no file.", "/file", "Send it as the part `file`: curl -F file=@flight.csv"
            )
        unknown = set(form) - {"file", "name", *SAID}
        if unknown:
            raise InvalidRequest(
                "The form has unknown parts.",
                f"/{escaped(min(unknown)[:60])}",
                f"Only file, name, {', '.join(SAID)} are read.",
            )
        filename = file.filename or ""
        said = service.declared_about({part: str(form[part]) for part in SAID if form.get(part)})
        kind = service.file_kind(filename)
        columns = await app.parsers.flight(owner, kind, file.file, "/file", said)
        return service.upload_of(columns, filename, name if isinstance(name, str) else None)
    finally:
        await form.close()


@router.get(
    "/trajectories",
    dependencies=[demands(Scope.DATA_READ)],
    summary="List uploaded flights",
    responses=documented(InvalidRequest),
)
def list_trajectories(
    app: ServiceDep,
    owner: OwnerDep,
    cursor: CursorQuery = None,
    limit: LimitQuery = 50,
) -> TrajectoryPage:
    """Your uploaded flights without their rows, newest first."""
    with app.database.read() as session:
        return repository.list_trajectories(session, owner, cursor=cursor, limit=limit)


@router.get(
    "/trajectories/{trajectory_id}",
    dependencies=[demands(Scope.DATA_READ)],
    summary="Read a sample flight back",
    response_model=Trajectory,
    responses=documented(InvalidRequest, TrajectoryNotFound),
)
def get_trajectory(
    app: ServiceDep,
    owner: OwnerDep,
    trajectory_id: IdPath,
) -> Response:
    """Return an uploaded flight with its rows, in s and rad."""
    with app.database.read() as session:
        stored, columns = repository.get_trajectory(session, owner, trajectory_id)
    # the rows go out as they are stored: to parse and write a long flight would hold up the other requests
    text = stored.model_dump_json().encode()[:-1] + b"," + columns[1:]
    return Response(text, media_type="application/json")


@router.delete(
    "/trajectories/{trajectory_id}",
    dependencies=[demands(Scope.DATA_WRITE)],
    summary="Delete an uploaded flight",
    status_code=204,
    responses=documented(InvalidRequest, TrajectoryNotFound),
)
def delete_trajectory(app: ServiceDep, caller: CallerDep, trajectory_id: IdPath) -> None:
    """Delete an uploaded flight; jobs that were started with it have copies of their own."""

    def remove(session: Session) -> None:
        repository.delete_trajectory(session, caller.owner, trajectory_id)
        note(session, caller, Action.TRAJECTORY_DELETE, trajectory_id)

    app.database.write_even_if_full(remove)
