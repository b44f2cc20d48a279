"""Specific force at points of the aircraft: what accelerometers there measure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from morphcore.geometry.point_mass import PointMass
from morphcore.geometry.surface import Surface
from morphdata.points import Point as PointDocument

Array = NDArray[np.float64]

ACROSS = np.array([1.0, -1.0, 1.0])  # reflection about the x-z plane


@dataclass(frozen=True)
class Point:
    """A point at which specific force is requested.

    name : its part of column names. surface : name of the surface that carries it, None for the fuselage.
    position_B : (3,) m on the fuselage. at : share of the span on a surface. aft_m, up_m : of mid-chord
    there, along the surface's own axes.
    """

    name: str
    surface: str | None
    position_B: tuple[float, float, float] = (0.0, 0.0, 0.0)
    at: float = 0.0
    aft_m: float = 0.0
    up_m: float = 0.0

    def arm_W(self, surface: Surface, distance_m: float) -> Array:
        """The point (3,) in W from a surface's elastic axis at a distance from the root, unbent, m."""
        place = PointMass(self.at, 0.0, self.aft_m, self.up_m, (0.0,) * 9)
        return surface.point_mass_arm_W(place, distance_m)


def points_of(documents: Sequence[PointDocument]) -> tuple[Point, ...]:
    """The points that documents, which have been checked, describe."""
    found = []
    for each in documents:
        aft, up = each.offset_m or [0.0, 0.0]
        x, y, z = each.position_m or [0.0, 0.0, 0.0]
        found.append(Point(each.name, each.surface, (x, y, z), each.at or 0.0, aft, up))
    return tuple(found)


def specific_force(arm: Array, twist: Array, acceleration: Array) -> Array:
    """Specific force (k, 3) at a point of a body, in its axes, m/s^2.

    f = v' + omega x v + omega' x r + omega x (omega x r), of rates relative to free fall.

    Parameters
    ----------
    arm : ndarray, shape (3,)
        r, from the body's origin, m.
    twist, acceleration : ndarray, shape (k, 6)
        Of the body at its origin, in its own axes, and the time derivative of these components, gravity
        subtracted (Featherstone (2008), section 2.11).
    """
    omega, linear = twist[:, :3], twist[:, 3:] + np.cross(twist[:, :3], arm)
    return np.asarray(acceleration[:, 3:] + np.cross(acceleration[:, :3], arm) + np.cross(omega, linear))
