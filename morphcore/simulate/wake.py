"""The start that a flight's lattice is built for: direction of the wake, angle of the trim drive, shape.

The tables of a plan hold the wake along one direction, that of the free stream at the trim of the rigid model
at the plan's first hinge angles. Angle of attack and wake depend on each other, and so does the angle of a
drive that balances the pitching moment (``flight.trim_drive``): all are found together, once for each model,
and shared by all parameter sets of a batch.

With ``lattice.shape = "trimmed"`` a nominal chain of many links takes the place of the rigid model, and its
shape in trim that of the unbent surfaces: trim and shape are found in turns. They depend neither on the
number of links nor on the parameters of the models that fly the plan, so an identification has one lattice
for all parameter sets, and a model has the same one after it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from morphcore.aero.bent_shape import BentShape, largest_change
from morphcore.errors import InvalidInput, TrimNotFound
from morphcore.geometry.aircraft import Aircraft
from morphcore.models.equivalent import ChainModel, physical_guess
from morphcore.models.flexible import FlexibleModel
from morphcore.models.kinematics import bent_shape, whole_joints
from morphcore.simulate.schedule import HingeMotion, Schedule
from morphcore.simulate.trim import StartMode, Trim, trim
from morphdata.drives import Drive, without_side

if TYPE_CHECKING:
    from morphcore.simulate.plan import FlightPlan

Array = NDArray[np.float64]
# a plan of one instant for angles (h + c,) of all hinges and controls, rad, the wake's angle of attack, and
# the shape of the lattice
Instant = Callable[[ChainModel, Array, float, BentShape | None], "FlightPlan"]

TOLERANCE_RAD = (
    1e-7  # limit of the last step, which leaves a thousandth of it: the trim hardly feels the wake
)
MAX_ROUNDS = 12  # three are enough up to 20 degrees
PROBE_RAD = 1e-3  # of the drive, for the first slope of its moment
SHAPE_TOLERANCE = 1e-7  # of the last change of shape, rad and half-spans
MAX_SHAPES = 25  # six are enough where the tip is at a third of the half-span
MIN_AUTHORITY = 1e-6  # 1/rad, slope of the moment's coefficient: below it the drive moves no lifting surface


@dataclass(frozen=True)
class NominalStart:
    """Where a plan starts.

    alpha : angle of attack of the wake, rad. drive_rad : angle of the trim drive; None if there is none.
    shape : of all surfaces, on which the lattice is tabulated; None: unbent.
    """

    alpha: float
    drive_rad: float | None = None
    shape: BentShape | None = None


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
        The nominal model has no level flight, or its shape does not settle.
    InvalidInput
        The trim drive does not exist, or would have to leave its range.
    """
    flight, shaped = model.flight, model.lattice.settings.shape == "trimmed"
    given = start == "given" and flight.start is not None
    if given and flight.start is not None and not shaped:
        return NominalStart(flight.start.alpha_rad)
    if not given:
        trim_drives(model.aircraft, flight.trim_drive)
    columns = trim_columns(model.aircraft, None if given else flight.trim_drive)
    first = np.array(angles, dtype=np.float64)
    first[columns] = 0.0  # the start does not depend on where the trim drive was before
    key = start.encode() + first.tobytes()
    if key not in model.starts:
        found = _found(_Balance(model, first, columns, instant, "given" if given else "trim"))
        model.starts[key] = found.alpha, found.drive_rad, found.shape
    return NominalStart(*model.starts[key])


