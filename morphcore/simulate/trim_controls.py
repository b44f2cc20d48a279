"""The drives that balance the moments of a trim, and their schedules from there.

`flight.trim_drive` balances the pitching moment, `flight.roll_trim_drive` and `flight.yaw_trim_drive` the
others. "auto" takes the aircraft's own controls for roll and yaw, in asymmetric flights alone: symmetric ones
need none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Aircraft, Flight
from morphdata.trim_drives import PITCH, ROLL, YAW, ControlPart, balancing, meant

MIN_AUTHORITY = 1e-6  # 1/rad, slope of the moment's coefficient: below it the drive moves no lifting surface
FIELDS = (ROLL, PITCH, YAW)  # by component of the moment in B
MOMENTS = ("rolling", "pitching", "yawing")


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
    """The drives that balance moments in a flight: those named, then the aircraft's own.

    Raises
    ------
    InvalidInput
        The aircraft has no such drive, or one drive would balance two moments.
    """
    parts = [
        ControlPart(control.drive, surface.side, surface.dihedral_rad, control.sign)
        for surface in aircraft.surfaces
        for control in surface.controls
    ]
    given = {field: getattr(flight, field) for field in FIELDS}
    chosen = balancing(given, aircraft.drives, parts, asymmetric=flight.is_asymmetric)
    taken: dict[str, str] = {}
    return tuple(_control(aircraft, field, name, taken) for field, name in chosen.items())


def _control(aircraft: Aircraft, field: str, name: str, taken: dict[str, str]) -> TrimControl:
    """A control from its field and name; ``taken`` : fields by the drives of those before, in place."""
    axis, drives = FIELDS.index(field), aircraft.drives
    names = meant(name, drives)
    if not names:
        raise InvalidInput(
            f"the aircraft has no drive {name!r} to trim with",
            pointer=f"/flight/{field}",
            hint=f"its drives are {', '.join(drives)}" if drives else f"it has no drives: omit {field}",
        )
    for former in (taken[each] for each in names if each in taken):
        raise InvalidInput(
            f"the drive {name!r} cannot balance the {MOMENTS[axis]} moment too",
            pointer=f"/flight/{field}",
            hint=f"it is the flight's {former}: name another drive",
        )
    taken |= dict.fromkeys(names, field)
    columns = [k for k, part in enumerate(aircraft.moved_parts) if part.drive in names]
    low, high = max(drives[each].low for each in names), min(drives[each].high for each in names)
    return TrimControl(axis, name, np.array(columns, dtype=np.int64), low, high)


def no_authority(control: TrimControl, angle_rad: float, moment: float) -> InvalidInput:
    """The error of a trim drive that cannot balance its moment: at an angle some is left, N m."""
    field = FIELDS[control.axis]
    remedy = "move the centre of mass, " if field == PITCH else ""
    otherwise = f"omit {field}" if field == PITCH else f'set {field} to "none"'
    return InvalidInput(
        f"the drive {control.name!r} cannot balance the {MOMENTS[control.axis]} moment: at "
        f"{angle_rad:.4g} rad {moment:.4g} N m are left",
        pointer=control.pointer,
        hint=f"its authority is too small: widen the range of its hinges or controls, {remedy}enlarge the "
        f"surface or its arm, or {otherwise} to trim by a constant moment",
    )
