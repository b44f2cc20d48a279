"""Turns schedules by drive, documents and measured flights into one schedule for every hinge."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Aircraft
from morphcore.geometry.control import Control
from morphcore.geometry.hinge import Hinge
from morphcore.simulate.schedule import Hold, Schedule, Tabulated, scheduled
from morphcore.simulate.trajectory import Trajectory
from morphdata import schedules as documents
from morphdata.drive_keys import resolved, shown_names, unmeasured_sides
from morphdata.drives import wrong_unit
from morphdata.faults import Fault, refuse
from morphdata.samples import columns_of_aircraft, no_drive

Schedules = Mapping[str, Schedule] | documents.Schedules | Trajectory
Followed = dict[str, tuple[str, Schedule]]  # drive -> key of the history it follows, and the history


def followed_schedules(aircraft: Aircraft, schedules: Schedules) -> Followed:
    """Find the schedule of each drive.

    Parameters
    ----------
    schedules : by the names of drives, their words (``sweep`` for both sides), or ``both``, ``left`` or
    ``right`` if unambiguous; a document of such, or its parsed JSON; or a flight whose measured angles are
    followed.

    Returns
    -------
    dict
        Drive -> the key that moves it and its schedule; drives that nothing moves are left out.

    Raises
    ------
    InvalidInput
        A key names no drive of the aircraft, is ambiguous, or moves a drive that another key moves.
    """
    if isinstance(schedules, Trajectory):
        return followed_flight(aircraft, schedules, "/schedules")
    if isinstance(schedules, Mapping) and not all(hasattr(value, "motion") for value in schedules.values()):
        schedules = documents.Schedules.parse(dict(schedules), "/schedules")
    if isinstance(schedules, documents.Schedules):
        moved = {key: scheduled(schedule) for key, schedule in schedules.given.items()}
        keys = schedules.keys_by_drive(aircraft.drives)
        for name, key in keys.items():
            unit, given = aircraft.drives[name].unit, schedules.given[key]
            if given.unit != unit:
                refuse([documents.unit_fault(name, unit, given, f"/schedules/{key}")])
        return {name: (key, moved[key]) for name, key in keys.items()}
    if not isinstance(schedules, Mapping):
        raise InvalidInput(
            "the schedules do not name the drives they move",
            pointer="/schedules",
            hint=f"give them by drive: {shown_names(aircraft.drives) or 'the aircraft has none'}",
        )
    keys, faults = resolved(schedules, aircraft.drives)
    refuse(fault.under("/schedules") for fault in faults)
    return {name: (key, schedules[key]) for name, key in keys.items()}


def followed_flight(aircraft: Aircraft, flight: Trajectory, pointer: str = "") -> Followed:
    """Find which measured angles each drive follows; drives that were not measured are left out.

    Columns of a file that are not drives of the aircraft are ignored.

    Raises
    ------
    InvalidInput
        No angle moves a drive, an angle is ambiguous or matches no drive, or only one side was measured.
    """
    drives = aircraft.drives
    faults: list[Fault] = []
    if flight.of_file:
        try:
            keys = columns_of_aircraft(list(flight.drives), flight.unreadable, drives)
        except InvalidInput as error:
            raise InvalidInput(f"{flight.name}: {error.message}", pointer=pointer, hint=error.hint) from None
    else:
        keys, faults = resolved(flight.drives, drives)
        if drives and not flight.drives:
            faults = [no_drive(drives)]
    faults = faults or list(unmeasured_sides(keys, drives))
    refuse(_at_field(fault, flight).under(pointer) for fault in faults)
    refuse(
        wrong_unit(drives[name], flight.units[key], f"/{flight.field_of(key)}").under(pointer)
        for name, key in keys.items()
        if flight.units.get(key, drives[name].unit) != drives[name].unit
    )
    return {name: (key, Tabulated(flight.time_s, flight.drives[key])) for name, key in keys.items()}


def _at_field(fault: Fault, flight: Trajectory) -> Fault:
    """A fault at ``/key`` at the field of that key."""
    key = fault.pointer.removeprefix("/")
    return replace(fault, pointer=f"/{flight.field_of(key)}") if key else fault


def moved_flight(aircraft: Aircraft, flight: Trajectory, pointer: str = "") -> Trajectory:
    """Return a flight without the columns of its file that are not drives of the aircraft.

    Raises
    ------
    InvalidInput
        As of `followed_flight`.
    """
    keys = {key for key, _ in followed_flight(aircraft, flight, pointer).values()}
    if keys == set(flight.drives):
        return flight
    drives = {name: angles for name, angles in flight.drives.items() if name in keys}
    return replace(flight, drives=drives)


def hinge_schedules(aircraft: Aircraft, followed: Followed) -> list[Schedule]:
    """Return the schedules of all hinges, then of all controls; what nothing moves holds its angle."""
    return [
        followed[part.drive][1] if part.drive in followed else Hold(part.angle_rad)
        for part in aircraft.moved_parts
    ]


def part_name(part: Hinge | Control) -> str:
    """Return what a drive moves, for messages."""
    return "control" if isinstance(part, Control) else "hinge"


def require_ranges(aircraft: Aircraft, followed: Followed, times_s: np.ndarray, pointer: str) -> None:
    """Raise InvalidInput if a drive leaves the range of one of its hinges or controls at times (k,), s."""
    for surface in aircraft.surfaces:
        for hinge in surface.moved_parts:
            if hinge.drive not in followed:
                continue
            key, schedule = followed[hinge.drive]
            angle = schedule.motion(times_s).angle
            outside = hinge.beyond_range(angle)
            if outside.size:
                row, kind, unit = outside[0], part_name(hinge), hinge.unit
                values = "angles" if unit == "rad" else "extensions"
                raise InvalidInput(
                    f"the {kind} {hinge.drive} of {surface.name} is driven to {angle[row]:.4g} {unit} at "
                    f"t = {times_s[row]:.3f} s, beyond its range {hinge.min_rad:g}..{hinge.max_rad:g} {unit}",
                    pointer=f"{pointer}/{key}",
                    hint=f"lower the {values}, or widen the {kind}'s range; a spline can go beyond its knots",
                )
