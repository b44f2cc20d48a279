"""The slope of a chain's sections, twist less zero-lift angle, as part of the motion of its links."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from morphcore.models.equivalent import ChainModel, ParameterBatch
from morphcore.models.links import link_edges, twist_slopes

Array = NDArray[np.float64]


def sloped_motion(model: ChainModel, batch: ParameterBatch, R_BL: Array, air_B: Array) -> Array:
    """Motion (v_z, omega_x, omega_y) of all links that drives their circulation, without rotation.

    Parameters
    ----------
    model : ChainModel
    batch : ParameterBatch
        Of p particles.
    R_BL : ndarray, shape (p, links, 3, 3)
        Link to body components.
    air_B : ndarray, shape (p, 3)
        Velocity of the aircraft through the air in B, m/s.

    Returns
    -------
    ndarray, shape (p, links, 3)
        In link axes, m/s and rad/s; the slope is in the first two as in `aero.kernels.loads.sloped`.
    """
    motion = np.zeros((*R_BL.shape[:2], 3))
    motion[..., 0] = np.einsum("pka,pa->pk", R_BL[..., 2], air_B)
    for s, surface in enumerate(model.aircraft.surfaces):
        zero_lift = _zero_lift(model, batch, s)
        if not (surface.twist_rad or zero_lift.any()):
            continue
        first, count = int(model.surfaces[s, 0]), int(model.surfaces[s, 1])
        slopes = twist_slopes(surface, link_edges(_division(model, batch, s), surface.length_m))
        mine = slice(first, first + count)
        chord = surface.chord_W
        forward = np.einsum("pkac,c,pa->pk", R_BL[:, mine], chord, air_B)
        motion[:, mine, 0] += (slopes[..., 0] - zero_lift[:, None]) * forward
        motion[:, mine, 1] += slopes[..., 1] * forward
        motion[:, mine, 2] += chord[1] / chord[0] * slopes[..., 1] * forward
    return motion


def sloped_turn(
    model: ChainModel, batch: ParameterBatch, poses: tuple[Array, Array], air_B: Array, omega_B: Array
) -> Array:
    """The same of an aircraft that rotates as one with its wings.

    Parameters
    ----------
    poses : R_BL (p, links, 3, 3) link to body components, and r_B (p, links, 3) link origins in B, m.
    omega_B : ndarray, shape (p, 3)
        In B, rad/s. Others as in `sloped_motion`.
    """
    R_BL, r_B = poses
    velocity = np.einsum("pkac,pka->pkc", R_BL, air_B[:, None] + np.cross(omega_B[:, None], r_B))
    turn = np.einsum("pkac,pa->pkc", R_BL, omega_B)
    motion = np.concatenate([velocity[..., 2:], turn[..., :2]], axis=-1)
    for s, surface in enumerate(model.aircraft.surfaces):
        mine = slice(int(model.surfaces[s, 0]), int(model.surfaces[s, :2].sum()))
        slopes = twist_slopes(surface, link_edges(_division(model, batch, s), surface.length_m))
        zero_lift, chord = _zero_lift(model, batch, s)[:, None], surface.chord_W
        forward = velocity[:, mine, :2] @ chord[:2]
        raised = slopes[..., 1] * forward + (slopes[..., 3] + chord[0] * zero_lift) * turn[:, mine, 2]
        motion[:, mine, 0] += (slopes[..., 0] - zero_lift) * forward + slopes[..., 2] * turn[:, mine, 2]
        motion[:, mine, 1] += raised
        motion[:, mine, 2] += chord[1] / chord[0] * raised
    return motion


def _division(model: ChainModel, batch: ParameterBatch, number: int) -> Array:
    """Shares (p, n) of one surface's span that its links have."""
    if model.surfaces[number, 1] == 1:
        return np.ones((batch.particles, 1))
    return np.asarray(batch.of_set("division", model.set_of(batch)[number]))


def _zero_lift(model: ChainModel, batch: ParameterBatch, number: int) -> Array:
    """Zero-lift angle (p,) of one surface, rad: the batch's, or its own."""
    surface, known = model.aircraft.surfaces[number], batch.values.get("zero_lift_rad")
    if surface.flexible and known is not None:
        return np.asarray(known[:, model.set_of(batch)[number]])
    return np.full(batch.particles, surface.zero_lift_rad)
