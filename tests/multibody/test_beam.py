"""Geometrically exact beams against theory, published benchmarks and their own balance laws."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

from morphcore.multibody.beam import (
    GAUSS,
    Beams,
    BeamTurnedTooFar,
    BeamWorkspace,
    NodePoses,
    Section,
    expand_solution,
    factor,
    node_forces,
    reduce_right,
)
from tests.multibody.cantilevers import Box, bent, straight
from tests.oracles.clamped_beams import (
    DeadLoad,
    clamped_equilibrium,
    clamped_modes,
    sections_of,
    subtract_section_forces,
)

RNG = np.random.default_rng(11)
NO_GRAVITY = np.zeros(3)


def timoshenko_frequencies(box: Box, count: int) -> list[float]:
    """Flap frequencies (Hz) of a cantilever by Timoshenko's equations, without any element.

    With w' = phi + V / kGA, phi' = M / EI, M' = -V - rho I omega^2 phi, V' = -rho A omega^2 w the clamped
    root leaves M and V free and the tip wants both zero: a 2 x 2 determinant in omega.
    """
    mass, rotary = box.density * box.area, box.density * box.area * box.thickness**2 / 12.0

    def determinant(frequency: float) -> float:
        omega2 = (2.0 * np.pi * frequency) ** 2
        rates = np.array(
            [
                [0.0, 1.0, 0.0, 1.0 / box.shear],
                [0.0, 0.0, 1.0 / box.ei_flap, 0.0],
                [0.0, -rotary * omega2, 0.0, -1.0],
                [-mass * omega2, 0.0, 0.0, 0.0],
            ]
        )
        return float(np.linalg.det(expm(rates * box.length)[2:, 2:]))

    grid = np.linspace(1.0, 120.0, 600)
    values = [determinant(f) for f in grid]
    signs = np.flatnonzero(np.diff(np.sign(values)))
    return [float(brentq(determinant, grid[i], grid[i + 1])) for i in signs[:count]]


def flap_frequencies(beams: Beams) -> list[float]:
    """The three lowest frequencies (Hz) whose tip moves along z."""
    found, shapes = clamped_modes(beams, 10)
    moves_in_z = np.abs(shapes[:, -1, 5]) > 100.0 * np.abs(shapes[:, -1, 3:5]).max(axis=1)
    return list(found[moves_in_z][:3])


def test_cantilever_frequencies_are_timoshenkos() -> None:
    """The first three flap and the first torsion frequency of the example's wing, ten elements, 0.5 per cent.

    A slender wing's are Euler and Bernoulli's too: 1.875^2, 4.694^2, 7.855^2 over 2 pi L^2 sqrt(EI / m).
    """
    box = Box()
    beams, _ = straight(box.section(), box.length, 10)
    found, shapes = clamped_modes(beams, 8)
    flaps = flap_frequencies(beams)
    torsion = next(
        f
        for f, shape in zip(found, shapes, strict=True)
        if np.abs(shape[:, 3:]).max() < 1e-9 * np.abs(shape).max()
    )
    np.testing.assert_allclose(flaps[:3], timoshenko_frequencies(box, 3), rtol=5e-3)
    inertia = box.density * box.area * (box.chord**2 + box.thickness**2) / 12.0
    assert torsion == pytest.approx(np.sqrt(box.gj / inertia) / (4.0 * box.length), rel=5e-3)
    thin = Box(thickness=0.01)
    beams, _ = straight(thin.section(), thin.length, 20)
    wave = np.array([1.8751041, 4.6940911, 7.8547574])
    euler = wave**2 / (2.0 * np.pi * thin.length**2) * np.sqrt(thin.ei_flap / (thin.density * thin.area))
    np.testing.assert_allclose(flap_frequencies(beams), euler, rtol=5e-4)


def test_frequencies_converge_with_the_fourth_power() -> None:
    """Twice the elements, a sixteenth of the error: the flexibility is exact, inertia follows the helix."""
    box = Box(thickness=0.02)
    third = [flap_frequencies(straight(box.section(), box.length, n)[0])[2] for n in (4, 8, 32)]
    errors = np.abs(np.array(third[:2]) - third[2])
    assert 10.0 < errors[0] / errors[1] < 24.0


def test_one_element_bends_exactly() -> None:
    """A small tip load on one element: P L^3 / 3 EI + P L / kGA, to the load's own nonlinearity (1e-6)."""
    box = Box()
    beams, poses = straight(box.section(), box.length, 1)
    force = 1e-3
    found = clamped_equilibrium(beams, poses, [DeadLoad(1, force_N=(0.0, 0.0, force))])
    expected = force * (box.length**3 / (3.0 * box.ei_flap) + box.length / box.shear)
    assert found.x[1, 2] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("elements", [5, 10])
