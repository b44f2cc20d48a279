"""Sample flights: measured sweep histories and attitudes over time."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from morphcore.errors import InvalidInput
from morphcore.geometry.fields import Fields
from morphcore.simulate.file_columns import read_file_columns
from samplefiles.columns import MOST_ROWS
from samplefiles.titles import FLIGHT

Array = NDArray[np.float64]
Role = Literal["train", "held_out"]


@dataclass(frozen=True)
class Trajectory:
    """One flight: ``time_s`` (k,) rising; hinge and Euler angles (k,) in rad; other columns in ``extra``."""

    name: str
    time_s: Array
    sweep_left: Array
    sweep_right: Array
    phi: Array
    theta: Array
    psi: Array
    role: Role = "train"
    weight: float = 1.0
    extra: dict[str, Array] = field(default_factory=dict)

    @property
    def euler(self) -> Array:
        """(k, 3) roll, pitch, yaw in rad."""
        return np.stack([self.phi, self.theta, self.psi], axis=1)

    @property
    def duration_s(self) -> float:
        """Time from the first to the last row."""
        return float(self.time_s[-1] - self.time_s[0])

    def sweep(self, side: str) -> Array:
        """The hinge angle history of a side."""
        return self.sweep_left if side == "left" else self.sweep_right


def load_trajectory(path: str | Path, *, role: Role = "train") -> Trajectory:
    """Read a CSV, JSON, Parquet or MATLAB file with the columns t, sweep_left, sweep_right, phi, theta, psi.

    The ending of its name tells the kind. Units in the names are accepted (``t_ms``, ``theta_deg``); other
    columns of numbers land in ``extra`` as they are. In JSON the columns are lists of one object, in MATLAB
    vectors or the fields of one struct; Parquet needs pyarrow.

    Raises
    ------
    InvalidInput : the file cannot be read, a column is missing or holds something that is not a finite
        number, or time does not rise.
    """
    columns = read_file_columns(path, FLIGHT)
    return checked(
        Trajectory(
            name=columns.path.stem,
            time_s=columns.values["t"],
            **{name: columns.values[name] for name in FLIGHT if name != "t"},  # type: ignore[arg-type]
            role=role,
            extra=columns.others,
        ),
        pointer=f"/{columns.path.name}",
    )


def trajectory_from_document(document: dict[str, Any], pointer: str) -> Trajectory:
    """A sample written inline in JSON (names and units as in the HTTP API)."""
    fields = Fields(document, pointer)
    role = fields.choice("role", ("train", "held_out")) if fields.has("role") else "train"
    trajectory = Trajectory(
        name=fields.text("name"),
        time_s=fields.series("time_s"),
        sweep_left=fields.series("sweep_left_rad"),
        sweep_right=fields.series("sweep_right_rad"),
        phi=fields.series("phi_rad"),
        theta=fields.series("theta_rad"),
        psi=fields.series("psi_rad"),
        role=role,  # type: ignore[arg-type]
        weight=fields.number("weight", default=1.0, least=0.0, most=1e6),
    )
    fields.done()
    return checked(trajectory, pointer)


def checked(trajectory: Trajectory, pointer: str) -> Trajectory:
    """The trajectory, if it makes sense; else InvalidInput."""
    rows = trajectory.time_s.size
    if not 3 <= rows <= MOST_ROWS:
        raise InvalidInput(f"{rows} rows", pointer=f"{pointer}/time_s", hint=f"give 3 to {MOST_ROWS} rows")
    for name in ("sweep_left", "sweep_right", "phi", "theta", "psi"):
        column = getattr(trajectory, name)
        if column.size != rows:
            raise InvalidInput(
                f"{name} has {column.size} rows, time has {rows}",
                pointer=f"{pointer}/{name}_rad",
                hint="give equal lengths",
            )
    for name in ("time_s", "sweep_left", "sweep_right", "phi", "theta", "psi"):
        bad = np.flatnonzero(~np.isfinite(getattr(trajectory, name)))
        if bad.size:
            raise InvalidInput(
                f"{name} is not finite at row {bad[0]}",
                pointer=f"{pointer}/{name}/{bad[0]}",
                hint="remove or repair the row",
            )
    falls = np.flatnonzero(np.diff(trajectory.time_s) <= 0)
    if falls.size:
        raise InvalidInput(
            f"time does not rise at row {falls[0] + 1}",
            pointer=f"{pointer}/time_s/{falls[0] + 1}",
            hint="sort the rows by time and drop doubles",
        )
    for value in vars(trajectory).values():
        if isinstance(value, np.ndarray):
            value.setflags(write=False)
    return trajectory
