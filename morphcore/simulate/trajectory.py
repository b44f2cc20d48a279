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
from morphdata.drives import field_name, without_side
from morphdata.measurement import ANGLES
from morphdata.samplefiles.channel_columns import without_gaps
from morphdata.samplefiles.declared import declared
from morphdata.samplefiles.fault import said_of
from morphdata.samplefiles.flight import INLINE, flight_faults
from morphdata.samplefiles.reading import read_flight
from morphdata.samples import InlineSample

Array = NDArray[np.float64]
Role = Literal["train", "held_out"]


@dataclass(frozen=True, repr=False)
class Trajectory(Shown):
    """One flight: angles of the drives and attitudes over time.

    Attributes
    ----------
    name : str
        Name, unique among the samples of an identification.
    time_s : ndarray, shape (k,)
        Increasing times, s.
    drives : mapping of str to ndarray, shape (k,)
        Angle of each moving drive, rad, or extension, m, by its name (``sweep_left``), or by its word if
        both sides move together (``sweep``).
    phi, theta, psi : ndarray, shape (k,)
        Euler angles from N to B (z-y-x), rad.
    role : {"train", "held_out"}
        Whether an identification fits the flight or only reports it.
    weight : float
        Weight of its errors in a fit.
    extra : dict of str to ndarray, shape (k,)
        Other columns.
    of_file : bool
        Whether ``drives`` holds all columns of a file that could be drives; those that the aircraft does not
        have are then ignored.
    unreadable : mapping of str to str
        What is wrong with further columns, by name.
    channels : mapping of str to ndarray, shape (k,)
        Measured channels by their columns (``p``, ``nz``, ``tip_z_right_wing``, as in
        ``morphdata.channels``), SI units; NaN where a value is missing.
    units : mapping of str to {"rad", "m"}
        Units of those of ``drives`` for which they were stated: m for drives that slide.
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
    units: Mapping[str, str] = field(default_factory=dict)

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
            channels={name: _column(without_gaps(values)) for name, values in sample.channels.items()},
            units=sample.drive_units,
        )

    def field_of(self, name: str) -> str:
        """The field of a drive's column in documents: with its unit, rad unless another one was stated."""
        return field_name(name, self.units.get(name, "rad"))

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
        """Angle (k,) of the first drive of the left side that turns, rad; zeros if there is none."""
        return self._side("left")

    @property
    def sweep_right(self) -> Array:
        """Angle (k,) of the first drive of the right side that turns, rad; zeros if there is none."""
        return self._side("right")

    def _side(self, side: str) -> Array:
        # a drive's name ends with its side, a word stands for both
        turning = {name: each for name, each in self.drives.items() if self.units.get(name, "rad") == "rad"}
        own = [values for name, values in turning.items() if name.endswith(f"_{side}")]
        words = [values for name, values in turning.items() if without_side(name) == name]
        return next(iter([*own, *words]), np.zeros_like(self.time_s))

    @property
    def drive_order(self) -> tuple[str, ...]:
        """Names of the drives in the order of tables and figures: left before right for each word."""
        names = list(self.drives)
        words = list(dict.fromkeys(without_side(name) for name in names))
        return tuple(sorted(names, key=lambda name: (words.index(without_side(name)), name)))


def load_trajectory(
    path: str | Path,
    *,
    role: Role = "train",
    earth: str = "NED",
    body: str = "FRD",
    quaternion: str | None = None,
    columns: Mapping[str, str] | None = None,
    between: Sequence[float] | None = None,
) -> Trajectory:
    """Read a CSV, JSON, Parquet, MATLAB or ULog file with the columns t, phi, theta, psi and those of drives.

    The ending of its name tells the kind. A drive's column bears its name (``sweep_left``), or the word of
    both sides (``sweep``). Units in the names are accepted (``t_ms``, ``theta [deg]``); columns of numbers
    beside the first ones land in ``extra`` as they are, in ``drives``, in rad, if they could be drives, and
    in ``channels``, in SI units, if they are named like channels; these alone may have empty cells. Time that
    counts from an epoch, and dates, count from the first row. In JSON the columns are lists of one object, in
    MATLAB vectors or the fields of one struct. Parquet needs pyarrow, ULog pyulog, MATLAB 7.3 h5py.

    Parameters
    ----------
    path : str or Path
        The file.
    role : {"train", "held_out"}
        Whether an identification fits the flight, or only reports it.
    earth : {"NED", "ENU"}
        Axes of the earth that the file means; attitude and channels are turned to NED.
    body : {"FRD", "FLU"}
        Axes of the body that the file means; attitude and channels are turned to FRD.
    quaternion : {"wxyz", "xyzw"}, optional
        Order of the attitude's quaternion in columns that are numbered, ``q0`` to ``q3``. The columns ``qw``,
        ``qx``, ``qy``, ``qz`` need none. It turns vectors of the body into the earth's axes.
    columns : mapping of str to str, optional
        Titles of the file's columns by the names that they shall have, with scale and offset:
        ``{"theta_deg": "PITCH", "sweep_left_deg": "servo_1*0.09-45"}``. A field of a ULog file is
        ``topic.field``; what of it is a drive must be declared.
    between : pair of float, optional
        First and last time of the rows that are used, s.

    Returns
    -------
    Trajectory
        The flight, named after the file.

    Raises
    ------
    InvalidInput
        The file cannot be read, a column is missing or holds something that is not a finite number, time does
        not increase, the flight is longer than 600 s, an angle is no angle in rad, or a quaternion none.

    Examples
    --------
    >>> from morphcore import load_trajectory
    >>> sample = load_trajectory("examples/train_rate_0.8.csv")
    >>> sample.drive_order, round(sample.duration_s, 2)
    (('sweep_left', 'sweep_right'), 1.74)
    """
    path = Path(path)
    read = read_flight(path, declared(earth, body, quaternion, columns, between))
    return Trajectory(
        name=path.stem,
        time_s=_column(read.values["t"]),
        drives={name: _column(angles) for name, angles in read.drives.items()},
        **{name: _column(read.values[name]) for name in ANGLES},  # type: ignore[arg-type]
        role=role,
        extra={title: _column(values) for title, values in read.others.items()},
        of_file=True,
        unreadable={name: said_of(fault) for name, fault in read.unreadable.items()},
        channels={name: _column(values) for name, values in read.channels.items()},
        units=read.units,
    )


def require_flight(trajectory: Trajectory, pointer: str) -> None:
    """Raise InvalidInput if a sample violates the rules of `morphdata.samplefiles.flight`."""
    columns = {"t": trajectory.time_s, **{name: getattr(trajectory, name) for name in ANGLES}}
    columns |= trajectory.drives
    called = {name: INLINE.get(name, trajectory.field_of(name)) for name in columns}
    for fault in flight_faults({name: values.tolist() for name, values in columns.items()}, called):
        row = "" if fault.row is None else f"/{fault.row}"
        raise InvalidInput(
            fault.detail, pointer=f"{pointer}/{called[fault.title or 't']}{row}", hint=fault.hint
        )


def _column(values: Sequence[float]) -> Array:
    column = np.array(values, dtype=np.float64)
    column.setflags(write=False)
    return column
