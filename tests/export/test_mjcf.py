"""The exported MuJoCo model is the tree: masses, joints, places."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from morphcore.errors import InvalidInput
from tests.multibody.trees import massive_bodies, random_motion, random_tree, reference_tree
from tests.oracles.dynamics import body_poses
from tests.oracles.mjcf import mjcf

LAWS = settings(max_examples=25, deadline=None)  # no deadline: the first example compiles
SEEDS = st.integers(0, 2**32 - 1)


@LAWS
@given(SEEDS)
def test_bodies_stand_where_the_tree_says(seed: int) -> None:
    """Places and attitudes of all bodies at bent joints, compound joints of massless frames included."""
    rng = np.random.default_rng(seed)
    tree = random_tree(rng)
    motion = random_motion(rng, tree)
    model = mujoco.MjModel.from_xml_string(mjcf(tree))
    data = mujoco.MjData(model)
    data.qpos[:3], data.qpos[3:7] = motion.position_N, motion.quaternion
    for name, angles in (("joint", motion.q_joint), ("hinge", motion.hinge_angle)):
        for i, angle in enumerate(angles):
            data.joint(f"{name}_{i}").qpos[0] = angle
    mujoco.mj_kinematics(model, data)
    R_NX, r_N = body_poses(tree, motion)
    for body in np.flatnonzero(massive_bodies(tree)):
        np.testing.assert_allclose(data.body(f"body_{body}").xpos, r_N[body], atol=1e-12)
        np.testing.assert_allclose(data.body(f"body_{body}").xmat.reshape(3, 3), R_NX[body], atol=1e-12)


def test_model_says_what_was_requested() -> None:
    """Start (any length of quaternion), gravity, step, springs and dampers arrive in the model."""
    tree = reference_tree(3)
    text = mjcf(
        tree,
        quaternion=(2, 0, 0, 2),
        position_N=(1, 2, -300),
        gravity_N=(0, 0, 1.62),
        step_s=2e-4,
        name="moon",
    )
    model = mujoco.MjModel.from_xml_string(text)
    np.testing.assert_allclose(model.qpos0[:7], [1, 2, -300, np.sqrt(0.5), 0, 0, np.sqrt(0.5)])
    np.testing.assert_array_equal(model.opt.gravity, [0, 0, 1.62])
    assert model.opt.timestep == 2e-4
    assert model.nv == 6 + tree.coordinates + tree.hinges
    for i in range(tree.coordinates):
        joint = model.joint(f"joint_{i}")
        # MuJoCo 4 stores polynomials where 3 stored numbers: the linear coefficient leads in both
        assert np.ravel(joint.stiffness)[0] == tree.stiffness[i]
        assert np.ravel(joint.damping)[0] == tree.damping[i]
    assert model.body_mass.sum() == pytest.approx(tree.inertia[:, 3, 3].sum(), rel=1e-14)


def test_same_tree_same_document() -> None:
    """The export is a pure function: byte-identical every time."""
    assert mjcf(reference_tree(4)) == mjcf(reference_tree(4))


def test_a_massless_end_is_refused() -> None:
    """A moving body without mass and without a body beyond it has no place in MuJoCo, and says so."""
    tree = reference_tree(2)
    inertia = tree.inertia.copy()
    inertia[-1] = 0
    with pytest.raises(InvalidInput, match="massless body"):
        mjcf(replace(tree, inertia=inertia))


def test_an_impossible_inertia_is_refused() -> None:
    """Principal moments beyond the triangle inequality belong to no rigid body."""
    tree = reference_tree(1)
    inertia = tree.inertia.copy()
    inertia[0, 0, 0] *= 100
    with pytest.raises(InvalidInput, match="no rigid body"):
        mjcf(replace(tree, inertia=inertia))