def test_end_moment_rolls_the_beam_up_to_a_circle(elements: int) -> None:
    """M = 2 pi EI / L closes the circle: the tip comes back to the root to 0.1 per cent of the length.

    The helix is exact here, so it does to rounding. Simo & Vu-Quoc (1986), section 5.1.
    """
    stiffness, length = 2.0, 1.0
    section = Section(np.diag([stiffness, 1.0, stiffness, 1e4, 1e4, 1e4]), np.eye(6))
    beams, poses = straight(section, length, elements)
    follower = np.zeros((elements + 1, 6))
    follower[-1, 2] = 2.0 * np.pi * stiffness / length
    found = clamped_equilibrium(beams, poses, follower=follower, increments=8)
    assert np.abs(found.x[-1]).max() < 1e-9
    np.testing.assert_allclose(found.R[-1], np.eye(3), atol=1e-9)


@pytest.mark.parametrize(
    ("force", "published"),
    [(300.0, (22.33, 58.84, 40.08)), (600.0, (15.79, 47.23, 53.37))],
)
def test_forty_five_degree_bend(force: float, published: tuple[float, float, float]) -> None:
    """Bathe & Bolourchi's (1979) bend, tip positions as Simo & Vu-Quoc (1986, table 4), 1 per cent.

    Radius 100, section 1 x 1, E = 1e7, G = E / 2, eight elements, a dead load out of the plane.
    """
    modulus, inertia = 1e7, 1.0 / 12.0
    shear = 0.5 * modulus
    section = Section(
        np.diag(
            [
                modulus * inertia,
                shear * 2.0 * inertia,
                modulus * inertia,
                shear * 5 / 6,
                modulus,
                shear * 5 / 6,
            ]
        ),
        np.eye(6),
    )
    beams, poses = bent(section, [0.0, 0.0, np.pi / 4.0, 0.0, 100.0 * np.pi / 4.0, 0.0], 8)
    found = clamped_equilibrium(beams, poses, [DeadLoad(8, force_N=(0.0, 0.0, force))], increments=6)
    x, y, z = found.x[-1]
    np.testing.assert_allclose([-x, y, z], published, rtol=0.01)


def a_moving_beam() -> tuple[Beams, NodePoses, np.ndarray, np.ndarray]:
    """A bent, moving chain of three elements with everything at random."""
    section = Box().section()
    coupled = Section(section.stiffness, section.mass + 0.3 * np.diag([0.0, 0.0, 0.0, 1.0, 1.0, 1.0]))
    beams, poses = straight(coupled, 3.0, 3, damping_s=0.01)
    poses.move(0.1 * RNG.normal(size=(4, 6)))
    V, A = RNG.normal(size=(4, 6)), RNG.normal(size=(4, 6))
    return beams, poses, V, A


def test_strain_is_blind_to_rigid_motion() -> None:
    """Moved and turned as one, the nodes feel the same forces in their own axes."""
    beams, poses, V, A = a_moving_beam()
    work = BeamWorkspace(beams)
    before = node_forces(beams, work, poses, V, A, NO_GRAVITY)
    whole = NodePoses(np.eye(3)[None].copy(), np.zeros((1, 3)))
    whole.move(np.array([[0.4, -1.0, 0.8, 3.0, -2.0, 5.0]]))
    moved = NodePoses(np.ascontiguousarray(whole.R[0] @ poses.R), poses.x @ whole.R[0].T + whole.x[0])
    after = node_forces(beams, work, moved, V, A, NO_GRAVITY)
    np.testing.assert_allclose(after, before, atol=1e-6 * np.abs(before).max())


