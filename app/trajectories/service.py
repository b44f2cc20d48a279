"""From an uploaded file or JSON document to a stored flight."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import PurePosixPath
from typing import Any

from app.audit.records import Action
from app.audit.repository import note
from app.database import Session
from app.documents import packed
from app.errors import InvalidRequest, MalformedBody
from app.http.context import Caller
from app.keys.quota import charge
from app.parsing.json_text import parse_json, token
from app.parsing.pool import refusal
from app.trajectories.repository import insert_trajectory
from app.trajectories.schemas import TrajectorySummary, TrajectoryUpload
from morphdata.channels import document_name
from morphdata.drives import field_name
from morphdata.faults import Fault, InvalidInput
from morphdata.samplefiles.channel_columns import with_gaps
from morphdata.samplefiles.columns import MAX_DRIVES, FlightColumns
from morphdata.samplefiles.declared import declared
from morphdata.samplefiles.fault import FileFault, as_sentence, said_of
from morphdata.samplefiles.flight import INLINE, flight_faults
from morphdata.samplefiles.reading import kind_of
from morphdata.samples import sample_name

JSON_PARTS: tuple[tuple[str, type, tuple[str, str]], ...] = (  # of a form, and what they hold
    ("columns", dict, ("object", 'an object of titles: {"sweep_left_deg": "servo_1*0.09-45"}')),
    ("between", list, ("array", "two times in s: [120, 180]")),
)


def file_kind(filename: str) -> str:
    """What an uploaded file is, by its name; raise `UnsupportedMediaType` for a kind that is not read."""
    try:
        return kind_of(PurePosixPath(filename).suffix)
    except FileFault as fault:
        raise refusal(fault, "/file") from None


def declared_about(parts: Mapping[str, str]) -> dict[str, Any]:
    """Check what a form declares about its file: arguments of `declared`, or raise `InvalidRequest`."""
    said: dict[str, Any] = dict(parts)
    for part, kind, hint in JSON_PARTS:
        if part in said:
            try:
                said[part] = parse_json(said[part].encode())
            except (MalformedBody, UnicodeEncodeError):
                said[part] = None
            if not isinstance(said[part], kind):
                raise InvalidRequest(f"{part} is no JSON {hint[0]}.", f"/{part}", f"Give {hint[1]}.")
    for name, title in said.get("columns", {}).items():
        if not isinstance(title, str):
            raise InvalidRequest(
                "A column is declared by its title.", f"/columns/{token(name)}", "Give text."
            )
    try:
        declared(**said)
    except InvalidInput as error:
        raise InvalidRequest.of(
            [Fault(f.code, as_sentence(f.detail), f.pointer, as_sentence(f.hint)) for f in error.faults]
        ) from None
    return said


def upload_of(flight: FlightColumns, filename: str, name: str | None) -> TrajectoryUpload:
    """Make an upload of a file's columns, or raise `InvalidRequest` naming row and column."""
    columns = {**flight.values, **flight.drives}
    faults = [
        Fault(fault.code, as_sentence(fault.detail), f"/file{_place(fault)}", as_sentence(fault.hint))
        for fault in flight_faults(columns)  # before the document is made, which has other names for them
    ]
    if faults:
        raise InvalidRequest.of(faults)
    named: dict[str, Any] = {
        _field(key, flight.units.get(key, "rad")): values for key, values in columns.items()
    }
    named |= {document_name(key): with_gaps(values) for key, values in flight.channels.items()}
    unreadable = list(flight.unreadable.items())[:MAX_DRIVES]
    try:
        return TrajectoryUpload(
            name=sample_name(PurePosixPath(filename.replace("\\", "/")).stem) if name is None else name,
            unreadable={key: said_of(fault) for key, fault in unreadable},
            **named,
        )
    except InvalidInput as error:
        raise InvalidRequest.of(
            [fault if fault.pointer == "/name" else fault.under("/file") for fault in error.faults]
        ) from None


def _field(key: str, unit: str = "rad") -> str:
    return INLINE.get(key, field_name(key, unit))


def _place(fault: FileFault) -> str:
    """Where in a file: a time by its column, an angle by its row."""
    column = f"/{_field(fault.title)}" if fault.title else ""
    row = "" if fault.row is None else f"/{fault.row}"
    return f"{column}{row}" if fault.title == "t" else f"{row}{column}"


def store_trajectory(session: Session, caller: Caller, upload: TrajectoryUpload) -> TrajectorySummary:
    """Store a flight, or raise `QuotaExceeded`."""
    document = packed(upload.columns())
    charge(session, caller.key_id, size_bytes=len(document))
    stored = insert_trajectory(session, caller.owner, caller.key_id, upload, document)
    note(session, caller, Action.TRAJECTORY_POST, stored.id)
    return stored