class _Balance:
    """Trims of the nominal model whose wake is along the stream and whose trim drive leaves no moment."""

    def __init__(
        self,
        model: ChainModel,
        angles: Array,
        columns: NDArray[np.int64],
        instant: Instant,
        start: StartMode,
    ) -> None:
        self.shaped = model.lattice.settings.shape == "trimmed" and model.fine.joints > 0
        self.model = model.fine if self.shaped else model.rigid
        self.batch = physical_guess(self.model)
        self.angles, self.columns, self.instant, self.start = angles, columns, instant, start
        aircraft, self.flight = self.model.aircraft, self.model.flight
        area = sum(surface.area_m2 for surface in aircraft.surfaces)
        self.scale = self.flight.dynamic_pressure_pa * area * self.model.reference_surface.mean_chord_m
        drives = () if start == "given" else trim_drives(aircraft, self.flight.trim_drive)
        self.low, self.high = trim_range(drives)
        self.drives = len(drives) > 0
        alpha = self.flight.start.alpha_rad if start == "given" and self.flight.start is not None else 0.0
        # angle of attack and that of the drive; inverse of their slopes, which hardly depend on the shape
        self.x = np.array([alpha, np.clip(0.0, self.low, self.high)])[: 2 if self.drives else 1]
        self.inverse: Array | None = None
        self.found: Trim | None = None

    def defect(self, x: Array, shape: BentShape | None) -> Array:
        """Trimmed less assumed angle of attack, and the coefficient of the moment, at (alpha, drive)."""
        moved = self.angles.copy()
        moved[self.columns] = x[1:].sum()
        plan = self.instant(self.model, moved, float(x[0]), shape)
        flown = plan.flown(self.model)
        found = trim(flown, self.batch, plan, start=self.start).require()
        if plan.halved:
            found = replace(found, q_joint=whole_joints(self.model, found.q_joint))
        self.found = found
        return np.array([found.alpha[0] - x[0], found.moment_B[0, 1] / self.scale])[: x.size]

    def settle(self, shape: BentShape | None) -> None:
        """Find the start with a lattice of this shape by Broyden's first method: slopes hardly change."""
        x = self.x
        f = self.defect(x, shape)
        if self.start == "given":
            return
        inverse = self._inverse(x, f, shape) if self.inverse is None else self.inverse
        step = np.full(x.size, np.inf)
        for _ in range(MAX_ROUNDS):
            before, x = x, x - inverse @ f
            beyond = self.drives and not self.low <= x[1] <= self.high
            x[1:] = np.clip(x[1:], self.low, self.high)
            step = x - before
            if beyond and step[1] == 0.0:
                raise no_authority(self.flight.trim_drive, x[1], f[1] * self.scale)
            if np.abs(step).max() < TOLERANCE_RAD:
                self.x, self.inverse = x, inverse
                return
            new = self.defect(x, shape)
            moved = inverse @ (new - f)
            inverse = inverse + np.outer(step - moved, step @ inverse) / (step @ moved)
            f = new
        raise TrimNotFound(residual=float(np.abs(step).max()), iterations=MAX_ROUNDS)

    def _inverse(self, x: Array, f: Array, shape: BentShape | None) -> Array:
        """Inverse of the slopes of the defect, for the first step."""
        if not self.drives:
            return -np.eye(x.size)
        probe = np.array([0.0, PROBE_RAD if x[1] + PROBE_RAD <= self.high else -PROBE_RAD])
        slope = (self.defect(x + probe, shape) - f) / probe[1]
        if abs(slope[1]) < MIN_AUTHORITY:
            raise no_authority(self.flight.trim_drive, x[1], f[1] * self.scale)
        return np.linalg.inv(np.array([[-1.0, slope[0]], [0.0, slope[1]]]))

    def shape(self) -> BentShape:
        """The surfaces in the last trim."""
        assert self.found is not None  # noqa: S101 - called after `settle`
        return bent_shape(self.model, self.batch, self.found.q_joint[0])


def _found(balance: _Balance) -> NominalStart:
    if balance.scale == 0.0:
        return NominalStart(0.0)  # without air there is no wake
    balance.settle(None)
    shape = change = None
    if balance.shaped:
        shape = balance.shape()
        for _ in range(MAX_SHAPES):
            balance.settle(shape)
            before, shape = shape, balance.shape()
            change = largest_change(before, shape)
            if change < SHAPE_TOLERANCE:
                break
        else:
            raise TrimNotFound(residual=float(change or 0.0), iterations=MAX_SHAPES)
    x = balance.x
    return NominalStart(float(x[0]), float(x[1]) if balance.drives else None, shape)


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
