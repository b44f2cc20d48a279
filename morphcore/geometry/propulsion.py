"""The line of thrust: which constant force and moment a trim's unknowns stand for.

Without a line of thrust, a trim finds a force along the flight path and one across it, at the reference
point, and a moment. With one, the force along the path becomes a thrust along the line, whose moment about
the reference point is part of the balance; the moment that the trim reports remains beyond it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from morphdata import masses as documents

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Propulsion:
    """A line of thrust in B: a point (m) from the reference point, and the unit vector of the force."""

    position_B: tuple[float, float, float]
    direction_B: tuple[float, float, float]

    @classmethod
    def of(cls, document: documents.Propulsion) -> Propulsion:
        """Return the line that a document describes."""
        x, y, z = document.position_m or [0.0, 0.0, 0.0]
        along = np.array(document.direction)
        u, v, w = (along / np.linalg.norm(along)).tolist()
        return cls((x, y, z), (u, v, w))

    @property
    def is_symmetric(self) -> bool:
        """Whether the line lies in the aircraft's x-z plane."""
        return self.position_B[1] == self.direction_B[1] == 0.0


def thrust_direction_B(propulsion: Propulsion | None, alpha: ArrayLike) -> Array:
    """Unit vector (..., 3) of the thrust at angles of attack (...), rad: of the line, or along the path."""
    angle = np.asarray(alpha, dtype=np.float64)
    if propulsion is None:
        return np.stack([np.cos(angle), 0.0 * angle, np.sin(angle)], axis=-1)
    return np.broadcast_to(np.array(propulsion.direction_B), (*angle.shape, 3))


def thrust_force_B(propulsion: Propulsion | None, alpha: Array, thrust: Array, across: Array) -> Array:
    """Constant force (..., 3) of a thrust and a side force along body y, each (...), N."""
    force_B = thrust_direction_B(propulsion, alpha) * np.asarray(thrust)[..., None]
    force_B[..., 1] += across
    return force_B


def thrust_moment_B(propulsion: Propulsion | None, force_B: Array) -> Array:
    """Moment (..., 3) of the thrust about the reference point, N m, from the constant force (..., 3), N.

    The force is that of `thrust_force_B`, so its components in the x-z plane tell the thrust; the side force
    acts at the reference point.
    """
    if propulsion is None:
        return np.zeros_like(force_B)
    line = np.array(propulsion.direction_B)
    along = line * np.array([1.0, 0.0, 1.0])
    thrust = force_B @ along / (along @ along)
    return np.asarray(thrust[..., None] * np.cross(np.array(propulsion.position_B), line))
