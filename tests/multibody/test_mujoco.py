"""The dense dynamics against MuJoCo, on the same trees through our own export."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from tests.multibody.crba_flight import fly_crba
from tests.multibody.mujoco_flight import MujocoTree, fly_mujoco
from tests.multibody.trees import (
    massive_bodies,
    random_motion,
    random_tree,
    random_wrench,
    reference_tree,
    undamped,
)
from tests.oracles.dynamics import Motion, bias, forward_dynamics_crba, mass_matrix
from tests.oracles.tree import Tree

Array = NDArray[np.float64]

GRAVITY_N = np.array([0.0, 0.0, 9.81])
LAWS = settings(max_examples=25, deadline=None)  # no deadline: the first example compiles
SEEDS = st.integers(0, 2**32 - 1)


def cosine_sweep(time_s: float) -> tuple[Array, Array, Array]:
    """Right wing to 1 rad, left wing to 0.6 rad in 2 s, accelerating all the time."""
    amplitude, omega = np.array([0.5, 0.3]), np.pi / 2
    return (
        amplitude * (1 - np.cos(omega * time_s)),
        amplitude * omega * np.sin(omega * time_s),
        amplitude * omega**2 * np.cos(omega * time_s),
    )


def forced_flight(tree: Tree) -> tuple[Motion, Array]:
    """Start and constant body wrenches (b, 6), loads about those of the reference aircraft at 150 m/s."""
    n = tree.coordinates
    start = Motion(
        [1, 0, 0, 0], [0, 0, 0, 150, 0, 9], np.zeros(n), np.zeros(n), [0, 0], [0, 0], [0, 0], [0, 0, -100]
    )
    wrench = np.zeros((tree.bodies, 6))
    wings = np.flatnonzero(massive_bodies(tree))[1:]
    for body in wings:
        mass, arm = tree.inertia[body, 3, 3], tree.inertia[body, 0, 5]  # arm: mass times y of the centre
        lift = 9500.0 / wings.size
        wrench[body] = [-lift * arm / mass, 20.0, 0.0, -30.0, 0.0, -lift]
    wrench[0] = [0.0, -100.0, 0.0, 180.0, 0.0, 0.0]
    return start, wrench


def compare(tree: Tree, rng: np.random.Generator) -> None:
    """Hold M and h of a random motion under random loads against MuJoCo's."""
    motion, wrench, gravity_N = random_motion(rng, tree), random_wrench(rng, tree), 10 * rng.normal(size=3)
    M_mujoco, h_mujoco = MujocoTree(tree, gravity_N).equations(motion, wrench)
    M, h = mass_matrix(tree, motion), bias(tree, motion, wrench, gravity_N)
    scale = np.sqrt(np.diag(M))  # makes every entry of M at most one
    np.testing.assert_allclose(M / np.outer(scale, scale), M_mujoco / np.outer(scale, scale), atol=1e-12)
    np.testing.assert_allclose(h / scale, h_mujoco / scale, rtol=0, atol=1e-12 * np.abs(h / scale).max())


@LAWS
@given(SEEDS)
def test_mass_matrix_and_bias_of_random_trees(seed: int) -> None:
    """MuJoCo's equations of motion in body axes are ours: every axis, sign, offset, hinge and load."""
    rng = np.random.default_rng(seed)
    compare(random_tree(rng), rng)


@pytest.mark.parametrize("links", [1, 2, 3, 8])
def test_mass_matrix_and_bias_of_the_reference_aircraft(links: int) -> None:
    """The same on the examples' aircraft, softened so that its springs do not drown the velocity terms."""
    rng = np.random.default_rng(links)
    tree = undamped(reference_tree(links))
    compare(replace(tree, stiffness=1e-4 * tree.stiffness), rng)


def test_accelerations_with_accelerating_hinges() -> None:
    """Springs, dampers, forced links and hinges in full acceleration give MuJoCo's accelerations."""
    tree = reference_tree(3)
    start, wrench = forced_flight(tree)
    angle, rate, acceleration = cosine_sweep(0.4)
    motion = replace(start, hinge_angle=angle, hinge_rate=rate, hinge_acceleration=acceleration)
    ours = forward_dynamics_crba(tree, motion, wrench, GRAVITY_N)
    M, h = MujocoTree(tree, GRAVITY_N).equations(motion, wrench)
    expected = np.linalg.solve(M, -h)
    np.testing.assert_allclose(ours.base, expected[:6], rtol=0, atol=1e-10 * np.abs(expected[:6]).max())
    np.testing.assert_allclose(ours.joint, expected[6:], rtol=0, atol=1e-10 * np.abs(expected[6:]).max())


def test_two_seconds_of_forced_morphing_flight() -> None:
    """Attitude, place and joint angles of a sweeping, forced, bending aircraft stay with MuJoCo's for 2 s.

    Both sides use the same scheme and step, so what is left is round-off: 3e-15 rad when this was written.
    """
    tree, step_s = reference_tree(2), 1e-3
    start, wrench = forced_flight(tree)
    _, quaternion, position_N, q_joint = fly_mujoco(
        tree, start, cosine_sweep, wrench, GRAVITY_N, 2.0, step_s, every=200
    )
    ours = fly_crba(tree, start, cosine_sweep, wrench, GRAVITY_N, 2.0, step_s)[::200]
    np.testing.assert_allclose([m.quaternion for m in ours], quaternion, atol=1e-11)
    np.testing.assert_allclose([m.q_joint for m in ours], q_joint, atol=1e-11)
    np.testing.assert_allclose([m.position_N for m in ours], position_N, atol=1e-7)
    assert np.abs(q_joint).max() > 0.05  # the wings do bend
    assert np.abs(quaternion[-1] - quaternion[0]).max() > 0.1  # and the aircraft does turn


def test_a_massless_frame_takes_no_wrench() -> None:
    """The reference flight refuses a load that MuJoCo would drop."""
    tree = reference_tree(2)
    start, wrench = forced_flight(tree)
    wrench[~massive_bodies(tree)] = 1.0
    with pytest.raises(ValueError, match="massless"):
        fly_mujoco(tree, start, cosine_sweep, wrench, GRAVITY_N, 0.1, 1e-3)
