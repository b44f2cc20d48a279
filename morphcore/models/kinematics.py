"""Positions of the links, for the static start, the tip positions and a new lattice."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.bent_shape import BentShape, BentSurface
from morphcore.models.equivalent import ChainModel, ParameterBatch
from morphcore.models.links import link_edges
from morphcore.multibody.kernels.hinge import H_ORIGIN, HINGE_ROWS

Array = NDArray[np.float64]


# flap and edgewise angle of a gimbal change sign in the mirror image, torsion does not
REFLECTED_GIMBAL = np.array([-1.0, 1.0, -1.0])


def whole_joints(model: ChainModel, q_joint: Array) -> Array:
    """Joint coordinates (k, coordinates) of a symmetric aircraft from those of its half, rad."""
    mirror, half = model.mirror, model.half
    assert mirror is not None  # noqa: S101 - joints of a half come from a model that has one
    assert half is not None  # noqa: S101
    out = np.empty((q_joint.shape[0], model.joints, 3))
    own = q_joint.reshape(q_joint.shape[0], half.joints, 3)
    first_own, first = _first_joints(half), _first_joints(model)
    for number, (mine, image) in enumerate(zip(mirror.own, mirror.image, strict=True)):
        count = int(half.surfaces[number, 1]) - 1
        angles = own[:, first_own[number] : first_own[number] + count]
        out[:, first[mine] : first[mine] + count] = angles
        out[:, first[image] : first[image] + count] = REFLECTED_GIMBAL * angles
    return out.reshape(q_joint.shape[0], -1)


def _first_joints(model: ChainModel) -> NDArray[np.int64]:
    """(s,) number of each surface's first gimbal."""
    return np.asarray(model.surfaces[:, 0] - np.arange(model.surfaces.shape[0]))


def gimbal_rotation(angles: Array) -> Array:
    """Rotation (..., 3, 3) link to parent of gimbal angles (..., 3): Rx(flap) Ry(torsion) Rz(edgewise)."""
    (s1, s2, s3), (c1, c2, c3) = np.moveaxis(np.sin(angles), -1, 0), np.moveaxis(np.cos(angles), -1, 0)
    rows = [
        [c2 * c3, -c2 * s3, s2],
        [c1 * s3 + s1 * s2 * c3, c1 * c3 - s1 * s2 * s3, -s1 * c2],
        [s1 * s3 - c1 * s2 * c3, s1 * c3 + c1 * s2 * s3, c1 * c2],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def link_poses(
    model: ChainModel, batch: ParameterBatch, hinges: Array, q_joint: Array
) -> tuple[Array, Array]:
    """Poses of all links for particles p.

    Parameters
    ----------
    hinges : (s, HINGE_ROWS) of one instant. q_joint : (p, coordinates) rad.

    Returns
    -------
    R_BL : (p, links, 3, 3) link to body components. r_B : (p, links, 3) link origins in B, m.
    """
    particles = q_joint.shape[0]
    R_BL = np.empty((particles, model.links, 3, 3))
    r_B = np.empty((particles, model.links, 3))
    joint, chosen = 0, model.set_of(batch)
    for s, surface in enumerate(model.aircraft.surfaces):
        first, count = int(model.surfaces[s, 0]), int(model.surfaces[s, 1])
        R_BL[:, first] = hinges[s, :9].reshape(3, 3)
        r_B[:, first] = hinges[s, H_ORIGIN:]
        lengths = np.zeros((particles, 0))
        if surface.flexible:
            edges = link_edges(batch.of_set("division", chosen[s]), surface.length_m)
            lengths = surface.span_sign * np.diff(edges, axis=1)
        for k in range(1, count):
            link = first + k
            parent = R_BL[:, link - 1]
            r_B[:, link] = r_B[:, link - 1] + parent[:, :, 1] * lengths[:, k - 1, None]
            R_BL[:, link] = parent @ gimbal_rotation(q_joint[:, 3 * joint : 3 * joint + 3])
            joint += 1
    return R_BL, r_B


def level_hinges(model: ChainModel) -> Array:
    """Hinges (s, HINGE_ROWS) at rest in the reference position, so that surfaces stay in wing axes."""
    level = np.zeros((len(model.aircraft.surfaces), HINGE_ROWS))
    level[:, :9] = np.eye(3).ravel()
    return level


def tip_positions(model: ChainModel, batch: ParameterBatch, hinges: Array, q_joint: Array) -> Array:
    """Tips of the elastic axes (p, s, 3) in B relative to each surface's root, m."""
    R_BL, r_B = link_poses(model, batch, hinges, q_joint)
    tips = np.empty((q_joint.shape[0], len(model.aircraft.surfaces), 3))
    chosen = model.set_of(batch)
    for s, surface in enumerate(model.aircraft.surfaces):
        last = int(model.surfaces[s, 0] + model.surfaces[s, 1]) - 1
        length = np.full(q_joint.shape[0], surface.length_m)
        if surface.flexible:
            length = surface.length_m * batch.of_set("division", chosen[s])[:, -1]
        tips[:, s] = (
            r_B[:, last] + R_BL[:, last, :, 1] * (surface.span_sign * length)[:, None] - hinges[s, H_ORIGIN:]
        )
    return tips


def tip_bending(
    model: ChainModel, batch: ParameterBatch, q_joint: Array, shape: BentShape | None = None
) -> Array:
    """Displacement (p, s) of the tips by the joints' angles q_joint (p, coordinates), over the span.

    shape : from which it is measured, that of the lattice; None: unbent.
    """
    level = level_hinges(model)
    bent = tip_positions(model, batch, level, q_joint)
    from_there = tip_positions(model, batch, level, np.zeros_like(q_joint))
    for number, surface in enumerate(shape or ()):
        if surface is not None and model.surfaces[number, 1] > 1:  # a rigid surface does not bend
            from_there[:, number] = surface.tip_W
    spans = np.array([surface.length_m for surface in model.aircraft.surfaces])
    return np.asarray(np.linalg.norm(bent - from_there, axis=2) / spans)


def bent_shape(model: ChainModel, batch: ParameterBatch, q_joint: Array) -> BentShape:
    """The surfaces of one parameter set with its joints at angles (coordinates,), rad, hinges apart."""
    R_WL, r_W = link_poses(model, batch, level_hinges(model), q_joint[None])
    chosen = model.set_of(batch)
    shape: list[BentSurface | None] = []
    for number, (surface, row) in enumerate(zip(model.aircraft.surfaces, model.surfaces, strict=True)):
        mine = slice(int(row[0]), int(row[0] + row[1]))
        if row[1] == 1:
            shape.append(None)
            continue
        edges = link_edges(batch.of_set("division", chosen[number]), surface.length_m)[0]
        shape.append(BentSurface(edges, R_WL[0, mine], r_W[0, mine], surface.span_sign))
    return tuple(shape)
