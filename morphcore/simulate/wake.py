"""The start that a flight's lattice is built for: direction of the wake, angles of trim drives, shape.

The tables of a plan hold the wake along one direction, that of the free stream at the trim of the rigid model
at the plan's first hinge angles. Angle of attack and wake depend on each other, and so do the angles of the
drives that balance moments (`trim_controls`): all are found together, once for each model, and shared by all
parameter sets of a batch.

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
from morphcore.models.equivalent import ChainModel, physical_guess
from morphcore.models.flexible import FlexibleModel
from morphcore.models.kinematics import bent_shape, whole_joints
from morphcore.simulate.schedule import HingeMotion, Schedule
from morphcore.simulate.section_lift import require_attached
from morphcore.simulate.steady import described
from morphcore.simulate.trim import StartMode, Trim, trim
from morphcore.simulate.trim_controls import MIN_AUTHORITY, TrimControl, no_authority, trim_controls

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


@dataclass(frozen=True)
class NominalStart:
    """Where a plan starts.

    alpha : angle of attack of the wake, rad. drives_rad : angles of the trim drives, in the order of
    `trim_controls`; none where they follow their schedules. shape : of all surfaces, on which the lattice is
    tabulated; None: unbent.
    """

    alpha: float
    drives_rad: tuple[float, ...] = ()
    shape: BentShape | None = None


def wake_direction(alpha: float, sideslip: float = 0.0) -> tuple[float, float, float]:
    """Direction (3,) of the free stream in B at an angle of attack and a sideslip, rad."""
    ahead, aside = float(np.cos(sideslip)), float(np.sin(sideslip))
    return (-float(np.cos(alpha)) * ahead, 0.0 - aside, -float(np.sin(alpha)) * ahead)


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
    """Schedules of which those of the trim drives are shifted to begin at the angles found.

    Parameters
    ----------
    times_s : (k,) of the flight, from its start.

    Raises
    ------
    InvalidInput
        A history leads a trim drive out of its range from there.
    """
    out = list(schedules)
    if not begin.drives_rad:
        return out
    for control, first in zip(trim_controls(model.aircraft, model.flight), begin.drives_rad, strict=True):
        for column in control.columns:
            part, own = model.aircraft.moved_parts[column], schedules[column]
            out[column] = Shifted(own, first - float(own.motion(times_s[:1]).angle[0]))
            angle = out[column].motion(times_s).angle
            outside = part.beyond_range(angle)
            if outside.size:
                raise InvalidInput(
                    f"the trim drive {part.drive} is at {first:.4g} rad in trim, and its history leads it to "
                    f"{angle[outside[0]]:.4g} rad, beyond its range {part.min_rad:g}..{part.max_rad:g} rad",
                    pointer=control.pointer,
                    hint="a trim drive's history counts from its first value: reduce it, or widen the range",
                )
    return out


def refuse_moved_trim(model: ChainModel, moves: Sequence[bool], start: StartMode) -> None:
    """Refuse a lattice along a path on which a trim drive moves: its angles depend on the trim.

    moves : whether the path moves what each schedule is for.

    Raises
    ------
    InvalidInput
        A trim drive is among them.
    """
    if start == "given":
        return
    for control in trim_controls(model.aircraft, model.flight):
        for column in control.columns:
            if moves[column]:
                raise InvalidInput(
                    f"the morph moves the flight's trim drive, {model.aircraft.moved_parts[column].drive}",
                    pointer=control.pointer,
                    hint="trim with another drive, or move others",
                )


def nominal_start(model: ChainModel, angles: Array, start: StartMode, instant: Instant) -> NominalStart:
    """Find the start at the first angles (h + c,), rad, of all schedules, those of trim drives being free.

    With ``start="given"`` the angle of attack is the flight's, and no drive is moved. The result is kept with
    the model.

    Raises
    ------
    TrimNotFound
        The nominal model has no such steady flight, or its shape does not settle.
    InvalidInput
        A trim drive does not exist, or would have to leave its range.
    """
    flight, shaped = model.flight, model.lattice.settings.shape == "trimmed"
    given = flight.start if start == "given" else None
    if given is not None and not shaped:
        return NominalStart(given.alpha_rad)
    controls = trim_controls(model.aircraft, flight) if given is None else ()
    first = np.array(angles, dtype=np.float64)
    for control in controls:
        first[control.columns] = 0.0  # the start does not depend on where the trim drives were before
    key = start.encode() + first.tobytes()
    if key not in model.starts:
        found = _found(_Balance(model, first, controls, instant, "trim" if given is None else "given"))
        model.starts[key] = found.alpha, found.drives_rad, found.shape
    return NominalStart(*model.starts[key])


class _Balance:
    """Trims of the nominal model whose wake is along the stream and whose trim drives leave no moment."""

    def __init__(
        self,
        model: ChainModel,
        angles: Array,
        controls: Sequence[TrimControl],
        instant: Instant,
        start: StartMode,
    ) -> None:
        self.shaped = model.lattice.settings.shape == "trimmed" and model.fine.joints > 0
        self.model = model.fine if self.shaped else model.rigid
        self.batch = physical_guess(self.model)
        self.angles, self.controls, self.instant, self.start = angles, controls, instant, start
        self.axes = [control.axis for control in controls]
        aircraft, self.flight = self.model.aircraft, self.model.flight
        area = sum(surface.area_m2 for surface in aircraft.surfaces)
        self.scale = self.flight.dynamic_pressure_pa * area * self.model.reference_surface.mean_chord_m
        self.low, self.high = (np.array([getattr(each, end) for each in controls]) for end in ("low", "high"))
        alpha = self.flight.start.alpha_rad if start == "given" and self.flight.start is not None else 0.0
        # angles of attack and of the drives; inverse of their slopes, which hardly depend on the shape
        self.x = np.concatenate([[alpha], np.clip(np.zeros(len(controls)), self.low, self.high)])
        self.inverse: Array | None = None
        self.found: Trim | None = None

    def defect(self, x: Array, shape: BentShape | None) -> Array:
        """Trimmed less assumed angle of attack, and coefficients of moments, at (alpha, drives)."""
        moved = self.angles.copy()
        for control, angle in zip(self.controls, x[1:], strict=True):
            moved[control.columns] = angle
        plan = self.instant(self.model, moved, float(x[0]), shape)
        flown = plan.flown(self.model)
        trimmed = trim(flown, self.batch, plan, start=self.start)
        found = require_attached(flown, self.batch, plan, trimmed, self.start)
        if plan.halved:
            found = replace(found, q_joint=whole_joints(self.model, found.q_joint))
        self.found = found
        return np.array([found.alpha[0] - x[0], *(found.moment_B[0, self.axes] / self.scale)])

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
            beyond = (x[1:] < self.low) | (x[1:] > self.high)
            x[1:] = np.clip(x[1:], self.low, self.high)
            step = x - before
            for k in np.flatnonzero(beyond & (step[1:] == 0.0)).tolist():
                raise no_authority(self.controls[k], x[k + 1], f[k + 1] * self.scale)
            if np.abs(step).max() < TOLERANCE_RAD:
                self.x, self.inverse = x, inverse
                return
            new = self.defect(x, shape)
            moved = inverse @ (new - f)
            inverse = inverse + np.outer(step - moved, step @ inverse) / (step @ moved)
            f = new
        raise TrimNotFound(
            residual=float(np.abs(step).max()), iterations=MAX_ROUNDS, flight=described(self.flight)
        )

    def _inverse(self, x: Array, f: Array, shape: BentShape | None) -> Array:
        """Inverse of the slopes of the defect, for the first step."""
        slopes = -np.eye(x.size)
        for k, control in enumerate(self.controls, start=1):
            probe = np.zeros(x.size)
            probe[k] = PROBE_RAD if x[k] + PROBE_RAD <= control.high else -PROBE_RAD
            slopes[:, k] = (self.defect(x + probe, shape) - f) / probe[k]
            if abs(slopes[k, k]) < MIN_AUTHORITY:
                raise no_authority(control, x[k], f[k] * self.scale)
        return np.asarray(np.linalg.inv(slopes), dtype=np.float64)

    def shape(self) -> BentShape:
        """The surfaces in the last trim."""
        assert self.found is not None  # noqa: S101 - called after `settle`
        return bent_shape(self.model, self.batch, self.found.q_joint[0])


def _found(balance: _Balance) -> NominalStart:
    if balance.scale == 0.0:
        return NominalStart(0.0)  # without air there is no wake
    balance.settle(None)
    shape, change = None, np.inf
    if balance.shaped:
        shape = balance.shape()
        for _ in range(MAX_SHAPES):
            balance.settle(shape)
            before, shape = shape, balance.shape()
            change = largest_change(before, shape)
            if change < SHAPE_TOLERANCE:
                break
        else:
            raise TrimNotFound(residual=change, iterations=MAX_SHAPES, flight=described(balance.flight))
    return NominalStart(float(balance.x[0]), tuple(balance.x[1:].tolist()), shape)
