"""Spatial algebra, body by body, against plain three-vector mechanics."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from morphcore import frames
from tests.kernels import module_from_python
from tests.multibody.trees import random_inertia
from tests.oracles.kernels import spatial as spatial_kernels

spatial = module_from_python(spatial_kernels)

SEEDS = st.integers(0, 2**32 - 1)
LAWS = settings(max_examples=30, deadline=None)  # no deadline: the first example compiles


def random_joint(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """R_PC and offset_P in general position."""
    R_PC = frames.rotation_from_quaternion(frames.quaternion_from_euler(*rng.uniform(-1.5, 1.5, 3)))
    return R_PC, rng.normal(size=3)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_axis_rotation_is_scipys(axis: int) -> None:
    """The kernel turns about the same axis, the same way, as scipy: right-handed."""
    out = np.empty((3, 3))
    spatial.axis_rotation(axis, 0.7, out)
    np.testing.assert_allclose(out, Rotation.from_rotvec(0.7 * np.eye(3)[axis]).as_matrix(), atol=3e-16)


@LAWS
@given(SEEDS)
def test_power_does_not_depend_on_the_point_of_view(seed: int) -> None:
    """Force times velocity is the same number at the child's origin and at the parent's."""
    rng = np.random.default_rng(seed)
    R_PC, offset_P = random_joint(rng)
    motion_P, force_C = rng.normal(size=6), rng.normal(size=6)
    motion_C, force_P = np.empty(6), np.zeros(6)
    spatial.motion_to_child(R_PC, offset_P, motion_P, motion_C)
    spatial.add_force_to_parent(R_PC, offset_P, force_C, force_P)
    assert motion_C @ force_C == pytest.approx(motion_P @ force_P, abs=1e-13)


@LAWS
@given(SEEDS)
def test_moved_velocity_is_that_of_the_point(seed: int) -> None:
    """The velocity of a point of a rigid body is v + omega x r."""
    rng = np.random.default_rng(seed)
    R_PC, offset_P = random_joint(rng)
    motion_P, motion_C = rng.normal(size=6), np.empty(6)
    spatial.motion_to_child(R_PC, offset_P, motion_P, motion_C)
    np.testing.assert_allclose(R_PC @ motion_C[:3], motion_P[:3], atol=1e-14)
    np.testing.assert_allclose(
        R_PC @ motion_C[3:], motion_P[3:] + np.cross(motion_P[:3], offset_P), atol=1e-14
    )


@LAWS
@given(SEEDS)
def test_moved_inertia_keeps_the_kinetic_energy(seed: int) -> None:
    """An inertia seen from the parent gives the energy that it gives at home, and stays symmetric."""
    rng = np.random.default_rng(seed)
    R_PC, offset_P = random_joint(rng)
    inertia_C, inertia_P = random_inertia(rng), np.zeros((6, 6))
    spatial.add_inertia_to_parent(R_PC, offset_P, inertia_C, np.empty((4, 6)), inertia_P)
    motion_P, motion_C = rng.normal(size=6), np.empty(6)
    spatial.motion_to_child(R_PC, offset_P, motion_P, motion_C)
    assert motion_P @ inertia_P @ motion_P == pytest.approx(motion_C @ inertia_C @ motion_C, rel=1e-13)
    np.testing.assert_allclose(inertia_P, inertia_P.T, atol=1e-12)


@LAWS
@given(SEEDS)
def test_cross_products_are_the_rates_of_moving_vectors(seed: int) -> None:
    """A vector fixed in a moving body changes by velocity x (motion) or velocity x* (force).

    Difference quotient of the transforms over a small motion of the body.
    """
    rng = np.random.default_rng(seed)
    velocity, motion, force = rng.normal(size=6), rng.normal(size=6), rng.normal(size=6)
    step = 1e-4

    def at(time: float) -> tuple[np.ndarray, np.ndarray]:
        """The two vectors in fixed coordinates, ``time`` seconds after the axes coincided."""
        omega = velocity[:3]
        angle = np.linalg.norm(omega) * time
        half = np.concatenate([[np.cos(angle / 2)], np.sin(angle / 2) * omega / np.linalg.norm(omega)])
        R, r = frames.rotation_from_quaternion(half), velocity[3:] * time
        out_motion, out_force = np.empty(6), np.zeros(6)
        spatial.motion_to_child(R.T, -R.T @ r, motion, out_motion)
        spatial.add_force_to_parent(R, r, force, out_force)
        return out_motion, out_force

    (motion_before, force_before), (motion_after, force_after) = at(-step), at(step)
    moved, loaded = np.zeros(6), np.zeros(6)
    spatial.add_cross_motion(velocity, motion, moved)
    spatial.add_cross_force(velocity, force, loaded)
    # central differences: error of order step^2 |velocity|^3
    np.testing.assert_allclose(moved, (motion_after - motion_before) / (2 * step), atol=2e-6)
    np.testing.assert_allclose(loaded, (force_after - force_before) / (2 * step), atol=2e-6)
