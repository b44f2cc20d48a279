"""What POST /trajectories takes and gives."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

from morphdata.base import SampleName
from morphdata.channels import document_name
from morphdata.drives import SWEEPS, field_name
from morphdata.faults import Fault
from morphdata.samplefiles.columns import MAX_DRIVES
from morphdata.samplefiles.flight import INLINE
from morphdata.samples import EXAMPLE_SAMPLE, TrajectoryColumns

UNREADABLE: Any = Field(
    default={},
    max_length=MAX_DRIVES,
    description="Columns of the file that could be drives, or are channels, and could not be read, and why: "
    "a request whose aircraft has such a drive is refused.",
)
Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]{0,219}$")]  # of a drive or a channel
Reason = Annotated[str, Field(max_length=500)]


class TrajectoryUpload(TrajectoryColumns):
    """A flight as JSON."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{k: v for k, v in EXAMPLE_SAMPLE.items() if k not in ("role", "weight")}]
        }
    )

    name: SampleName = "trajectory"
    unreadable: dict[Name, Reason] = UNREADABLE

    def faults(self) -> Iterator[Fault]:
        """The columns are those of a flight in which something was moved."""
        yield from super().faults()
        if not self.drive_fields:
            yield Fault(
                "missing",
                "There is no column of a drive.",
                f"/{INLINE[SWEEPS[0]]}",
                "Add sweep_left_rad and sweep_right_rad, or columns named after the aircraft's drives "
                "(fold_left_rad).",
            )

    def columns(self) -> dict[str, Any]:
        """Return what is stored: the columns in SI units, and what could not be read."""
        fields = self.model_dump(exclude={"name", "unreadable"}, exclude_none=True)
        for key, field in self.drive_fields.items():
            del fields[field]
            fields[field_name(key, self.drive_units[key])] = self.drives[key]
        for column, field in self.channel_fields.items():
            del fields[field]
            fields[document_name(column)] = self.channels[column]
        return fields | ({"unreadable": self.unreadable} if self.unreadable else {})


class TrajectorySummary(BaseModel):
    """An uploaded flight without its rows."""

    model_config = ConfigDict(from_attributes=True)

    id: str = Field(examples=["traj_01k0c3v9fh8x2m4n6p8q0r2s4t"])
    name: str
    rows: int
    duration_s: float
    created_at: datetime


class TrajectoryPage(BaseModel):
    """Uploaded flights, newest first."""

    trajectories: list[TrajectorySummary]
    next_cursor: str | None = Field(description="Pass as `cursor` to get the next page; null on the last.")


class Trajectory(TrajectorySummary):
    """An uploaded flight with its rows.

    Every further column that could be a drive has its own field, `fold_left_rad`, and every measured channel,
    `p_rad_s`, with null where a value is missing.
    """

    model_config = ConfigDict(extra="allow")

    __pydantic_extra__: dict[str, list[float | None]] = Field(init=False)

    time_s: list[float]
    sweep_left_rad: list[float] | None = None
    sweep_right_rad: list[float] | None = None
    phi_rad: list[float]
    theta_rad: list[float]
    psi_rad: list[float]
    unreadable: dict[str, str] = UNREADABLE
