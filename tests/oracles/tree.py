"""The kinematic tree of one aircraft model: constant, read-only.

Bodies are numbered from the fuselage (0) outward, every body after its parent. Body b > 0 hangs on a revolute
joint about one coordinate axis of its own frame: a *prescribed* one (a hinge of known motion) or a *free* one
(one axis of a gimbal, with stiffness and damping). A gimbal is three bodies in a row: flap (x), torsion (y),
lag (z), of which only the last has mass. Frames follow Featherstone (2008), chapter 4: body frames coincide
with the parent's, moved by ``offset``, when all joint coordinates are zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from morphcore.frames import skew

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

FLAP, TORSION, LAG = 0, 1, 2  # coordinate axes of a gimbal joint, in order from parent to child


@dataclass(frozen=True)
class Tree:
    """A fuselage (body 0, free in six degrees) with revolute branches.

    Attributes (b bodies, n free joint coordinates, m hinges)
    ----------
    parent : (b,) parent body; -1 for the base.
    axis : (b,) coordinate axis 0, 1, 2 of the joint; -1 for the base.
    sign : (b,) +1 or -1: the right-handed rotation about the axis is ``sign`` times the joint coordinate.
    offset_P : (b, 3) joint position from the parent's origin, in the parent's axes, m.
    inertia : (b, 6, 6) spatial inertia at the body's origin in its own axes, angular part first.
    coordinate : (b,) index into the free joint coordinates, or -1.
    hinge : (b,) index into the prescribed hinges, or -1.
    stiffness, damping : (n,) of the free coordinates, N m/rad and N m s/rad.
    """

    parent: IntArray
    axis: IntArray
    sign: Array
    offset_P: Array
    inertia: Array
    coordinate: IntArray
    hinge: IntArray
    stiffness: Array
    damping: Array

    def __post_init__(self) -> None:
        for array in vars(self).values():
            array.setflags(write=False)

    @property
    def bodies(self) -> int:
        """Number of bodies, fuselage and massless gimbal frames included."""
        return int(self.parent.size)

    @property
    def coordinates(self) -> int:
        """Number of free joint coordinates."""
        return int(self.stiffness.size)

    @property
    def hinges(self) -> int:
        """Number of prescribed hinges."""
        return int(self.hinge.max(initial=-1)) + 1


def spatial_inertia(mass: float, centre: Array, inertia_centre: Array) -> Array:
    """Spatial inertia (6, 6) at a body's origin.

    Featherstone (2008), equation 2.63: mass in kg, centre of mass (3,) in m from the origin, rotational
    inertia (3, 3) in kg m^2 about the centre of mass; angular part first.
    """
    cross = skew(centre)
    return np.block(
        [[inertia_centre + mass * cross @ cross.T, mass * cross], [mass * cross.T, mass * np.eye(3)]]
    )
