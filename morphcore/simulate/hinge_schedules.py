"""Who moves which hinge: schedules by drive, documents and measured flights as a schedule for every hinge."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Aircraft
from morphcore.simulate.schedule import Hold, Schedule, Tabulated, scheduled
from morphcore.simulate.trajectory import Trajectory
from morphdata import schedules as documents
from morphdata.drives import resolved, shown_names
from morphdata.faults import refuse

Schedules = Mapping[str, Schedule] | documents.Schedules | Trajectory
Followed = dict[str, tuple[str, Schedule]]  # drive -> key of the history it follows, and that


def followed_schedules(aircraft: Aircraft, schedules: Schedules, pointer: str = "/schedules") -> Followed:
    """Find out what each drive does.

    Parameters
    ----------
    schedules : by the names of drives, their words (``sweep``, of both sides), ``both``, ``left`` or
        ``right`` where no other drive could be meant; a document of such; or a flight whose measured angles
        are followed.

    Returns
    -------
    dict
        Drive -> the key that moves it and its schedule; a drive that nothing moves is not in it.

    Raises
    ------
    InvalidInput
        A key names no drive of the aircraft, could mean several, or moves what another one moves.
    """
    if isinstance(schedules, Trajectory):
        return followed_flight(aircraft, schedules, pointer)
    given: Mapping[str, Schedule]
    if isinstance(schedules, documents.Schedules):
        found = {key: getattr(schedules, key) for key in type(schedules).model_fields}
        given = {key: scheduled(schedule) for key, schedule in found.items() if schedule is not None}
    elif isinstance(schedules, Mapping):
        given = schedules
    else:
        raise InvalidInput(
            "the schedules do not say what they move",
            pointer=pointer,
            hint=f"give them by drive: {shown_names(aircraft.drives) or 'the aircraft has none'}",
        )
    return {name: (key, given[key]) for name, key in _resolved(aircraft, given, pointer).items()}


def followed_flight(aircraft: Aircraft, flight: Trajectory, pointer: str = "") -> Followed:
    """Find out which measured angles each drive follows: as `followed_schedules`, and no drive is left alone.

    Columns beside, of which a file may have many, count where they bear the name of a drive or a word.
    """
    words = {drive.word for drive in aircraft.drives.values()}
    measured = dict(flight.drives)
    for name, values in flight.extra.items():
        if (name in aircraft.drives or name in words) and name not in measured:
            measured[name] = values
    keys = _resolved(aircraft, measured, pointer)
    if aircraft.drives and not keys:
        raise InvalidInput(
            f"{flight.name!r} moves no drive of the aircraft: it has "
            f"{', '.join([*flight.drives, *flight.extra]) or 'no angles of drives'}",
            pointer=pointer,
            hint=f"its drives are {shown_names(aircraft.drives)}",
        )
    return {name: (key, Tabulated(flight.time_s, measured[key])) for name, key in keys.items()}


def hinge_schedules(aircraft: Aircraft, followed: Followed) -> list[Schedule]:
    """Return the schedule of every hinge, in the aircraft's order; where nothing moves it, its held angle."""
    return [
        followed[hinge.drive][1] if hinge.drive in followed else Hold(hinge.angle_rad)
        for hinge in aircraft.hinges
    ]


def require_ranges(aircraft: Aircraft, followed: Followed, times_s: np.ndarray, pointer: str) -> None:
    """Raise InvalidInput where a drive is taken beyond the range of one of its hinges at times (k,), s."""
    for surface in aircraft.surfaces:
        for hinge in surface.hinges:
            if hinge.drive not in followed:
                continue
            key, schedule = followed[hinge.drive]
            angle = schedule.motion(times_s).angle
            outside = hinge.beyond_range(angle)
            if outside.size:
                row = outside[0]
                raise InvalidInput(
                    f"the hinge {hinge.drive} of {surface.name} is driven to {angle[row]:.4g} rad at "
                    f"t = {times_s[row]:.3f} s, beyond its range {hinge.min_rad:g}..{hinge.max_rad:g} rad",
                    pointer=f"{pointer}/{key}",
                    hint="lower the angles, or widen the hinge's range; a spline can go beyond its knots",
                )


def _resolved(aircraft: Aircraft, keys: Iterable[str], pointer: str) -> dict[str, str]:
    found, faults = resolved(keys, aircraft.drives)
    refuse(fault.under(pointer) for fault in faults)
    return found
