"""A lattice on its sections against the influence by ring, component and point of `vlm.influence`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from morphcore.aero.kernels.lattice_forces import blocked_flow, section_forces
from morphcore.aero.kernels.lattice_gusts import add_gust_flow, add_gust_forces
from morphcore.aero.kernels.lattice_place import induced_velocity
from morphcore.aero.kernels.lattice_place import refine as refine_kernel
from morphcore.aero.moving_lattice import MovingLattice
from morphcore.aero.vlm import influence
from morphcore.jit import entry_kernel
from morphcore.models.flexible import flexible_model
from morphdata.lattice import Lattice, VortexCore
from tests.kernels import from_python
from tests.models.chains import example_aircraft, example_flight
from tests.oracles.lattice import edge_midpoints, panel_normals

refine = from_python(refine_kernel)


@entry_kernel
def _induced(parts, place, gamma, still):  # pasted into kernels only
    induced_velocity(parts, place, gamma, still)


@pytest.mark.parametrize("law", ["line", "smoothed"])
@pytest.mark.parametrize("mach", [0.0, 0.6])
def test_influence_is_that_of_the_rings(law: str, mach: float) -> None:
    """Crooked wings, compressible too: normal part at control points, sums at the edges, to rounding."""
    rng = np.random.default_rng(3)
    settings = Lattice(chordwise=2, spanwise=4, core=VortexCore(law=law))  # type: ignore[arg-type]
    model = flexible_model(example_aircraft(), example_flight(), elements=2, lattice=settings)
    table, riders = model.lattice.table, model.riders
    lattice = MovingLattice(table, riders, settings.core, 1.2, mach)
    count = riders.sections
    R = Rotation.from_rotvec(0.05 * rng.standard_normal((count, 3))).as_matrix()
    x = np.stack([np.zeros(count), np.linspace(-3.0, 3.0, count), np.zeros(count)], axis=1)
    x += 0.02 * rng.standard_normal((count, 3))
    stream = np.array([-0.97, 0.05, -0.2])
    lattice.place(R, x, 150.0 * stream)
    corners = x[riders.corner] + np.einsum("mij,mj->mi", R[riders.corner], riders.corner_arm)
    controls = x[riders.control] + np.einsum("mij,mj->mi", R[riders.control], riders.control_arm)
    by_ring = influence(controls, corners, table, stream, settings.core, mach)
    expected = np.einsum("pa,arp->rp", panel_normals(corners, table), by_ring)
    scale = np.abs(expected).max()
    np.testing.assert_allclose(lattice.at.influence[:-1], expected, atol=1e-12 * scale)
    gamma = rng.standard_normal(table.rings)
    _induced(lattice.parts, lattice.at, gamma, 0.0)
    at_edges = influence(edge_midpoints(corners, table), corners, table, stream, settings.core, mach)
    summed = np.einsum("are,r->ae", at_edges, gamma)
    np.testing.assert_allclose(lattice.at.induced, summed, atol=1e-12 * np.abs(at_edges).max() * table.rings)
    # a small change leaves the sum alone, a larger one does not
    _induced(lattice.parts, lattice.at, gamma * (1.0 + 1e-9), 1e-7)
    kept = lattice.at.induced.copy()
    _induced(lattice.parts, lattice.at, gamma * 1.001, 1e-7)
    np.testing.assert_allclose(lattice.at.induced, 1.001 * kept, rtol=1e-9)


def test_a_gust_that_is_the_same_everywhere_is_wind() -> None:
    """Flow and forces, drag and moment of camber included, are those of that wind, to rounding."""
    rng = np.random.default_rng(8)
    wings = tuple(
        replace(surface, cm0=-0.05, zero_lift_rad=-0.04, profile_drag=0.02)
        for surface in example_aircraft().surfaces
    )
    aircraft = replace(example_aircraft(), surfaces=wings)
    settings = Lattice(chordwise=2, spanwise=4)
    model = flexible_model(aircraft, example_flight(), elements=2, lattice=settings)
    lattice = MovingLattice(model.lattice.table, model.riders, settings.core, 1.2, 0.0)
    count, rings = model.riders.sections, model.lattice.table.rings
    R = Rotation.from_rotvec(0.05 * rng.standard_normal((count, 3))).as_matrix()
    x = np.stack([np.zeros(count), np.linspace(-3.0, 3.0, count), np.zeros(count)], axis=1)
    lattice.place(R, x, np.array([-150.0, 0.0, -8.0]))
    R_NB = Rotation.from_rotvec([0.3, 0.1, -0.2]).as_matrix()
    twists, wind_B = rng.standard_normal((count, 6)), np.array([2.0, -3.0, -4.0])
    twists[:, 3] += 150.0
    gust, still = np.tile(R_NB @ wind_B, 2 * model.lattice.strips), np.zeros(3)
    gamma = rng.standard_normal(rings)
    flows, forces = np.zeros((2, rings)), np.zeros((2, count, 6))
    blocked_flow(lattice.parts, lattice.at, twists, wind_B, flows[0])
    blocked_flow(lattice.parts, lattice.at, twists, still, flows[1])
    add_gust_flow(lattice.parts, lattice.at, R_NB, gust, flows[1])
    section_forces(lattice.parts, lattice.at, gamma, twists, wind_B, 0.0, forces[0])
    section_forces(lattice.parts, lattice.at, gamma, twists, still, 0.0, forces[1])
    add_gust_forces(lattice.parts, lattice.at, R_NB, gust, twists, still, forces[1])
    np.testing.assert_allclose(flows[1], flows[0], atol=1e-11)
    np.testing.assert_allclose(forces[1], forces[0], atol=1e-11 * np.abs(forces).max())


def test_refinement_solves_with_an_old_inverse() -> None:
    """Off by a hundredth, the inverse leads to the solution; too few passes are reported."""
    rng = np.random.default_rng(9)
    matrix = np.eye(12) + 0.05 * rng.standard_normal((12, 12))
    old = np.linalg.inv(matrix * (1.0 + 0.01 * rng.standard_normal((12, 12))))
    right, room = rng.standard_normal(12), np.zeros(12)
    by_ring = np.vstack([matrix.T, np.zeros(12)])
    gamma = np.zeros(12)
    assert refine(by_ring, np.ascontiguousarray(old.T), right, room, 1e-12, 20, gamma)
    np.testing.assert_allclose(gamma, np.linalg.solve(matrix, right), atol=1e-11)
    assert not refine(by_ring, np.ascontiguousarray(old.T), right, room, 1e-12, 1, np.zeros(12))