def momentum(beams: Beams, work: BeamWorkspace, poses: NodePoses, V: np.ndarray) -> np.ndarray:
    """Angular and linear momentum about the origin of N, (6,), by sections at the Gauss points."""
    node_forces(beams, work, poses, V, np.zeros_like(V), NO_GRAVITY)
    total = np.zeros(6)
    for e in range(beams.elements):
        found, twists = sections_of(beams, work, poses, V, np.full(GAUSS.size, e), GAUSS)
        for g in range(GAUSS.size):
            h = beams.mass[e, g] @ twists[g]
            linear = found.R[g] @ h[3:]
            total += np.concatenate([found.R[g] @ h[:3] + np.cross(found.x[g], linear), linear])
    return total


def test_demands_add_up_to_the_rate_of_momentum() -> None:
    """The nodes' demands, summed about one point, are the rate of change of the momentum of all sections.

    Poses, twists and rates run along one smooth motion; central differences of its momentum, 1e-6.
    """
    beams, poses, V, A = a_moving_beam()
    work, h = BeamWorkspace(beams), 1e-5

    def at(t: float) -> tuple[NodePoses, np.ndarray]:
        moved = poses.copy()
        # second order in t is enough: the twist at t is V + t A to first order in the body's axes
        moved.move(t * V + 0.5 * t * t * A)
        return moved, V + t * A

    rate = (momentum(beams, work, *at(h)) - momentum(beams, work, *at(-h))) / (2.0 * h)
    demands = node_forces(beams, work, poses, V, A, NO_GRAVITY)
    force = np.einsum("nij,nj->ni", poses.R, demands[:, 3:])
    moment = np.einsum("nij,nj->ni", poses.R, demands[:, :3]) + np.cross(poses.x, force)
    total = np.concatenate([moment.sum(axis=0), force.sum(axis=0)])
    np.testing.assert_allclose(total, rate, atol=1e-6 * np.abs(demands).max())


def test_power_of_the_demands_is_the_rate_of_energy() -> None:
    """V . demands = d/dt (kinetic + strain energy) + what damping takes, along one smooth motion."""
    beams, poses, V, A = a_moving_beam()
    work, h = BeamWorkspace(beams), 1e-5

    def energy(t: float) -> float:
        moved, twist = poses.copy(), V + t * A
        moved.move(t * V + 0.5 * t * t * A)
        node_forces(beams, work, moved, twist, np.zeros_like(V), NO_GRAVITY)
        strain = work.strains - beams.rest
        total = 0.5 * float(np.einsum("ei,eij,ej->", strain, beams.stiffness, strain))
        for e in range(beams.elements):
            _, twists = sections_of(beams, work, moved, twist, np.full(GAUSS.size, e), GAUSS)
            total += 0.5 * float(np.einsum("gi,gij,gj->", twists, beams.mass[e], twists))
        return total

    rate = (energy(h) - energy(-h)) / (2.0 * h)
    demands = node_forces(beams, work, poses, V, A, NO_GRAVITY)
    rates = work.rates
    lost = float(np.einsum("e,ei,eij,ej->", beams.damping, rates, beams.stiffness, rates))
    assert float(np.sum(V * demands)) == pytest.approx(rate + lost, rel=1e-6)


