"""Hinges in the form used by the numerics: an axis on the fuselage, and the composition of several motions.

The pose of a surface on hinges 1..m, counted from the fuselage outward, is ``E_1 E_2 .. E_m`` applied to its
pose at rest, each ``E_i`` a turn about the axis of hinge i at rest, or a shift along it (the product of
exponentials; Murray, Li & Sastry 1994, section 3.2). So each hinge moves all hinges outboard of it and the
surface.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from morphcore.frames import skew
from morphcore.geometry.moved_part import MovedPart
from morphdata import drives as documents
from morphdata.drives import drive_name

Array = NDArray[np.float64]
Vector = tuple[float, float, float]

UPRIGHT: Array = np.eye(3)  # a surface whose axes are those of the body
UPRIGHT.setflags(write=False)


@dataclass(frozen=True)
class Hinge(MovedPart):
    """A joint of prescribed motion; hinges that move alike are equal, whatever their drives.

    Attributes
    ----------
    drive : str
        Name of the drive that turns it.
    position_m : tuple of float
        A point of its axis, all hinges at rest, relative to the fuselage reference point, in B.
    axis_B : tuple of float
        Unit vector of its axis, all hinges at rest; a positive angle is a right-handed turn about it, a
        positive extension a shift along it.
    min_rad, max_rad : float
        Range of its angle, rad, or of its extension, m.
    angle_rad : float
        Angle or extension held if no history is given.
    prismatic : bool
        Whether it slides, and does not turn.
    """

    drive: str = field(compare=False)
    position_m: Vector
    axis_B: Vector
    min_rad: float
    max_rad: float
    angle_rad: float = field(compare=False)
    prismatic: bool = False

    @classmethod
    def of(cls, document: documents.Hinge, side: str, line_B: Vector | None = None) -> Hinge:
        """Return the hinge that a document describes, for a surface on a given side with its span's line."""
        x, y, z = document.position_m
        return cls(
            drive=drive_name(document, side),
            position_m=(x, y, z),
            axis_B=document.axis_B(side, line_B),
            min_rad=document.low,
            max_rad=document.high,
            angle_rad=document.held,
            prismatic=document.is_prismatic,
        )

    @property
    def unit(self) -> documents.Unit:
        """Of its history."""
        return "m" if self.prismatic else "rad"

    def rotation(self, angle_rad: Array) -> Array:
        """Turns about the axis by angles (k,), (k, 3, 3): Rodrigues' formula; none if it slides."""
        if self.prismatic:
            return np.tile(UPRIGHT, (angle_rad.size, 1, 1))
        along = np.outer(self.axis_B, self.axis_B)
        cosine, sine = np.cos(angle_rad)[:, None, None], np.sin(angle_rad)[:, None, None]
        return np.asarray(along + cosine * (np.eye(3) - along) + sine * skew(self.axis_B))

    def moved(self, angle_rad: Array, turn: Array, from_axis: Array) -> Array:
        """Where points outboard of it are, from its position, (k, 3), m.

        turn : (k, 3, 3) of the hinge. from_axis : (3,) or (k, 3) from its position before it moves.
        """
        if self.prismatic:
            return np.asarray(from_axis + angle_rad[:, None] * np.array(self.axis_B))
        if from_axis.ndim == 1:
            return np.asarray(turn @ from_axis)
        return np.asarray(np.einsum("kij,kj->ki", turn, from_axis))

    @property
    def reflection(self) -> Hinge:
        """Its mirror image about the x-z plane, which the same angle moves to the mirrored position."""
        (x, y, z), (ax, ay, az) = self.position_m, self.axis_B
        axis = (ax, -ay, az) if self.prismatic else (-ax, ay, -az)
        return replace(self, position_m=(x, -y, z), axis_B=axis)


def hinge_arms(hinges: Sequence[Hinge], root_B: Array, offset: Array | None = None) -> Array:
    """Vectors (m, 3), m, from each hinge (or, without hinges, the reference point) to a point at rest.

    The point is ``root_B`` (3,), shifted by ``offset`` (3,) if given.
    """
    pivots = np.array([hinge.position_m for hinge in hinges] or [(0.0, 0.0, 0.0)])
    arms = root_B - pivots
    return np.asarray(arms if offset is None else arms + offset)


def hinged_pose(
    hinges: Sequence[Hinge], arms: Array, angles: Array, rest: Array = UPRIGHT
) -> tuple[Array, Array]:
    """Pose of a surface for angles (k, m) of its m hinges; ``arms`` from `hinge_arms`.

    ``rest`` (3, 3) is its rotation with all hinges at rest, wing components to body components.

    Returns
    -------
    R_BW : (k, 3, 3), wing components to body components.
    r_B : (k, 3) position of the arms' end point, m.
    """
    count = angles.shape[0]
    if not hinges:
        return np.tile(rest, (count, 1, 1)), np.tile(arms[0], (count, 1))
    # surface -> fuselage: each hinge moves everything outboard of it
    pivot = np.array(hinges[-1].position_m)
    R_BW = hinges[-1].rotation(angles[:, -1])
    r_B = pivot + hinges[-1].moved(angles[:, -1], R_BW, arms[-1])
    for place in range(len(hinges) - 2, -1, -1):
        pivot, turn = np.array(hinges[place].position_m), hinges[place].rotation(angles[:, place])
        R_BW = turn @ R_BW
        r_B = pivot + hinges[place].moved(angles[:, place], turn, r_B - pivot)
    return R_BW @ rest, r_B
