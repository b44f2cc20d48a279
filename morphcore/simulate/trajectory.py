"""Sample flights: measured sweep histories and attitudes over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from morphcore.errors import InvalidInput
from morphcore.shown import Shown
from morphdata.samplefiles.flight import INLINE, flight_faults
from morphdata.samplefiles.reading import read_flight
from morphdata.samplefiles.titles import FLIGHT
from morphdata.samples import InlineSample

Array = NDArray[np.float64]
Role = Literal["train", "held_out"]


@dataclass(frozen=True, repr=False)
class Trajectory(Shown):
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

    @classmethod
    def of(cls, sample: InlineSample) -> Trajectory:
        """Return the flight that a sample document holds."""
        return cls(
            name=sample.name,
            time_s=_column(sample.time_s),
            sweep_left=_column(sample.drives["sweep_left"]),
            sweep_right=_column(sample.drives["sweep_right"]),
            phi=_column(sample.phi_rad),
            theta=_column(sample.theta_rad),
            psi=_column(sample.psi_rad),
            role=sample.role,
            weight=sample.weight,
        )

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

    The ending of its name tells the kind. Units in the names are accepted (``t_ms``, ``theta [deg]``); other
    columns of numbers land in ``extra`` as they are. Time that counts from an epoch, and dates, count from
    the first row. In JSON the columns are lists of one object, in MATLAB vectors or the fields of one struct;
    Parquet needs pyarrow.

    Raises
    ------
    InvalidInput : the file cannot be read, a column is missing or holds something that is not a finite
        number, time does not increase, the flight is longer than 600 s, or an angle is no angle in rad.
    """
    path = Path(path)
    columns = read_flight(path)
    return Trajectory(
        name=path.stem,
        time_s=_column(columns.values["t"]),
        **{name: _column(columns.values[name]) for name in FLIGHT if name != "t"},  # type: ignore[arg-type]
        role=role,
        extra={title: _column(values) for title, values in columns.others.items()},
    )


def require_flight(trajectory: Trajectory, pointer: str) -> None:
    """Raise InvalidInput where a sample makes no sense, by the rules of `morphdata.samplefiles.flight`."""
    columns = {"t": trajectory.time_s, **{name: getattr(trajectory, name) for name in FLIGHT if name != "t"}}
    for fault in flight_faults({name: values.tolist() for name, values in columns.items()}, INLINE):
        row = "" if fault.row is None else f"/{fault.row}"
        raise InvalidInput(
            fault.detail, pointer=f"{pointer}/{INLINE[fault.title or 't']}{row}", hint=fault.hint
        )


def _column(values: Sequence[float]) -> Array:
    column = np.array(values, dtype=np.float64)
    column.setflags(write=False)
    return column
