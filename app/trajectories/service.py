"""From an uploaded file or JSON document to a stored flight."""

from __future__ import annotations

from pathlib import PurePosixPath

from pydantic import ValidationError

from app.audit.records import Action
from app.audit.service import note
from app.database import Session
from app.errors import InvalidRequest
from app.http.context import Caller
from app.keys.quota import charge
from app.parsing.pool import refusal
from app.trajectories.checks import columns_faults, file_faults
from app.trajectories.repository import insert_trajectory, stored_form
from app.trajectories.schemas import TrajectorySummary, TrajectoryUpload
from morphdata.faults import Fault
from morphdata.samplefiles.fault import FileFault
from morphdata.samplefiles.flight import INLINE
from morphdata.samplefiles.reading import kind_of


def file_kind(filename: str) -> str:
    """What an uploaded file is, by its name.

    Raises
    ------
    UnsupportedMediaType
        When files of its kind are not read.
    """
    try:
        return kind_of(PurePosixPath(filename).suffix)
    except FileFault as fault:
        raise refusal(fault, "/file") from None


def name_from_file(filename: str) -> str:
    """Make a sample name of a file name: ``my flight (1).csv`` becomes ``my-flight--1-``."""
    stem = PurePosixPath(filename.replace("\\", "/")).stem
    plain = "".join(c if c.isascii() and (c.isalnum() or c in "._-") else "-" for c in stem)[:64].lstrip(
        "._-"
    )
    return plain or "trajectory"


def upload_of(columns: dict[str, list[float]], filename: str, name: str | None) -> TrajectoryUpload:
    """Make an upload of a file's columns.

    Raises
    ------
    InvalidRequest
        Naming row and column.
    """
    faults = file_faults(columns, "/file")
    if faults:
        raise InvalidRequest.of(faults)
    named = {INLINE[key]: values for key, values in columns.items()}
    try:
        return TrajectoryUpload(name=name_from_file(filename) if name is None else name, **named)
    except ValidationError as error:
        faults = [
            Fault(
                item["type"],
                f"{item['msg']}.",
                "/name" if item["loc"][0] == "name" else f"/file/{item['loc'][-1]}/{item['loc'][0]}",
                "Check the name, and the units of the columns.",
            )
            for item in error.errors(include_url=False)
        ]
        raise InvalidRequest.of(faults) from None


def store_trajectory(
    session: Session, caller: Caller, upload: TrajectoryUpload, pointer: str
) -> TrajectorySummary:
    """Check and store a flight.

    Raises
    ------
    InvalidRequest
        When columns differ in length or time does not rise.
    QuotaExceeded
        When the caller's key may not store that much more.
    """
    faults = columns_faults(upload, pointer)
    if faults:
        raise InvalidRequest.of(faults)
    document = stored_form(upload.model_dump(exclude={"name"}))
    charge(session, caller.key_id, size_bytes=len(document))
    stored = insert_trajectory(session, caller.owner, caller.key_id, upload, document)
    note(session, caller, Action.TRAJECTORY_POST, stored.id)
    return stored
