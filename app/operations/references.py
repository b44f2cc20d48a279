"""Resolves ids in requests to their content: uploaded flights, identified models, jobs' models.

One step for all operations: every id in a request is replaced by the object it refers to.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any, NamedTuple, TypeVar

from pydantic import BaseModel

from app.database import Session
from app.documents import Document
from app.errors import NotFound
from app.jobs import repository as jobs
from app.jobs.rows import get_job
from app.models import repository as models
from app.models.extraction import extracted_model
from app.trajectories import repository as trajectories
from morphdata.aircraft import Aircraft
from morphdata.drive_keys import unmeasured_sides
from morphdata.execution import Request
from morphdata.faults import Fault, InvalidInput, refuse
from morphdata.identify import SamplesRequest, total_rows_faults
from morphdata.parameters import Parameters
from morphdata.samplefiles.titles import ATTITUDE
from morphdata.samples import columns_of_aircraft, drive_key

AnyRequest = TypeVar("AnyRequest", bound=Request)


class Reference(NamedTuple):
    """An id in a request: the JSON pointer of the object that holds it, its field, the id."""

    at: str
    field: str
    id: str

    @property
    def pointer(self) -> str:
        """JSON pointer of the id."""
        return f"{self.at}/{self.field}"


def resolved(session: Session, owner: str, request: AnyRequest) -> AnyRequest:
    """Return the request with all references inline.

    Raises `InvalidInput`, with all faults, if something does not exist or does not fit.
    """
    found = list(_references(request))
    if not found:
        return request
    _require_rows(session, owner, [item for item in found if item.field == "trajectory_id"], request)
    document = request.document()
    faults: list[Fault] = []
    for item in found:
        try:
            named = RESOLVERS[item.field](session, owner, item)
            if item.field == "trajectory_id" and isinstance(request, SamplesRequest):
                named = _of_aircraft(named, request.aircraft, item.pointer)
            _put(document, item, named)
        except InvalidInput as error:
            faults += error.faults
        except NotFound as error:
            faults.append(Fault(error.code, error.detail, item.pointer, error.hint))
    if faults:
        raise InvalidInput.of(faults)
    try:
        return type(request).parse(document)
    except InvalidInput as error:
        raise InvalidInput.of([_at_its_id(fault, found) for fault in error.faults]) from None


def _references(value: object, pointer: str = "") -> Iterator[Reference]:
    """Find every id in a request, in order."""
    if isinstance(value, BaseModel):
        for name in type(value).model_fields:
            part = getattr(value, name)
            if name in RESOLVERS and part is not None:
                yield Reference(pointer, name, part)
            else:
                yield from _references(part, f"{pointer}/{name}")
    elif isinstance(value, list) and value and isinstance(value[0], BaseModel):
        for number, item in enumerate(value):
            yield from _references(item, f"{pointer}/{number}")


def _put(document: Document, reference: Reference, found: Document) -> None:
    """Replace an id by the object found; fields in the request itself take precedence."""
    place: Any = document
    for key in reference.at.split("/")[1:]:
        place = place[int(key)] if isinstance(place, list) else place[key]
    del place[reference.field]
    place.update({**found, **place})


def _at_its_id(fault: Fault, references: list[Reference]) -> Fault:
    """Point an error to the id instead of a model that the client has not sent."""
    for item in references:
        if item.field != "trajectory_id" and f"{fault.pointer}/".startswith(f"{item.at}/parameters/"):
            return Fault(fault.code, fault.detail, item.pointer, fault.hint)
    return fault


def _require_rows(session: Session, owner: str, uploads: list[Reference], request: Request) -> None:
    """Check that the flights exist and are not too long, before reading any rows.

    A short request may refer to a flight of 100,000 rows many times.
    """
    rows = trajectories.row_counts(session, owner, [item.id for item in uploads])
    faults = [
        Fault(
            "trajectory_not_found",
            f"There is no trajectory {item.id}.",
            item.pointer,
            "Upload it with POST /trajectories first.",
        )
        for item in uploads
        if item.id not in rows
    ]
    inline = sum(
        len(sample.time_s) for sample in getattr(request, "samples", []) if hasattr(sample, "time_s")
    )
    faults += total_rows_faults(inline + sum(rows.get(item.id, 0) for item in uploads))
    if faults:
        raise InvalidInput.of(faults)


def _flight(session: Session, owner: str, reference: Reference) -> Document:
    stored, columns = trajectories.get_trajectory(session, owner, reference.id)
    return {"name": stored.name, **json.loads(columns)}


def _of_aircraft(flight: Document, aircraft: Aircraft, pointer: str) -> Document:
    """Omit columns of a file that are not drives of the aircraft."""
    columns = dict(flight)
    unreadable = columns.pop("unreadable", {})
    fields = {
        key: field for field in columns if (key := drive_key(field)) is not None and key not in ATTITUDE
    }
    drives = aircraft.drives
    try:
        followed = columns_of_aircraft(list(fields), unreadable, drives)
        refuse(unmeasured_sides(followed, drives))
    except InvalidInput as error:
        raise InvalidInput.of(replace(fault, pointer=pointer) for fault in error.faults) from None
    left_out = {field for key, field in fields.items() if key not in followed.values()}
    return {field: values for field, values in columns.items() if field not in left_out}


def _model(session: Session, owner: str, reference: Reference) -> Document:
    _, document = models.get_model(session, owner, reference.id)
    return {"parameters": _as_given(document["model"])}


def _model_of_job(session: Session, owner: str, reference: Reference) -> Document:
    """Find the model of a job, final or best so far."""
    job = get_job(session, owner, reference.id)
    text = jobs.result_json(session, owner, job.id)
    left = None if text is None else extracted_model(job.operation, json.loads(text))
    if left is None:
        state = "has ended" if job.finished else f"is {job.status.value}"
        hint = "Wait for its end, or cancel it; its best model so far is then its result."
        fault = Fault(
            "no_model",
            f"Job {job.id} ({job.operation}) {state} and has left no model.",
            reference.pointer,
            "Name an identification or a study with a result." if job.finished else hint,
        )
        raise InvalidInput.of([fault])
    return {"parameters": _as_given(left["model"])}


def _as_given(model: Document) -> Document:
    """Return a stored model in the form that the same parameters have when given inline.

    So a job's request, in which references are resolved, gives the same job when posted again. A model that a
    request can no longer contain, for example of an earlier version, stays as it is.
    """
    try:
        return Parameters.parse(model).model_dump(exclude_none=True)
    except InvalidInput:
        return model


RESOLVERS: Mapping[str, Callable[[Session, str, Reference], Document]] = {
    "trajectory_id": _flight,
    "model_id": _model,
    "job_id": _model_of_job,
}
