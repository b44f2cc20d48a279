"""From an uploaded file or JSON document to a stored flight."""

from __future__ import annotations

import io
from pathlib import PurePosixPath
from typing import BinaryIO

from pydantic import ValidationError

from app.database import Session
from app.errors import Fault, InvalidRequest, UnsupportedMediaType
from app.schemas.fields import MIN_ROWS
from app.trajectories.checks import columns_faults
from app.trajectories.csv_reader import read_csv
from app.trajectories.repository import StoredTrajectory, insert_trajectory
from app.trajectories.schemas import TrajectoryUpload

CSV_ENDINGS = ("", ".csv", ".txt")
HINT = "Send CSV (columns t, sweep_left, sweep_right, phi, theta, psi), or the same columns as JSON."


def name_from_file(filename: str) -> str:
    """Make a sample name of a file name: ``my flight (1).csv`` becomes ``my-flight--1-``."""
    stem = PurePosixPath(filename.replace("\\", "/")).stem
    plain = "".join(c if c.isascii() and (c.isalnum() or c in "._-") else "-" for c in stem)[:64].lstrip(
        "._-"
    )
    return plain or "trajectory"


def from_csv(file: BinaryIO, filename: str, name: str | None) -> TrajectoryUpload:
    """Read an uploaded file.

    Raises
    ------
    UnsupportedMediaType
        When its ending tells another format.
    InvalidRequest
        Naming row and column.
    """
    ending = PurePosixPath(filename).suffix.lower()
    if ending not in CSV_ENDINGS:
        raise UnsupportedMediaType(f"Files of the kind {ending!r} are not read.", "/file", HINT)
    columns = read_csv(io.TextIOWrapper(file, encoding="utf-8-sig", newline=""))
    if len(columns["time_s"]) < MIN_ROWS:
        raise InvalidRequest.of(
            [
                Fault(
                    "too_short",
                    f"The file has fewer than {MIN_ROWS} rows.",
                    "/file",
                    "Send the whole flight.",
                )
            ]
        )
    try:
        return TrajectoryUpload(name=name_from_file(filename) if name is None else name, **columns)
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
    session: Session, owner: str, upload: TrajectoryUpload, pointer: str
) -> StoredTrajectory:
    """Check and store a flight.

    Raises
    ------
    InvalidRequest
        When columns differ in length or time does not rise.
    """
    faults = columns_faults(upload, pointer)
    if faults:
        raise InvalidRequest.of(faults)
    return insert_trajectory(session, owner, upload.name, upload.model_dump(exclude={"name"}))
