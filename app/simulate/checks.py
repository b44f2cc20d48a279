"""Checks across fields of a simulation; each fault names the field and the way out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise

from app.simulate.cost import row_count, step_count
from morphdata.base import MAX_ROWS
from morphdata.faults import Fault
from morphdata.schedules import AnySchedule, ConstantRate, Hold, Quadratic, Schedules, Spline, Tabulated
from morphdata.simulate import SimulateRequest
from morphdata.vehicle import HingeRange, hinge_ranges

MIN_ROWS = 3
SIDES = ("left", "right")
MAX_STEPS = {
    "rigid": 1_200_000,
    "equivalent": 1_200_000,
    "flexible": 60_000,
}  # about ten minutes of computing


def schedules_faults(request: SimulateRequest) -> Iterator[Fault]:
    """Check what the hinges do: each side told once, each schedule in itself and within its hinges' range."""
    schedules = request.schedules
    hinges = hinge_ranges(request.aircraft)
    if schedules.both is not None and (schedules.left is not None or schedules.right is not None):
        yield Fault(
            "given_twice",
            "Both sides have a schedule together, and one has its own.",
            "/schedules/both",
            "Give both, or left and right.",
        )
        return
    for side in SIDES:
        if side in hinges and schedules.both is None and getattr(schedules, side) is None:
            yield Fault(
                "missing",
                f"Nothing tells what the {side} hinges do.",
                f"/schedules/{side}",
                'Add it ({"kind": "hold"} keeps them still), or give both sides one schedule as both.',
            )
    for name, schedule, ranges in _told(schedules, hinges):
        pointer = f"/schedules/{name}"
        yield from _schedule_faults(schedule, pointer)
        for side, hinge in ranges:
            faults = (hinge.fault(side, angle, f"{pointer}/{at}") for angle, at in _angles(schedule))
            first = next(filter(None, faults), None)
            if first is not None:
                yield first


def air_faults(request: SimulateRequest) -> Iterator[Fault]:
    """Check that a gust blows somewhere."""
    gust = None if request.environment is None else request.environment.gust
    if gust is not None and not any(gust.direction_n):
        yield Fault(
            "no_direction",
            "The gust has no direction.",
            "/environment/gust/direction_n",
            "Give a vector of any length, [0, 0, -1] for up.",
        )


def size_faults(request: SimulateRequest, step_s: float | None) -> Iterator[Fault]:
    """Check that the flight has rows to show and that its steps can be flown in reasonable time.

    Parameters
    ----------
    step_s
        Longest time step as the request or its identified model says; None for the solver's own.
    """
    rows = row_count(request)
    if not MIN_ROWS <= rows <= MAX_ROWS:
        yield Fault(
            "too_many_rows" if rows > MAX_ROWS else "too_few_rows",
            f"{request.duration_s:g} s in steps of {request.output_step_s:g} s make {rows} rows.",
            "/output_step_s",
            f"Choose duration_s and output_step_s for {MIN_ROWS} to {MAX_ROWS} rows.",
        )
    steps, most = step_count(request, step_s), MAX_STEPS[request.model.kind]
    if steps > most:
        yield Fault(
            "too_much_work",
            f"The flight takes {steps} time steps of the {request.model.kind} model.",
            "/duration_s",
            f"At most {most}: fly shorter, or choose a longer model.step_s.",
        )


def _told(
    schedules: Schedules, hinges: Mapping[str, HingeRange]
) -> Iterator[tuple[str, AnySchedule, list[tuple[str, HingeRange]]]]:
    """Every schedule that is given, with its name and the hinges that follow it."""
    if schedules.both is not None:
        yield "both", schedules.both, list(hinges.items())
    for side in SIDES:
        schedule = getattr(schedules, side)
        if schedule is not None:
            yield side, schedule, [(side, hinges[side])] if side in hinges else []


def _angles(schedule: AnySchedule) -> Iterator[tuple[float, str]]:
    """Angles that a schedule names, with their place in it.

    A spline may leave its range between knots; the worker, which flies it, sees that.
    """
    if isinstance(schedule, Hold):
        yield schedule.angle_rad, "angle_rad"
    elif isinstance(schedule, ConstantRate | Quadratic):
        yield schedule.initial_rad, "initial_rad"
        yield schedule.final_rad, "final_rad"
    elif isinstance(schedule, Spline):
        yield from ((angle, f"knot_angle_rad/{row}") for row, angle in enumerate(schedule.knot_angle_rad))
    else:
        yield from ((angle, f"angle_rad/{row}") for row, angle in enumerate(schedule.angle_rad))


def _schedule_faults(schedule: AnySchedule, pointer: str) -> Iterator[Fault]:
    if isinstance(schedule, ConstantRate):
        yield from _constant_rate_faults(schedule, pointer)
    elif isinstance(schedule, Spline):
        times, angles = schedule.knot_time_s, schedule.knot_angle_rad
        yield from _history_faults(times, angles, f"{pointer}/knot_time_s", f"{pointer}/knot_angle_rad")
    elif isinstance(schedule, Tabulated):
        times, angles = schedule.time_s, schedule.angle_rad
        yield from _history_faults(times, angles, f"{pointer}/time_s", f"{pointer}/angle_rad")


def _constant_rate_faults(schedule: ConstantRate, pointer: str) -> Iterator[Fault]:
    change = abs(schedule.final_rad - schedule.initial_rad)
    if (schedule.duration_s is None) == (schedule.rate_rad_s is None):
        both = schedule.duration_s is not None
        yield Fault(
            "given_twice" if both else "missing",
            f"duration_s and rate_rad_s are {'both given' if both else 'both missing'}.",
            f"{pointer}/rate_rad_s" if both else f"{pointer}/duration_s",
            "Give one of them: the other follows.",
        )
        return
    if schedule.rate_rad_s is not None and change == 0.0:
        yield Fault(
            "nothing_to_morph",
            "At a rate from an angle to the same angle there is no time in which to move.",
            f"{pointer}/final_rad",
            'Give another final_rad, or {"kind": "hold"}.',
        )
        return
    rate = schedule.rate_rad_s or 1.0
    duration_s = change / rate if schedule.duration_s is None else schedule.duration_s
    if schedule.ramp_s > duration_s / 2:
        yield Fault(
            "ramp_too_long",
            f"Two ramps of {schedule.ramp_s:g} s do not fit into a morph of {duration_s:g} s.",
            f"{pointer}/ramp_s",
            f"Give at most {duration_s / 2:g} s, or morph more slowly.",
        )


def _history_faults(
    times: Sequence[float], angles: Sequence[float], time_pointer: str, angle_pointer: str
) -> Iterator[Fault]:
    if len(times) != len(angles):
        yield Fault(
            "unequal_lengths",
            f"There are {len(times)} times and {len(angles)} angles.",
            angle_pointer,
            "Give one angle for every time.",
        )
    for row, (before, after) in enumerate(pairwise(times), start=1):
        if after <= before:
            yield Fault(
                "time_not_rising",
                f"Time goes from {before:g} s to {after:g} s at row {row}.",
                f"{time_pointer}/{row}",
                "Sort the rows by time and drop repeated ones.",
            )
            break