def test_tangent_is_the_derivative_of_the_demands() -> None:
    """K and C of the iteration matrix against central differences of a bent beam's forces, at rest."""
    beams, poses = straight(Box().section(), 3.0, 3, damping_s=0.01)
    poses.move(0.03 * RNG.normal(size=(4, 6)))
    work, size, zero = BeamWorkspace(beams), 24, np.zeros((4, 6))
    h = 1e-6

    def differences(of_rate: float, of_pose: float) -> np.ndarray:
        columns = []
        for i in range(size):
            unit = np.zeros(size)
            unit[i] = h
            forces = []
            for sign in (1.0, -1.0):
                moved = poses.copy()
                moved.move(sign * of_pose * unit.reshape(4, 6))
                forces.append(
                    node_forces(beams, work, moved, sign * of_rate * unit.reshape(4, 6), zero, NO_GRAVITY)
                )
            columns.append((forces[0] - forces[1]).ravel() / (2.0 * h))
        return np.stack(columns, axis=1)

    def assembled(*weights: float) -> np.ndarray:
        node_forces(beams, work, poses, zero, zero, NO_GRAVITY)
        factor(beams, work, *weights)
        matrix = np.zeros((size, size))
        for (a, b), block in zip(beams.ends, work.tangents, strict=True):
            rows = np.concatenate([6 * a + np.arange(6), 6 * b + np.arange(6)])
            matrix[np.ix_(rows, rows)] += block
        return matrix

    for weights in ((0.0, 1.0), (1.0, 0.0)):
        expected = differences(*weights)
        np.testing.assert_allclose(assembled(0.0, *weights), expected, atol=1e-6 * np.abs(expected).max())


def test_block_elimination_solves_the_assembled_system() -> None:
    """Condense, clamp the root, substitute: the same as a dense solve of the free nodes."""
    beams, poses, V, A = a_moving_beam()
    work = BeamWorkspace(beams)
    node_forces(beams, work, poses, V, A, NO_GRAVITY)
    factor(beams, work, 1.0, 1e-3, 1e-6)
    matrix = np.zeros((24, 24))
    for (a, b), block in zip(beams.ends, work.tangents, strict=True):
        rows = np.concatenate([6 * a + np.arange(6), 6 * b + np.arange(6)])
        matrix[np.ix_(rows, rows)] += block
    right = RNG.normal(size=(4, 6))
    expected = np.linalg.solve(matrix[6:, 6:], right[1:].ravel())
    reduce_right(beams, work, right)
    right[0] = 0.0
    expand_solution(beams, work, right)
    np.testing.assert_allclose(right[1:].ravel(), expected, rtol=1e-9)


def test_section_forces_reach_the_nodes_by_virtual_work() -> None:
    """A force on a section does on it the work that the nodes' shares do on the nodes."""
    beams, poses, V, _ = a_moving_beam()
    work = BeamWorkspace(beams)
    node_forces(beams, work, poses, V, np.zeros_like(V), NO_GRAVITY)
    elements, fractions = np.array([0, 1, 2, -2]), np.array([0.2, 0.5, 1.0, 0.0])
    _, twists = sections_of(beams, work, poses, V, elements, fractions)
    forces, shares = RNG.normal(size=(4, 6)), np.zeros((4, 6))
    subtract_section_forces(beams, work, elements, fractions, forces, shares)
    assert -float(np.sum(shares * V)) == pytest.approx(float(np.sum(forces * twists)), rel=1e-12)


def test_weight_hangs_the_beam_by_its_mass() -> None:
    """The clamped root carries all the weight, and its moment is mass times half the length."""
    box = Box()
    beams, poses = straight(box.section(), box.length, 4)
    gravity_N = np.array([0.0, 0.0, 9.81])
    hanging = clamped_equilibrium(beams, poses, gravity_N=gravity_N)
    zero = np.zeros((5, 6))
    demands = node_forces(beams, BeamWorkspace(beams), hanging, zero, zero, gravity_N)
    weight = box.density * box.area * box.length * 9.81
    assert demands[0, 5] == pytest.approx(-weight, rel=1e-9)
    assert demands[0, 0] == pytest.approx(-weight * box.length / 2.0, rel=1e-3)  # bent, the arm is shorter


def test_a_beam_bent_too_far_says_so() -> None:
    """An element that turns by more than 1.5 rad is an error with a remedy."""
    box = Box()
    beams, poses = straight(box.section(), box.length, 1)
    poses.move(np.array([[0.0] * 6, [1.6, 0.0, 0.0, 0.0, 0.0, 0.0]]))
    zero = np.zeros((2, 6))
    with pytest.raises(BeamTurnedTooFar, match="use more elements"):
        node_forces(beams, BeamWorkspace(beams), poses, zero, zero, NO_GRAVITY)
