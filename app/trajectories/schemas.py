"""What POST /trajectories takes and gives."""

from __future__ import annotations

from datetime import datetime

from pydantic import BaseModel, ConfigDict, Field

from morphdata.base import SampleName
from morphdata.samples import EXAMPLE_SAMPLE, TrajectoryColumns


class TrajectoryUpload(TrajectoryColumns):
    """A flight as JSON."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{k: v for k, v in EXAMPLE_SAMPLE.items() if k not in ("role", "weight")}]
        }
    )

    name: SampleName = "trajectory"


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
    """An uploaded flight with its rows."""

    time_s: list[float]
    sweep_left_rad: list[float]
    sweep_right_rad: list[float]
    phi_rad: list[float]
    theta_rad: list[float]
    psi_rad: list[float]
