"""Schedules as JSON documents: one for both sides, or one for each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Aircraft
from morphcore.geometry.fields import Fields
from morphcore.geometry.surface import Side
from morphcore.simulate.schedule import ConstantRate, Hold, Quadratic, Schedule, Spline, Tabulated
from morphcore.simulate.schedule_table import LEAST_ROWS
from morphdata.samplefiles.flight import LONGEST_FLIGHT_S, MOST_ROWS

Array = NDArray[np.float64]

SIDES: tuple[Side, ...] = ("left", "right")
LARGEST_ANGLE_RAD = 2.0 * np.pi  # degrees taken for radians are beyond it; hinges have ranges of their own
LARGEST_RATE_RAD_S = 100.0
DEFAULT_RAMP_S = 0.1
FEWEST_KNOTS, MOST_KNOTS = 2, 1000


def schedule_from_document(document: Any, pointer: str) -> Schedule:
    """Read one schedule; angles in rad, times in s.

    ``{"kind": "hold", "angle_rad"}``; ``{"kind": "constant_rate", "initial_rad", "final_rad", "duration_s" or
    "rate_rad_s" (the mean rate, without its sign), "start_s", "ramp_s"}``; ``{"kind": "quadratic",
    "initial_rad", "final_rad", "duration_s", "start_s"}``; ``{"kind": "spline", "knot_time_s",
    "knot_angle_rad"}``; ``{"kind": "tabulated", "time_s", "angle_rad"}``. Angles to begin with and starts are
    0, ramps 0.1 s, if missing.

    Raises
    ------
    InvalidInput : with a pointer to the field at fault.
    """
    fields = Fields(document, pointer)
    schedule = READERS[fields.choice("kind", tuple(READERS))](fields)
    fields.done()
    return schedule


def schedules_from_document(
    document: Any, aircraft: Aircraft, pointer: str = "/schedules"
) -> dict[str, Schedule]:
    """Read the schedules of both sides: ``{"both"}``, or ``{"left", "right"}``.

    A side without a hinge needs none.

    Raises
    ------
    InvalidInput : a side with a hinge has no schedule or two, or a schedule makes no sense.
    """
    fields = Fields(document, pointer)
    found: dict[str, Schedule] = {}
    if fields.has("both"):
        for side in SIDES:
            if fields.has(side):
                raise InvalidInput(
                    f"the {side} side has two schedules",
                    pointer=f"{pointer}/{side}",
                    hint="give either both, or left and right",
                )
        both = schedule_from_document(fields.raw("both"), f"{pointer}/both")
        found = dict.fromkeys(SIDES, both)
    hinged = {surface.side for surface in aircraft.surfaces if surface.hinge is not None}
    for side in SIDES:
        if fields.has(side):
            found[side] = schedule_from_document(fields.raw(side), f"{pointer}/{side}")
        elif side not in found and side in hinged:
            raise InvalidInput(
                f"the {side} side has no schedule",
                pointer=f"{pointer}/{side}",
                hint='add it; {"kind": "hold"} does not move',
            )
        found.setdefault(side, Hold())
    fields.done()
    return found


def require_hinge_ranges(
    aircraft: Aircraft, schedules: Mapping[str, Schedule], times: Array, pointers: Mapping[str, str]
) -> None:
    """Refuse a schedule that drives a hinge beyond its range at one of the times (k,), s.

    Parameters
    ----------
    pointers : where each side's schedule stands, for errors.
    """
    for surface in aircraft.surfaces:
        if surface.hinge is None:
            continue
        angle = schedules[surface.side].motion(times).angle
        outside = surface.hinge.beyond_range(angle)
        if outside.size:
            raise InvalidInput(
                f"the hinge of {surface.name} is driven to {angle[outside[0]]:.4g} rad at "
                f"t = {times[outside[0]]:.3f} s",
                pointer=pointers[surface.side],
                hint=f"its range is {surface.hinge.min_rad:g}..{surface.hinge.max_rad:g} rad; a spline can "
                "go beyond its knots",
            )


# one kind each


def _hold(fields: Fields) -> Schedule:
    return Hold(_angle(fields, "angle_rad", default=0.0))


def _constant_rate(fields: Fields) -> Schedule:
    initial, final = _angle(fields, "initial_rad", default=0.0), _angle(fields, "final_rad")
    start_s = fields.number("start_s", default=0.0, least=0.0, most=LONGEST_FLIGHT_S)
    duration_s = _duration(fields, abs(final - initial))
    ramp_s = fields.number("ramp_s", default=DEFAULT_RAMP_S, least=0.0, most=LONGEST_FLIGHT_S)
    if ramp_s > duration_s / 2:
        raise InvalidInput(
            f"two ramps of {ramp_s:g} s do not fit into {duration_s:g} s",
            pointer=f"{fields.pointer}/ramp_s",
            hint=f"give at most {duration_s / 2:g} s, or a longer morph",
        )
    return ConstantRate(initial, final, duration_s, start_s, ramp_s)


def _duration(fields: Fields, change_rad: float) -> float:
    """Duration of a morph at constant rate, s: given, or out of the mean rate."""
    duration_s = fields.optional_number("duration_s", above=0.0, most=LONGEST_FLIGHT_S)
    rate = fields.optional_number("rate_rad_s", above=0.0, most=LARGEST_RATE_RAD_S)
    if duration_s is not None and rate is None:
        return duration_s
    if rate is None or duration_s is not None:
        raise InvalidInput(
            f"{'both' if rate else 'neither'} of duration_s and rate_rad_s {'are' if rate else 'is'} given",
            pointer=f"{fields.pointer}/{'rate_rad_s' if rate else 'duration_s'}",
            hint="give one of them",
        )
    if not 0.0 < change_rad / rate <= LONGEST_FLIGHT_S:
        raise InvalidInput(
            f"at {rate:g} rad/s the morph of {change_rad:g} rad takes {change_rad / rate:g} s",
            pointer=f"{fields.pointer}/rate_rad_s",
            hint=f"it must take more than 0 and at most {LONGEST_FLIGHT_S:g} s; the kind hold does not move",
        )
    return change_rad / rate


def _quadratic(fields: Fields) -> Schedule:
    return Quadratic(
        initial_rad=_angle(fields, "initial_rad", default=0.0),
        final_rad=_angle(fields, "final_rad"),
        duration_s=fields.number("duration_s", above=0.0, most=LONGEST_FLIGHT_S),
        start_s=fields.number("start_s", default=0.0, least=0.0, most=LONGEST_FLIGHT_S),
    )


def _spline(fields: Fields) -> Schedule:
    return Spline(*_history(fields, "knot_time_s", "knot_angle_rad", FEWEST_KNOTS, MOST_KNOTS))


def _tabulated(fields: Fields) -> Schedule:
    return Tabulated(*_history(fields, "time_s", "angle_rad", LEAST_ROWS, MOST_ROWS))


READERS: Mapping[str, Callable[[Fields], Schedule]] = {
    "hold": _hold,
    "constant_rate": _constant_rate,
    "quadratic": _quadratic,
    "spline": _spline,
    "tabulated": _tabulated,
}


# fields


def _angle(fields: Fields, name: str, **options: float) -> float:
    return fields.number(name, least=-LARGEST_ANGLE_RAD, most=LARGEST_ANGLE_RAD, **options)


def _history(fields: Fields, time: str, angle: str, fewest: int, most: int) -> tuple[Array, Array]:
    """Times that rise and the angles at them, both (k,)."""
    times, angles = fields.series(time), fields.series(angle)
    if not fewest <= times.size <= most:
        raise InvalidInput(
            f"{time} has {times.size} rows",
            pointer=f"{fields.pointer}/{time}",
            hint=f"give {fewest} to {most}",
        )
    if angles.size != times.size:
        raise InvalidInput(
            f"{angle} has {angles.size} rows, {time} has {times.size}",
            pointer=f"{fields.pointer}/{angle}",
            hint="give equal lengths",
        )
    falls = np.flatnonzero(np.diff(times) <= 0.0)
    if falls.size:
        raise InvalidInput(
            f"time does not rise at row {falls[0] + 1}",
            pointer=f"{fields.pointer}/{time}/{falls[0] + 1}",
            hint="sort the rows by time and drop doubles",
        )
    wide = np.flatnonzero(np.abs(angles) > LARGEST_ANGLE_RAD)
    if wide.size:
        raise InvalidInput(
            f"{angle} is {angles[wide[0]]:g} at row {wide[0]}",
            pointer=f"{fields.pointer}/{angle}/{wide[0]}",
            hint="angles are in rad",
        )
    return times, angles
