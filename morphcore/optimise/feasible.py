"""Feasibility of a morph under its limits, its shortest duration, and the constant-rate schedule."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Aircraft
from morphcore.optimise.limits import HELD, MorphSpace
from morphcore.simulate.schedule import ConstantRate, Schedule, Spline
from morphdata.controls import unmotorised
from morphdata.drives import wrong_unit
from morphdata.extensions import SLIDING_LIMITS
from morphdata.faults import refuse
from morphdata.optimize import Limits, Morph

OVERSHOOT = 0.5  # of the change: how far a schedule that may reverse may go beyond either end
USUAL_RAMP_S = 0.1  # ramps of a constant-rate schedule where the limits allow them, as in the sample flights


def morph_space(aircraft: Aircraft, morph: Morph, limits: Limits, duration_s: float) -> MorphSpace:
    """Return the unknowns and limits of a morph of the hinges that it moves.

    Raises
    ------
    InvalidInput : there is no hinge, the drive is ambiguous, or a hinge does not reach the angles.
    """
    drives = morph_drives(aircraft, morph)
    hinges = [part for part in aircraft.moved_parts if part.drive in drives]
    if limits.max_hinge_torque_nm is not None and (names := unmotorised(aircraft.drives, drives)):
        raise InvalidInput(
            f"the hinge moment of the control {names[0]} is not computed",
            pointer="/limits/max_hinge_torque_nm",
            hint="leave it out: only hinges have a limit of their torque",
        )
    minimum, maximum = max(hinge.min_rad for hinge in hinges), min(hinge.max_rad for hinge in hinges)
    unit = hinges[0].unit
    refuse(
        [wrong_unit(aircraft.drives[drives[0]], morph.unit, f"/morph/final_{morph.unit}")]
        if unit != morph.unit
        else []
    )
    for name, angle in ((f"initial_{unit}", morph.begin), (f"final_{unit}", morph.end)):
        if any(hinge.beyond_range(np.array([angle])).size for hinge in hinges):
            raise InvalidInput(
                f"{name} {angle:g} is beyond the hinges' range {minimum:g}..{maximum:g} {unit}",
                pointer=f"/morph/{name}",
                hint=f"choose a value inside, or widen the hinges' min_{unit} and max_{unit}",
            )
    stops = sorted((stop - morph.begin) / morph.change for stop in (minimum, maximum))
    return MorphSpace(
        morph,
        limits,
        duration_s,
        max(min(stops[0], 0.0), -OVERSHOOT),
        min(max(stops[1], 1.0), 1.0 + OVERSHOOT),
    )


def morph_drives(aircraft: Aircraft, morph: Morph) -> tuple[str, ...]:
    """Return the names of the drives that a morph moves together: those it names, or those of the only word.

    Raises
    ------
    InvalidInput : there is none, or the choice is ambiguous.
    """
    drives = aircraft.drives
    if not drives:
        raise InvalidInput(
            "no surface has a hinge", pointer="/aircraft/surfaces", hint="give the wings a hinge"
        )
    return morph.moved(drives)


def morph_word(aircraft: Aircraft, morph: Morph) -> str:
    """Return what a morph moves, for messages and results: the word or name of its drive."""
    return morph.named_drive(aircraft.drives)


def require_schedules(space: MorphSpace) -> None:
    """Raise InvalidInput if no schedule satisfies the limits.

    Raises
    ------
    InvalidInput : names the limit that is too tight and the shortest duration that it allows.
    """
    if space.room >= HELD:
        return
    limits = space.limits
    each = {
        "max_rate_rad_s": limits.model_copy(update={"max_accel_rad_s2": None}),
        "max_accel_rad_s2": limits.model_copy(update={"max_rate_rad_s": None}),
    }
    needed = {
        name: replace(space, limits=alone).quickest[0]
        for name, alone in each.items()
        if getattr(limits, name) is not None
    }
    shortest = space.quickest[0]
    # if two limits are too tight only in combination, report the one that needs more of the time
    name = max(needed, key=lambda item: needed[item])
    value = getattr(limits, name)
    # the rate goes with 1 / T, the acceleration with 1 / T^2
    power = 1 if name == "max_rate_rad_s" else 2
    enough = value * max(needed[name] / space.duration_s, 1.0) ** power
    shown = name if space.morph.unit == "rad" else SLIDING_LIMITS[name]
    loosen = f", or raise {shown} to {rounded_up(enough):g} or more" if enough > value else ""
    raise InvalidInput(
        f"{abs(space.morph.change):g} {space.morph.unit} in {space.duration_s:g} s on {space.morph.knots} "
        f"knots breaks {shown} = {value:g}: with these limits it takes {rounded_up(shortest):g} s",
        pointer=f"/limits/{shown}",
        hint=f"raise duration_s to {rounded_up(shortest):g} or more{loosen}",
    )


def constant_rate(morph: Morph, limits: Limits, duration_s: float) -> ConstantRate:
    """Return the constant-rate schedule with ramps that the optimum is compared with, over the same duration.

    Its ramps are those of the sample flights, or the nearest that satisfy the limits: a ramp r needs the rate
    ``change / (T - r)`` and the acceleration ``change / (T - r) / r``. It exists whenever a spline satisfies
    the limits, since no schedule needs less time than the trapezoid.
    """
    change = abs(morph.change)
    minimum, maximum = 0.0, 0.5 * duration_s
    if limits.max_accel_rad_s2 is not None:
        # ramp times remaining time must be at least change / acceleration
        root = 0.25 * duration_s**2 - change / limits.max_accel_rad_s2
        minimum = 0.5 * duration_s - np.sqrt(max(root, 0.0))
    if limits.max_rate_rad_s is not None:
        maximum = min(maximum, duration_s - change / limits.max_rate_rad_s)
    # a small margin, so that round-off cannot break the limit
    minimum, maximum = minimum * (1.0 + HELD), max(maximum * (1.0 - HELD), 0.0)
    ramp = float(np.clip(min(USUAL_RAMP_S, 0.25 * duration_s), minimum, max(minimum, maximum)))
    return ConstantRate(morph.begin, morph.end, duration_s, ramp_s=min(ramp, 0.5 * duration_s))


@dataclass(frozen=True)
class Reached:
    """Extremes of a schedule: largest rate (rad/s) and acceleration (rad/s^2); whether it never reverses."""

    max_rate_rad_s: float
    max_accel_rad_s2: float
    monotonic: bool


def reached(schedule: Schedule) -> Reached:
    """Return the extremes of a schedule as flown, in closed form from its coefficients.

    Raises
    ------
    TypeError : the schedule is neither a spline nor a constant rate.
    """
    if isinstance(schedule, ConstantRate):
        even = abs(schedule.final_rad - schedule.initial_rad) / (schedule.duration_s - schedule.ramp_s)
        return Reached(even, even / schedule.ramp_s if schedule.ramp_s > 0.0 else np.inf, monotonic=True)
    if not isinstance(schedule, Spline):
        raise TypeError(f"no closed form for {type(schedule).__name__}")
    cubic = CubicSpline(schedule.knot_time_s, schedule.knot_angle_rad, bc_type="clamped")
    rate, acceleration = cubic.derivative(), cubic.derivative(2)
    turns = acceleration.roots(extrapolate=False)
    at = np.concatenate([schedule.knot_time_s, turns[np.isfinite(turns)]])
    change = float(schedule.knot_angle_rad[-1] - schedule.knot_angle_rad[0])
    rates = rate(at) * np.sign(change)
    return Reached(
        max_rate_rad_s=float(np.abs(rates).max()),
        max_accel_rad_s2=float(np.abs(acceleration(schedule.knot_time_s)).max()),
        # the rate vanishes at both ends: round-off there is not a reversal
        monotonic=bool(rates.min() >= -HELD * np.abs(rates).max()),
    )


def rounded_up(value: float) -> float:
    """Return a number rounded up to three digits, for messages."""
    digit = 10.0 ** (np.floor(np.log10(value)) - 2.0)
    return float(np.ceil(value / digit - 1e-9) * digit)
