"""Tips, loads and points of chains out of their states; what flights report and sensors would read."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from morphcore.models.equivalent import ChainModel, ParameterBatch
from morphcore.models.kinematics import level_hinges, link_poses, tip_positions
from morphcore.models.links import link_edges
from morphcore.simulate.points import ACROSS, Point, specific_force
from morphcore.simulate.surface_loads import SurfaceLoads, section_loads
from morphcore.simulate.torque import ChainLoads

Array = NDArray[np.float64]


def tips_z(model: ChainModel, batch: ParameterBatch, hinges: Array, q_joint: Array) -> Array:
    """Tips below their roots along z of B, (p, k, s), m.

    Parameters
    ----------
    batch : ParameterBatch
        p parameter sets.
    hinges : ndarray, shape (k, s, HINGE_ROWS)
        At k times.
    q_joint : ndarray, shape (p, k, coordinates)
        rad.
    """
    particles, times = q_joint.shape[:2]
    # in wing axes all times form one batch; the hinges' rotation is applied afterwards
    tips_W = tip_positions(model, _repeated(batch, times), level_hinges(model), _rows(q_joint))
    down_W = hinges[:, :, 6:9]  # third row of R_BW
    return np.asarray(np.einsum("ksi,pksi->pks", down_W, tips_W.reshape(particles, times, -1, 3)))


def tips_twist(model: ChainModel, batch: ParameterBatch, q_joint: Array) -> Array:
    """Twist (p, k, s), rad, of tips relative to their roots: torsion of Rx(flap) Ry(torsion) Rz(edgewise)."""
    particles, times = q_joint.shape[:2]
    R_WL, _ = link_poses(model, _repeated(batch, times), level_hinges(model), _rows(q_joint))
    last = model.surfaces[:, 0] + model.surfaces[:, 1] - 1
    return np.arcsin(np.clip(R_WL[:, last, 0, 2], -1.0, 1.0)).reshape(particles, times, -1)


def surface_loads(
    model: ChainModel, batch: ParameterBatch, hinges: Array, q_joint: Array, loads: ChainLoads
) -> SurfaceLoads:
    """Loads of the surfaces of one parameter set at k times, of all that the model has.

    ``hinges`` (k, s, HINGE_ROWS), ``q_joint`` (k, coordinates), ``loads`` with every body.
    """
    R_WL, _ = link_poses(model, _repeated(batch, q_joint.shape[0]), level_hinges(model), q_joint)
    air_B = np.empty((q_joint.shape[0], len(model.aircraft.surfaces), 3))
    for number, (first, count) in enumerate(model.surfaces[:, :2]):
        own = slice(first, first + count)
        air_W = np.einsum("klij,klj->ki", R_WL[:, own], loads.air_L[:, own, 3:])
        air_B[:, number] = np.einsum("kij,kj->ki", hinges[:, number, :9].reshape(-1, 3, 3), air_W)
    lattices = model.lattice.lattices
    width = np.concatenate([np.diff(part.strip_edges_m) for part in lattices])
    circulation, velocity = loads.sections[..., 0] / width, loads.sections[..., 1:]
    lift, coefficient = section_loads(lattices, circulation, velocity, model.flight.air_density_kg_m3)
    return SurfaceLoads(loads.root_W, air_B, lift, coefficient)


def point_forces(
    model: ChainModel, batch: ParameterBatch, points: tuple[Point, ...], loads: ChainLoads
) -> dict[str, Array]:
    """Specific force (k, 3) at points on surfaces, by name, in the axes of the links that carry them.

    The model may be one half of an aircraft whose other half moves alike.
    """
    found = {}
    names = [surface.name for surface in model.aircraft.surfaces]
    images = [surface.name for surface in model.lattice.images]
    for point in points:
        if point.surface is None:
            continue
        here = point.surface in names
        number = (names if here else images).index(point.surface)
        sign = np.ones(3) if here else ACROSS
        surface = model.aircraft.surfaces[number]
        division = np.ones((1, 1))
        if surface.flexible:
            division = batch.of_set("division", model.set_of(batch)[number])[:1]
        edges = link_edges(division, surface.length_m)[0]
        inside = max(int(np.searchsorted(edges, point.at * surface.length_m)) - 1, 0)
        arm = point.arm_W(surface, float(edges[inside]))
        link = int(model.surfaces[number, 0]) + inside
        force = specific_force(arm, loads.twist_L[:, link], loads.acceleration_L[:, link])
        found[point.name] = sign * force
    return found


def _rows(q_joint: Array) -> Array:
    return q_joint.reshape(q_joint.shape[0] * q_joint.shape[1], -1)


def _repeated(batch: ParameterBatch, times: int) -> ParameterBatch:
    """Each parameter set repeated for a number of times."""
    return batch.select(np.repeat(np.arange(batch.particles), times))
