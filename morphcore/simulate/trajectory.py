"""Sample flights: measured angles of the drives and attitudes over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from morphcore.errors import InvalidInput
from morphcore.shown import Shown
from morphdata.drives import without_side
from morphdata.samplefiles.fault import said_of
from morphdata.samplefiles.flight import INLINE, flight_faults
from morphdata.samplefiles.reading import read_flight
from morphdata.samples import InlineSample

Array = NDArray[np.float64]
Role = Literal["train", "held_out"]

ANGLES = ("phi", "theta", "psi")


@dataclass(frozen=True, repr=False)
class Trajectory(Shown):
    """One flight: angles of the drives and attitudes over time.

    Attributes
    ----------
    name : str
        Its name, unique among the samples of an identification.
    time_s : ndarray, shape (k,)
        Rising times, s.
    drives : mapping of str to ndarray, shape (k,)
        Angle of each drive that moves, rad, by its name (``sweep_left``), or by its word where both sides
        move alike (``sweep``).
    phi, theta, psi : ndarray, shape (k,)
        Euler angles from N to B (z-y-x), rad.
    role : {"train", "held_out"}
        Whether an identification fits it, or only reports it.
    weight : float
        Weight of its errors in a fit.
    extra : dict of str to ndarray, shape (k,)
        Other columns.
    of_file : bool
        Whether ``drives`` are all columns of a file that could be drives, in which case those that the
        aircraft does not have are left out.
    unreadable : mapping of str to str
        What is wrong with further columns, by their names.
    channels : mapping of str to ndarray, shape (k,)
        Measured channels by their names (``q``, ``nz``, ``tip_left_z``), SI units and rad; NaN where a value
        is missing.
    """

    name: str
    time_s: Array
    drives: Mapping[str, Array]
    phi: Array
    theta: Array
    psi: Array
    role: Role = "train"
    weight: float = 1.0
    extra: dict[str, Array] = field(default_factory=dict)
    of_file: bool = False
    unreadable: Mapping[str, str] = field(default_factory=dict)
    channels: Mapping[str, Array] = field(default_factory=dict)

    @classmethod
    def of(cls, sample: InlineSample) -> Trajectory:
        """Return the flight that a sample document holds."""
        return cls(
            name=sample.name,
            time_s=_column(sample.time_s),
            drives={name: _column(angles) for name, angles in sample.drives.items()},
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

    @property
    def sweep_left(self) -> Array:
        """Angle (k,) of the first drive of the left side, rad; zeros where there is none."""
        return self._side("left")

    @property
    def sweep_right(self) -> Array:
        """Angle (k,) of the first drive of the right side, rad; zeros where there is none."""
        return self._side("right")

    def _side(self, side: str) -> Array:
        # a drive's name ends with its side, a word stands for both
        own = [values for name, values in self.drives.items() if name.endswith(f"_{side}")]
        words = [values for name, values in self.drives.items() if without_side(name) == name]
        return next(iter([*own, *words]), np.zeros_like(self.time_s))

    @property
    def drive_order(self) -> tuple[str, ...]:
        """Names of the drives as tables and pictures have them: left before right of each word."""
        names = list(self.drives)
        words = list(dict.fromkeys(without_side(name) for name in names))
        return tuple(sorted(names, key=lambda name: (words.index(without_side(name)), name)))


def load_trajectory(path: str | Path, *, role: Role = "train") -> Trajectory:
    """Read a CSV, JSON, Parquet or MATLAB file with the columns t, phi, theta, psi and those of drives.

    The ending of its name tells the kind. A drive's column bears its name (``sweep_left``), or the word of
    both sides (``sweep``). Units in the names are accepted (``t_ms``, ``theta [deg]``); columns of numbers
    beside the first ones land in ``extra`` as they are, and in ``drives``, in rad, if they could be drives.
    Time that counts from an epoch, and dates, count from the first row. In JSON the columns are lists of one
    object, in MATLAB vectors or the fields of one struct; Parquet needs pyarrow.

    Parameters
    ----------
    path : str or Path
        The file.
    role : {"train", "held_out"}
        Whether an identification fits the flight, or only reports it.

    Returns
    -------
    Trajectory
        The flight, named after the file.

    Raises
    ------
    InvalidInput
        The file cannot be read, a column is missing or holds something that is not a finite number, time does
        not increase, the flight is longer than 600 s, or an angle is no angle in rad.

    Examples
    --------
    >>> from morphcore import load_trajectory
    >>> sample = load_trajectory("examples/train_rate_0.8.csv")
    >>> sample.drive_order, round(sample.duration_s, 2)
    (('sweep_left', 'sweep_right'), 1.74)
    """
    path = Path(path)
    columns = read_flight(path)
    return Trajectory(
        name=path.stem,
        time_s=_column(columns.values["t"]),
        drives={name: _column(angles) for name, angles in columns.drives.items()},
        **{name: _column(columns.values[name]) for name in ANGLES},  # type: ignore[arg-type]
        role=role,
        extra={title: _column(values) for title, values in columns.others.items()},
        of_file=True,
        unreadable={name: said_of(fault) for name, fault in columns.unreadable.items()},
    )


def require_flight(trajectory: Trajectory, pointer: str) -> None:
    """Raise InvalidInput where a sample makes no sense, by the rules of `morphdata.samplefiles.flight`."""
    columns = {"t": trajectory.time_s, **{name: getattr(trajectory, name) for name in ANGLES}}
    columns |= trajectory.drives
    called = {name: INLINE.get(name, f"{name}_rad") for name in columns}
    for fault in flight_faults({name: values.tolist() for name, values in columns.items()}, called):
        row = "" if fault.row is None else f"/{fault.row}"
        raise InvalidInput(
            fault.detail, pointer=f"{pointer}/{called[fault.title or 't']}{row}", hint=fault.hint
        )


def _column(values: Sequence[float]) -> Array:
    column = np.array(values, dtype=np.float64)
    column.setflags(write=False)
    return column
