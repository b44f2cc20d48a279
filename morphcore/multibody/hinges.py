"""Relative motion across the hinges of a surface: their screws, twists and accelerations composed.

Motion vectors have the angular part first, in W at a point of the surface. The parts between two hinges have
no mass, so a surface needs only the sum of its hinges' motions (Featherstone 2008, section 9.2): the cost to
the batch is that of one joint, whatever their number.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from morphcore.geometry.hinge import UPRIGHT, Hinge

Array = NDArray[np.float64]


def relative_motion(
    hinges: Sequence[Hinge],
    arms: Array,
    angles: Array,
    rates: Array,
    accelerations: Array,
    rest: Array = UPRIGHT,
) -> tuple[Array, Array]:
    """Twist of a surface relative to the fuselage, and its time derivative in W.

    From the fuselage outward, hinge by hinge: ``v_i = X v_(i-1) + S qd``, ``a_i = X a_(i-1) + (X v_(i-1)) x S
    qd + S qdd`` (Featherstone 2008, table 5.1, for a base at rest); the middle term is the Coriolis term
    between hinges.

    Parameters
    ----------
    hinges : sequence of Hinge
        m hinges from the fuselage outward.
    arms : ndarray, shape (m, 3)
        From each hinge to the point of the surface, at rest, m; see `hinge_arms`.
    angles, rates, accelerations : ndarray, shape (k, m)
        rad, rad/s, rad/s^2.
    rest : ndarray, shape (3, 3)
        Rotation of the surface with all hinges at rest, W to B.

    Returns
    -------
    twist, acceleration : ndarray, shape (k, 6)
        Angular and linear part, rad/s and m/s, rad/s^2 and m/s^2.
    """
    twist, acceleration = np.zeros((2, angles.shape[0], 6))
    for place, (hinge, arm) in enumerate(zip(hinges, arms, strict=False)):
        screw = _screw(hinge, arm)
        own = screw * rates[:, place, None]
        change = screw * accelerations[:, place, None]
        if place == 0:
            twist, acceleration = own, change
            continue
        turn = hinge.rotation(angles[:, place])
        shift = hinge.moved(angles[:, place], turn, arm) - arm
        twist = _carried(turn, shift, twist)
        acceleration = _carried(turn, shift, acceleration) + _cross(twist, own) + change
        twist = twist + own
    return _in_wing_axes(rest, twist), _in_wing_axes(rest, acceleration)


def hinge_screws(hinges: Sequence[Hinge], arms: Array, angles: Array, rest: Array = UPRIGHT) -> Array:
    """Twist (k, m, 6) of a surface for a unit rate of each of its hinges, in W at a point of it.

    ``rest`` as in `relative_motion`.
    """
    out = np.empty((angles.shape[0], len(hinges), 6))
    for place, (hinge, arm) in enumerate(zip(hinges, arms, strict=False)):
        turn = hinge.rotation(angles[:, place])
        shift = hinge.moved(angles[:, place], turn, arm) - arm
        for inner in range(place):
            out[:, inner] = _carried(turn, shift, out[:, inner])
        out[:, place] = _screw(hinge, arm)
    return _in_wing_axes(rest, out)


def _in_wing_axes(rest: Array, motion: Array) -> Array:
    """Motion vectors (..., 6) in W from those in axes that are parallel to B with all hinges at rest."""
    return np.concatenate([motion[..., :3] @ rest, motion[..., 3:] @ rest], axis=-1)


def _screw(hinge: Hinge, arm: Array) -> Array:
    """Twist (6,) of the parts outboard of a hinge for its unit rate, at a point ``arm`` from its axis."""
    if hinge.prismatic:
        return np.concatenate([np.zeros(3), hinge.axis_B])
    return np.concatenate([hinge.axis_B, np.cross(hinge.axis_B, arm)])


def _carried(turn: Array, shift: Array, motion: Array) -> Array:
    """Motion vectors (k, 6) of the parts inboard of a hinge, transformed to its outboard frame.

    turn : (k, 3, 3) of the hinge. shift : (k, 3) by which it has moved the outer frame's origin: both frames
    have theirs at the same point at rest.
    """
    angular, linear = motion[:, :3], motion[:, 3:]
    moved = linear + np.cross(angular, shift)
    return np.concatenate([np.einsum("kji,kj->ki", turn, part) for part in (angular, moved)], axis=1)


def _cross(first: Array, second: Array) -> Array:
    """Motion cross product (k, 6); Featherstone (2008), equation 2.31."""
    angular = np.cross(first[:, :3], second[:, :3])
    linear = np.cross(first[:, :3], second[:, 3:]) + np.cross(first[:, 3:], second[:, :3])
    return np.concatenate([angular, linear], axis=1)
