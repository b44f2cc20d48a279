"""Attitude and channels in the axes of MorphID: earth NED, body FRD; from quaternions and from other axes.

Diebel (2006), "Representing attitude": the matrix of z-y-x Euler angles (eq. 289, transposed) and of a unit
quaternion (eq. 125, transposed), both turning body axes into earth axes.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from morphdata.channels import channel_of

Earth = Literal["NED", "ENU"]
Body = Literal["FRD", "FLU"]
EULER = ("phi", "theta", "psi")
QUATERNION = ("qw", "qx", "qy", "qz")
NORM_TOLERANCE = 0.02  # of a measured unit quaternion: single precision and interpolation stay far below
ENU_AS_NED = {"x": "y", "y": "x", "vx": "vy", "vy": "vx"}  # a column along east is `y` here
DOWN = frozenset({"z", "vz"})  # channels along the third axis of the earth
# channels along the second and third axis of the body; nz is upward in either
ACROSS = frozenset({"q", "r", "fy", "fz", "ny", "tip_left_z", "tip_right_z", "tip_z"})

# the first column of a rotation matrix from body to earth, and the last two of its third row: what Euler
# angles are made of
_Entries = tuple[float, float, float, float, float]


@dataclass(frozen=True)
class Frames:
    """Axes in which attitude and channels are given.

    Attributes
    ----------
    earth : {"NED", "ENU"}
        North, east, down; or east, north, up.
    body : {"FRD", "FLU"}
        Forward, right, down; or forward, left, up.
    """

    earth: Earth = "NED"
    body: Body = "FRD"


HERE = Frames()


def quaternion_fault(quaternion: Sequence[float]) -> str | None:
    """What is wrong with a quaternion of a row, for people; None where it is a unit quaternion."""
    norm = math.hypot(*quaternion)
    if abs(norm - 1.0) <= NORM_TOLERANCE:
        return None
    return f"the quaternion has the norm {norm:.4g}, not 1"


def euler_of_quaternions(
    rows: Iterable[Sequence[float]], frames: Frames = HERE
) -> tuple[array[float], array[float], array[float]]:
    """Roll, pitch and yaw, rad, from FRD to NED, of unit quaternions (w, x, y, z).

    Parameters
    ----------
    rows : iterable of sequence of float
        Rotations from `frames.body` to `frames.earth`: ``v_earth = q v_body q*``.
    frames : Frames
        Their axes.

    Examples
    --------
    >>> half = math.sqrt(0.5)
    >>> phi, theta, psi = euler_of_quaternions([(half, 0.0, 0.0, half)])
    >>> round(math.degrees(psi[0]), 9)
    90.0
    """
    return _angles(map(_quaternion_entries, rows), frames)


def euler_in_ned(
    rows: Iterable[Sequence[float]], frames: Frames
) -> tuple[array[float], array[float], array[float]]:
    """Roll, pitch and yaw, rad, from FRD to NED, of z-y-x angles between other axes.

    Examples
    --------
    >>> phi, theta, psi = euler_in_ned([(0.1, -0.2, 0.3)], Frames("ENU", "FLU"))
    >>> round(phi[0], 9), round(theta[0], 9), round(psi[0] + 0.3 - math.pi / 2, 9)
    (0.1, 0.2, 0.0)
    """
    return _angles(map(_euler_entries, rows), frames)


def channel_in_here(column: str, frames: Frames) -> tuple[str, float]:
    """Column of a channel between MorphID's axes, and the sign of its values, for one in other axes.

    Examples
    --------
    >>> channel_in_here("vx", Frames(earth="ENU")), channel_in_here("q", Frames(body="FLU"))
    (('vy', 1.0), ('q', -1.0))
    """
    sign = 1.0
    facts = channel_of(column)
    if frames.earth == "ENU":
        sign = -1.0 if column in DOWN else 1.0
        column = ENU_AS_NED.get(column, column)
    if frames.body == "FLU" and facts is not None and facts.name in ACROSS:
        sign = -1.0
    return column, sign


def channels_in_here(channels: Mapping[str, array[float]], frames: Frames) -> dict[str, array[float]]:
    """Columns of channels between MorphID's axes, of such in other axes."""
    found = {}
    for column, values in channels.items():
        name, sign = channel_in_here(column, frames)
        found[name] = values if sign == 1.0 else array("d", (sign * value for value in values))
    return found


def _quaternion_entries(quaternion: Sequence[float]) -> _Entries:
    norm = math.hypot(*quaternion)
    w, x, y, z = (component / norm for component in quaternion)
    return (
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y + w * z),
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    )


def _euler_entries(angles: Sequence[float]) -> _Entries:
    phi, theta, psi = angles
    level = math.cos(theta)
    return (
        level * math.cos(psi),
        level * math.sin(psi),
        -math.sin(theta),
        math.sin(phi) * level,
        math.cos(phi) * level,
    )


def _angles(entries: Iterable[_Entries], frames: Frames) -> tuple[array[float], array[float], array[float]]:
    across = -1.0 if frames.body == "FLU" else 1.0
    turned: Callable[[_Entries], _Entries] = _ned_of_enu if frames.earth == "ENU" else _same
    rows = [
        (math.atan2(across * r32, across * r33), -math.asin(max(-1.0, min(1.0, r31))), math.atan2(r21, r11))
        for r11, r21, r31, r32, r33 in map(turned, entries)
    ]
    phi, theta, psi = zip(*rows, strict=True) if rows else ((), (), ())
    return array("d", _unwrapped(phi)), array("d", theta), array("d", _unwrapped(psi))


def _same(entries: _Entries) -> _Entries:
    return entries


def _ned_of_enu(entries: _Entries) -> _Entries:
    r11, r21, r31, r32, r33 = entries
    return r21, r11, -r31, -r32, -r33


def _unwrapped(angles: Iterable[float]) -> Iterator[float]:
    """Angles without jumps of full turns."""
    before = None
    for angle in angles:
        if before is not None:
            angle -= math.tau * round((angle - before) / math.tau)  # noqa: PLW2901
        before = angle
        yield angle
