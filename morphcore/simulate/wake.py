"""The start of a flight that its lattice is built for: the wake's direction and the angles of trim drives.

The tables of a plan hold the wake along one direction, that of the free stream at the trim of the rigid model
at the plan's first hinge angles. Angle of attack and wake depend on each other, and so do the angles of the
drives that balance moments (`trim_controls`): all are found together, once for each model, and shared by all
parameter sets of a batch.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from morphcore.errors import InvalidInput, TrimNotFound
from morphcore.models.equivalent import ChainModel, physical_guess
from morphcore.models.flexible import FlexibleModel
from morphcore.simulate.schedule import HingeMotion, Schedule
from morphcore.simulate.section_lift import require_attached
from morphcore.simulate.steady import described
from morphcore.simulate.trim import StartMode, trim
from morphcore.simulate.trim_controls import MIN_AUTHORITY, TrimControl, no_authority, trim_controls

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


@dataclass(frozen=True)
class NominalStart:
    """Where a plan starts.

    alpha : angle of attack of the wake, rad. drives_rad : angles of the trim drives, in the order of
    `trim_controls`; none where they follow their schedules.
    """

    alpha: float
    drives_rad: tuple[float, ...] = ()


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
        The rigid model has no such steady flight.
    InvalidInput
        A trim drive does not exist, or would have to leave its range.
    """
    flight = model.flight
    if start == "given" and flight.start is not None:
        return NominalStart(flight.start.alpha_rad)
    controls = trim_controls(model.aircraft, flight)
    first = np.array(angles, dtype=np.float64)
    for control in controls:
        first[control.columns] = 0.0  # the start does not depend on where the trim drives were before
    key = first.tobytes()
    if key not in model.starts:
        found = _found(model, first, controls, instant)
        model.starts[key] = found.alpha, found.drives_rad
    return NominalStart(*model.starts[key])


def _found(
    model: ChainModel, angles: Array, controls: Sequence[TrimControl], instant: Instant
) -> NominalStart:
    rigid, flight = model.rigid, model.flight
    area = sum(surface.area_m2 for surface in rigid.aircraft.surfaces)
    scale = flight.dynamic_pressure_pa * area * rigid.reference_surface.mean_chord_m
    if scale == 0.0:
        return NominalStart(0.0)  # without air there is no wake
    batch, axes = physical_guess(rigid), [control.axis for control in controls]

    def defect(x: Array) -> Array:
        """Trimmed less assumed angle of attack, and coefficients of moments, at (alpha, drives)."""
        moved = angles.copy()
        for control, angle in zip(controls, x[1:], strict=True):
            moved[control.columns] = angle
        plan = instant(rigid, moved, float(x[0]))
        flown = plan.flown(rigid)
        found = require_attached(flown, batch, plan, trim(flown, batch, plan), "trim")
        return np.array([found.alpha[0] - x[0], *(found.moment_B[0, axes] / scale)])

    # Broyden's first method: the slopes are nearly constant
    low, high = (np.array([getattr(each, end) for each in controls]) for end in ("low", "high"))
    x = np.concatenate([[0.0], np.clip(np.zeros(len(controls)), low, high)])
    f = defect(x)
    slopes = -np.eye(x.size)
    for k, control in enumerate(controls, start=1):
        probe = np.zeros(x.size)
        probe[k] = PROBE_RAD if x[k] + PROBE_RAD <= control.high else -PROBE_RAD
        slopes[:, k] = (defect(x + probe) - f) / probe[k]
        if abs(slopes[k, k]) < MIN_AUTHORITY:
            raise no_authority(control, x[k], f[k] * scale)
    inverse = np.linalg.inv(slopes)
    step = np.full(x.size, np.inf)
    for _ in range(MAX_ROUNDS):
        before, x = x, x - inverse @ f
        beyond = (x[1:] < low) | (x[1:] > high)
        x[1:] = np.clip(x[1:], low, high)
        step = x - before
        for k in np.flatnonzero(beyond & (step[1:] == 0.0)).tolist():
            raise no_authority(controls[k], x[k + 1], f[k + 1] * scale)
        if np.abs(step).max() < TOLERANCE_RAD:
            return NominalStart(float(x[0]), tuple(x[1:].tolist()))
        new = defect(x)
        moved = inverse @ (new - f)
        inverse = inverse + np.outer(step - moved, step @ inverse) / (step @ moved)
        f = new
    raise TrimNotFound(residual=float(np.abs(step).max()), iterations=MAX_ROUNDS, flight=described(flight))
