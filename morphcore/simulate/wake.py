"""The start of a flight that its lattice is built for: the wake's direction and the angle of the trim drive.

The tables of a plan hold the wake along one direction, that of the free stream at the trim of the rigid model
at the plan's first hinge angles. Angle of attack and wake depend on each other, and so does the angle of a
drive that balances the pitching moment (``flight.trim_drive``): all are found together, once for each model,
and shared by all parameter sets of a batch.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from morphcore.errors import InvalidInput, TrimNotFound
from morphcore.geometry.aircraft import Aircraft
from morphcore.models.equivalent import ChainModel, physical_guess
from morphcore.models.flexible import FlexibleModel
from morphcore.simulate.schedule import HingeMotion, Schedule
from morphcore.simulate.trim import StartMode, trim
from morphdata.drives import Drive, without_side

if TYPE_CHECKING:
    from morphcore.simulate.plan import FlightPlan

Array = NDArray[np.float64]
# a plan of one instant for angles (h + c,) of all hinges and controls, rad, and the wake's angle of attack
Instant = Callable[[ChainModel, Array, float], "FlightPlan"]

TOLERANCE_RAD = (
    1e-7  # limit of the last step, which leaves a thousandth of it: the trim hardly feels the wake
)
MAX_ROUNDS = 12  # three are enough up to 20 degrees
PROBE_RAD = 1e-3  # of the drive, for the first slope of its moment
MIN_AUTHORITY = 1e-6  # 1/rad, slope of the moment's coefficient: below it the drive moves no lifting surface


@dataclass(frozen=True)
class NominalStart:
    """Where a plan starts.

    alpha : angle of attack of the wake, rad. drive_rad : angle of the trim drive; None if there is none.
    """

    alpha: float
    drive_rad: float | None = None


def wake_direction(alpha: float) -> tuple[float, float, float]:
    """Direction (3,) of the free stream in B at an angle of attack, rad."""
    return (-float(np.cos(alpha)), 0.0, -float(np.sin(alpha)))


def trim_drives(aircraft: Aircraft, name: str | None) -> tuple[Drive, ...]:
    """The drives that a name or a bare word of ``flight.trim_drive`` means; none without a name.

    Raises
    ------
    InvalidInput
        The aircraft has no such drive.
    """
    if name is None:
        return ()
    drives = aircraft.drives
    found = (
        (drives[name],)
        if name in drives
        else tuple(drive for drive in drives.values() if without_side(drive.name) == name)
    )
    if not found:
        raise InvalidInput(
            f"the aircraft has no drive {name!r} to trim with",
            pointer="/flight/trim_drive",
            hint=f"its drives are {', '.join(drives)}" if drives else "it has no drives: omit trim_drive",
        )
    if any(drive.unit != "rad" for drive in found):
        turning = [drive.name for drive in drives.values() if drive.unit == "rad"]
        raise InvalidInput(
            f"the drive {name!r} slides, and a trim turns its drive",
            pointer="/flight/trim_drive",
            hint=f"those that turn are {', '.join(turning)}" if turning else "none turns: omit trim_drive",
        )
    return found


def trim_columns(aircraft: Aircraft, name: str | None) -> NDArray[np.int64]:
    """Numbers of the schedules of the trim drive among those of the aircraft."""
    found = [
        k for k, part in enumerate(aircraft.moved_parts) if name in (part.drive, without_side(part.drive))
    ]
    return np.array(found, dtype=np.int64)


@dataclass(frozen=True)
class Shifted:
    """A schedule with a constant angle added, rad."""

    schedule: Schedule
    added_rad: float

    def motion(self, time_s: ArrayLike) -> HingeMotion:
        """The motion at the given times, s."""
        own = self.schedule.motion(time_s)
        return HingeMotion(own.angle + self.added_rad, own.rate, own.acceleration)


def trimmed_schedules(
    model: ChainModel | FlexibleModel, schedules: Sequence[Schedule], times_s: Array, begin: NominalStart
) -> list[Schedule]:
    """Schedules of which those of the trim drive are shifted to begin at the angle found.

    Parameters
    ----------
    times_s : (k,) of the flight, from its start.

    Raises
    ------
    InvalidInput
        A history leads the trim drive out of its range from there.
    """
    out = list(schedules)
    if begin.drive_rad is None:
        return out
    for column in trim_columns(model.aircraft, model.flight.trim_drive):
        part, own = model.aircraft.moved_parts[column], schedules[column]
        out[column] = Shifted(own, begin.drive_rad - float(own.motion(times_s[:1]).angle[0]))
        angle = out[column].motion(times_s).angle
        outside = part.beyond_range(angle)
        if outside.size:
            raise InvalidInput(
                f"the trim drive {part.drive} is at {begin.drive_rad:.4g} rad in trim, and its history leads "
                f"it to {angle[outside[0]]:.4g} rad, beyond its range {part.min_rad:g}..{part.max_rad:g} rad",
                pointer="/flight/trim_drive",
                hint="a history of the trim drive counts from its first value: reduce it, or widen the range",
            )
    return out


def refuse_moved_trim(model: ChainModel, moves: Sequence[bool], start: StartMode) -> None:
    """Refuse a lattice along a path on which the trim drive moves: its angles depend on the trim.

    moves : whether the path moves what each schedule is for.

    Raises
    ------
    InvalidInput
        The trim drive is among them.
    """
    if start == "given":
        return
    for column in trim_columns(model.aircraft, model.flight.trim_drive):
        if moves[column]:
            raise InvalidInput(
                f"the morph moves the flight's trim drive, {model.aircraft.moved_parts[column].drive}",
                pointer="/flight/trim_drive",
                hint="trim with another drive, or move others",
            )


def nominal_start(model: ChainModel, angles: Array, start: StartMode, instant: Instant) -> NominalStart:
    """Find the start at the first angles (h + c,), rad, of all schedules, those of the trim drive being free.

    With ``start="given"`` the angle of attack is the flight's, and no drive is moved. The result is kept with
    the model.

    Raises
    ------
    TrimNotFound
        The rigid model has no level flight.
    InvalidInput
        The trim drive does not exist, or would have to leave its range.
    """
    flight = model.flight
    if start == "given" and flight.start is not None:
        return NominalStart(flight.start.alpha_rad)
    trim_drives(model.aircraft, flight.trim_drive)
    columns = trim_columns(model.aircraft, flight.trim_drive)
    first = np.array(angles, dtype=np.float64)
    first[columns] = 0.0  # the start does not depend on where the trim drive was before
    key = first.tobytes()
    if key not in model.starts:
        found = _found(model, first, columns, instant)
        model.starts[key] = found.alpha, found.drive_rad
    return NominalStart(*model.starts[key])


def _found(model: ChainModel, angles: Array, columns: NDArray[np.int64], instant: Instant) -> NominalStart:
    rigid, flight = model.rigid, model.flight
    area = sum(surface.area_m2 for surface in rigid.aircraft.surfaces)
    scale = flight.dynamic_pressure_pa * area * rigid.reference_surface.mean_chord_m
    if scale == 0.0:
        return NominalStart(0.0)  # without air there is no wake
    drives, batch = trim_drives(rigid.aircraft, flight.trim_drive), physical_guess(rigid)

    def defect(x: Array) -> Array:
        """Trimmed less assumed angle of attack, and the coefficient of the moment, at (alpha, drive)."""
        moved = angles.copy()
        moved[columns] = x[1:].sum()
        plan = instant(rigid, moved, float(x[0]))
        found = trim(plan.flown(rigid), batch, plan).require()
        return np.array([found.alpha[0] - x[0], found.moment_B[0, 1] / scale])[: x.size]

    # Broyden's first method: the slopes are nearly constant
    low, high = trim_range(drives)
    x = np.array([0.0, np.clip(0.0, low, high)])[: 2 if drives else 1]
    f = defect(x)
    inverse = -np.eye(x.size)
    if drives:
        probe = np.array([0.0, PROBE_RAD if x[1] + PROBE_RAD <= high else -PROBE_RAD])
        slope = (defect(x + probe) - f) / probe[1]
        if abs(slope[1]) < MIN_AUTHORITY:
            raise no_authority(flight.trim_drive, x[1], f[1] * scale)
        inverse = np.linalg.inv(np.array([[-1.0, slope[0]], [0.0, slope[1]]]))
    step = np.full(x.size, np.inf)
    for _ in range(MAX_ROUNDS):
        before, x = x, x - inverse @ f
        beyond = bool(drives) and not low <= x[1] <= high
        x[1:] = np.clip(x[1:], low, high)
        step = x - before
        if beyond and step[1] == 0.0:
            raise no_authority(flight.trim_drive, x[1], f[1] * scale)
        if np.abs(step).max() < TOLERANCE_RAD:
            return NominalStart(float(x[0]), float(x[1]) if drives else None)
        new = defect(x)
        moved = inverse @ (new - f)
        inverse = inverse + np.outer(step - moved, step @ inverse) / (step @ moved)
        f = new
    raise TrimNotFound(residual=float(np.abs(step).max()), iterations=MAX_ROUNDS)


def trim_range(drives: Sequence[Drive]) -> tuple[float, float]:
    """Smallest and largest angle of some drives that move together, rad."""
    return max((d.low for d in drives), default=-np.inf), min((d.high for d in drives), default=np.inf)


def no_authority(name: str | None, angle_rad: float, moment: float) -> InvalidInput:
    """The error of a trim drive that cannot balance the pitching moment: at an angle some is left, N m."""
    return InvalidInput(
        f"the drive {name!r} cannot balance the pitching moment: at {angle_rad:.4g} rad {moment:.4g} N m are "
        "left",
        pointer="/flight/trim_drive",
        hint="its authority is too small: widen the range of its hinges, move the centre of mass, enlarge "
        "the surface or its arm, or omit trim_drive to trim by a constant moment",
    )
