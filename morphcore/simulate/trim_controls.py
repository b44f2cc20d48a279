"""The drives that balance the moments of a trim, and their schedules from there.

`flight.trim_drive` balances the pitching moment, `flight.roll_trim_drive` and `flight.yaw_trim_drive` the
others. "auto" takes the aircraft's own controls for roll and yaw, in asymmetric flights alone: symmetric ones
need none.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.geometry.control import Control
from morphcore.geometry.surface import Surface
from morphdata.drives import without_side

UPRIGHT_RAD = 1.0  # dihedral from which a surface is a fin
MIN_AUTHORITY = 1e-6  # 1/rad, slope of the moment's coefficient: below it the drive moves no lifting surface
ROLL, PITCH, YAW = 0, 1, 2  # components of the moment in B
MOMENTS = ("rolling", "pitching", "yawing")
FIELDS = ("roll_trim_drive", "trim_drive", "yaw_trim_drive")


@dataclass(frozen=True)
class TrimControl:
    """A drive, or a word for several, that balances one component of the moment.

    axis : of B. columns : of the schedules that it moves. low, high : range of its angle, rad.
    """

    axis: int
    name: str
    columns: NDArray[np.int64]
    low: float
    high: float

    @property
    def pointer(self) -> str:
        """JSON pointer of the field that names it."""
        return f"/flight/{FIELDS[self.axis]}"


def trim_controls(aircraft: Aircraft, flight: Flight) -> tuple[TrimControl, ...]:
    """The drives that balance moments in a flight: that of pitch first, then those of roll and yaw.

    Raises
    ------
    InvalidInput
        The aircraft has no such drive, or one drive would balance two moments.
    """
    found: list[TrimControl] = []
    taken: dict[int, str] = {}
    for axis, given in (
        (PITCH, flight.trim_drive),
        (ROLL, flight.roll_trim_drive),
        (YAW, flight.yaw_trim_drive),
    ):
        name = given
        if given == "auto":
            name = own_control(aircraft, axis, taken) if flight.is_asymmetric else None
        if name is None:
            continue
        control = _named(aircraft, axis, name)
        former = [taken[k] for k in control.columns.tolist() if k in taken]
        if former:
            raise InvalidInput(
                f"the drive {name!r} cannot balance the {MOMENTS[axis]} moment too",
                pointer=control.pointer,
                hint=f"it is the flight's {former[0]}: name another, or null for a constant moment",
            )
        taken |= dict.fromkeys(control.columns.tolist(), FIELDS[axis])
        found.append(control)
    return tuple(found)


def _named(aircraft: Aircraft, axis: int, name: str) -> TrimControl:
    drives = aircraft.drives
    meant = {
        each.name: each
        for each in drives.values()
        if name == each.name or (name not in drives and name == without_side(each.name))
    }
    if not meant:
        raise InvalidInput(
            f"the aircraft has no drive {name!r} to trim with",
            pointer=f"/flight/{FIELDS[axis]}",
            hint=f"its drives are {', '.join(drives)}"
            if drives
            else f"it has no drives: omit {FIELDS[axis]}",
        )
    columns = [k for k, part in enumerate(aircraft.moved_parts) if part.drive in meant]
    low, high = max(each.low for each in meant.values()), min(each.high for each in meant.values())
    return TrimControl(axis, name, np.array(columns, dtype=np.int64), low, high)


def own_control(aircraft: Aircraft, axis: int, taken: Collection[int] = ()) -> str | None:
    """The word of the aircraft's first control for roll or yaw; None if it has none that is not taken.

    Ailerons move the trailing edges of both sides against each other. A rudder is on a fin; on a pair of
    fins, too, it moves the trailing edges against each other.
    """
    words: dict[str, list[tuple[int, Surface, Control]]] = {}
    column = len(aircraft.hinges)
    for surface in aircraft.surfaces:
        for control in surface.controls:
            words.setdefault(without_side(control.drive), []).append((column, surface, control))
            column += 1
    for word, parts in words.items():
        fins = all(abs(surface.dihedral_rad) >= UPRIGHT_RAD for _, surface, _ in parts)
        opposed = any(control.sign < 0.0 for _, _, control in parts)
        alone = len({surface.side for _, surface, _ in parts}) == 1
        if (
            fins == (axis == YAW)
            and (opposed or (fins and alone))
            and not {k for k, _, _ in parts} & {*taken}
        ):
            return word
    return None


def no_authority(control: TrimControl, angle_rad: float, moment: float) -> InvalidInput:
    """The error of a trim drive that cannot balance its moment: at an angle some is left, N m."""
    remedy = "move the centre of mass, " if control.axis == PITCH else ""
    otherwise = "omit trim_drive" if control.axis == PITCH else f"set {FIELDS[control.axis]} to null"
    return InvalidInput(
        f"the drive {control.name!r} cannot balance the {MOMENTS[control.axis]} moment: at "
        f"{angle_rad:.4g} rad {moment:.4g} N m are left",
        pointer=control.pointer,
        hint=f"its authority is too small: widen the range of its hinges or controls, {remedy}enlarge the "
        f"surface or its arm, or {otherwise} to trim by a constant moment",
    )
