"""Laws of mechanics that the dense dynamics obeys on any tree, each by a route of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from morphcore.errors import InvalidInput
from morphcore.frames import rotation_from_quaternion, skew
from tests.multibody.crba_flight import fly_crba, quadratic_schedule, runge_kutta_step
from tests.multibody.trees import random_motion, random_tree, random_wrench, reference_tree, undamped
from tests.oracles.dynamics import (
    Acceleration,
    Motion,
    bias,
    body_poses,
    body_twists,
    energy,
    forward_dynamics_crba,
    hinge_torque,
    inverse_dynamics,
    mass_matrix,
    momentum,
)
from tests.oracles.tree import Tree

SEEDS = st.integers(0, 2**32 - 1)
LAWS = settings(max_examples=25, deadline=None)  # no deadline: the first example compiles
GRAVITY_N = np.array([0.3, -0.5, 9.81])  # not along an axis of N


class Case:
    """A random tree in random motion under random loads."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.tree = random_tree(rng)
        self.motion = random_motion(rng, self.tree)
        self.wrench = random_wrench(rng, self.tree)
        self.acceleration = forward_dynamics_crba(self.tree, self.motion, self.wrench, GRAVITY_N)

    def derivative(self, of_motion) -> np.ndarray:  # type: ignore[no-untyped-def]
        """Time derivative of a function of the motion along the flight, by differences of order four."""
        step = 1e-4
        schedule = quadratic_schedule(self.motion)

        def after(time: float) -> np.ndarray:
            moved = runge_kutta_step(self.tree, self.motion, schedule, 0.0, time, self.wrench, GRAVITY_N)
            return np.asarray(of_motion(moved))

        near, far = after(step) - after(-step), after(2 * step) - after(-2 * step)
        return np.asarray((8 * near - far) / (12 * step))


def close(actual: object, expected: object, relative: float) -> None:
    """Equal within ``relative`` of the largest entry."""
    size = max(1.0, float(np.max(np.abs(expected), initial=0.0)))  # type: ignore[arg-type]
    np.testing.assert_allclose(actual, expected, rtol=0, atol=relative * size)  # type: ignore[arg-type]


@LAWS
@given(SEEDS)
def test_mass_matrix_is_symmetric_and_positive_definite(seed: int) -> None:
    """Kinetic energy is a positive quadratic form of the velocities."""
    case = Case(seed)
    matrix = mass_matrix(case.tree, case.motion)
    close(matrix, matrix.T, 1e-14)
    assert np.linalg.eigvalsh(matrix).min() > 0


@LAWS
@given(SEEDS)
def test_mass_matrix_is_the_hessian_of_the_kinetic_energy(seed: int) -> None:
    """M_ij = T(e_i + e_j) - T(e_i) - T(e_j), with T summed body by body and the hinges at rest."""
    case = Case(seed)
    still = np.zeros(case.tree.hinges)
    size = 6 + case.tree.coordinates

    def kinetic(velocity: np.ndarray) -> float:
        motion = replace(case.motion, twist_B=velocity[:6], v_joint=velocity[6:], hinge_rate=still)
        return energy(case.tree, motion).kinetic

    unit = np.eye(size)
    alone = [kinetic(e) for e in unit]
    hessian = [[kinetic(unit[i] + unit[j]) - alone[i] - alone[j] for j in range(size)] for i in range(size)]
    close(mass_matrix(case.tree, case.motion), hessian, 1e-12)


@LAWS
@given(SEEDS)
def test_accelerations_need_no_effort(seed: int) -> None:
    """Inverse dynamics of the forward dynamics' solution requires no forces."""
    case = Case(seed)
    effort = inverse_dynamics(case.tree, case.motion, case.acceleration, case.wrench, GRAVITY_N)
    loads = np.abs(bias(case.tree, case.motion, case.wrench, GRAVITY_N)).max()
    np.testing.assert_allclose(effort.base_wrench_B, 0, atol=1e-10 * loads)
    np.testing.assert_allclose(effort.joint_torque, 0, atol=1e-10 * loads)


@LAWS
@given(SEEDS)
def test_inverse_dynamics_is_affine_in_the_acceleration(seed: int) -> None:
    """RNEA(a) = M a + h for every acceleration, with M from the composite rigid body algorithm."""
    case = Case(seed)
    rng = np.random.default_rng(seed)
    a = rng.normal(size=6 + case.tree.coordinates)
    effort = inverse_dynamics(case.tree, case.motion, Acceleration(a[:6], a[6:]), case.wrench, GRAVITY_N)
    expected = mass_matrix(case.tree, case.motion) @ a + bias(case.tree, case.motion, case.wrench, GRAVITY_N)
    close(np.concatenate([effort.base_wrench_B, effort.joint_torque]), expected, 1e-13)


@LAWS
@given(SEEDS)
def test_twists_are_the_rates_of_the_poses(seed: int) -> None:
    """Every body's spatial velocity is the time derivative of its position and attitude."""
    case = Case(seed)
    R_NX, _ = body_poses(case.tree, case.motion)
    R_rate = case.derivative(lambda m: body_poses(case.tree, m)[0])
    r_rate = case.derivative(lambda m: body_poses(case.tree, m)[1])
    for body, twist in enumerate(body_twists(case.tree, case.motion)):
        close(R_NX[body].T @ R_rate[body], skew(twist[:3]), 1e-7)
        close(R_NX[body].T @ r_rate[body], twist[3:], 1e-7)


@LAWS
@given(SEEDS)
def test_momentum_changes_by_external_forces_alone(seed: int) -> None:
    """Newton and Euler for the whole: springs, dampers and hinge motors are internal and change nothing."""
    case = Case(seed)
    now = momentum(case.tree, case.motion)
    R_NX, r_N = body_poses(case.tree, case.motion)
    forces_N = np.einsum("bij,bj->bi", R_NX, case.wrench[:, 3:])
    moments_N = np.einsum("bij,bj->bi", R_NX, case.wrench[:, :3]) + np.cross(r_N, forces_N)
    weight_N = now.mass * GRAVITY_N
    force_N = forces_N.sum(axis=0) + weight_N
    moment_N = moments_N.sum(axis=0) + np.cross(now.centre_N, weight_N)
    close(case.derivative(lambda m: momentum(case.tree, m).linear_N), force_N, 1e-7)
    close(case.derivative(lambda m: momentum(case.tree, m).angular_origin_N), moment_N, 1e-7)
    about_centre = moment_N - np.cross(now.centre_N, force_N)
    close(case.derivative(lambda m: momentum(case.tree, m).angular_centre_N), about_centre, 1e-7)


@LAWS
@given(SEEDS)
def test_linear_momentum_is_mass_times_velocity_of_the_centre(seed: int) -> None:
    """The centre of mass, followed in time, moves with the linear momentum over the mass."""
    case = Case(seed)
    now = momentum(case.tree, case.motion)
    close(case.derivative(lambda m: now.mass * momentum(case.tree, m).centre_N), now.linear_N, 1e-7)


@LAWS
@given(SEEDS)
def test_energy_changes_by_the_power_of_forces(seed: int) -> None:
    """dE/dt = power of the external wrenches + power of the hinge motors - dissipation of the dampers."""
    case = Case(seed)
    torque = hinge_torque(case.tree, case.motion, case.wrench, GRAVITY_N)
    power = np.sum(case.wrench * body_twists(case.tree, case.motion))
    power += torque @ case.motion.hinge_rate
    power -= np.sum(case.tree.damping * case.motion.v_joint**2)
    close(case.derivative(lambda m: energy(case.tree, m, GRAVITY_N).total), power, 1e-6)


@LAWS
@given(SEEDS)
def test_a_hinge_made_to_move_as_it_would_needs_no_motor(seed: int) -> None:
    """A free hinge's own acceleration, prescribed, takes no torque and leaves all others as they are."""
    case = Case(seed)
    tree, n, m = case.tree, case.tree.coordinates, case.tree.hinges
    freed = replace(
        tree,
        coordinate=np.where(tree.hinge >= 0, n + tree.hinge, tree.coordinate),
        hinge=np.full(tree.bodies, -1),
        stiffness=np.append(tree.stiffness, np.zeros(m)),
        damping=np.append(tree.damping, np.zeros(m)),
    )
    motion = replace(
        case.motion,
        q_joint=np.append(case.motion.q_joint, case.motion.hinge_angle),
        v_joint=np.append(case.motion.v_joint, case.motion.hinge_rate),
        hinge_angle=[],
        hinge_rate=[],
        hinge_acceleration=[],
    )
    free = forward_dynamics_crba(freed, motion, case.wrench, GRAVITY_N)
    prescribed = replace(case.motion, hinge_acceleration=free.joint[n:])
    hybrid = forward_dynamics_crba(tree, prescribed, case.wrench, GRAVITY_N)
    close(hybrid.base, free.base, 1e-10)
    close(hybrid.joint, free.joint[:n], 1e-10)
    loads = np.abs(bias(freed, motion, case.wrench, GRAVITY_N)).max()
    torque = hinge_torque(tree, prescribed, case.wrench, GRAVITY_N)
    np.testing.assert_allclose(torque, 0, atol=1e-10 * loads)


@LAWS
@given(SEEDS)
def test_the_world_has_no_preferred_direction(seed: int) -> None:
    """Turning attitude and gravity together, and moving the place, leaves all accelerations in body axes."""
    case = Case(seed)
    turn = np.random.default_rng(seed).normal(size=4)
    turn /= np.linalg.norm(turn)
    w, x, y, z = turn
    left_product = np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])
    turned = replace(case.motion, quaternion=left_product @ case.motion.quaternion, position_N=np.ones(3))
    gravity_N = rotation_from_quaternion(turn) @ GRAVITY_N
    there = forward_dynamics_crba(case.tree, turned, case.wrench, gravity_N)
    close(there.base, case.acceleration.base, 1e-10)
    close(there.joint, case.acceleration.joint, 1e-10)


@LAWS
@given(SEEDS)
def test_body_axes_have_no_preferred_order(seed: int) -> None:
    """Calling x y, y z and z x everywhere renames the accelerations' components and changes nothing else."""
    case = Case(seed)
    rename = np.roll(np.eye(3), 1, axis=0)  # new components of a vector
    rename6 = np.kron(np.eye(2), rename)
    tree = replace(
        case.tree,
        axis=np.where(case.tree.axis < 0, -1, (case.tree.axis + 1) % 3),
        offset_P=case.tree.offset_P @ rename.T,
        inertia=rename6 @ case.tree.inertia @ rename6.T,
    )
    w, xyz = case.motion.quaternion[:1], case.motion.quaternion[1:]
    motion = replace(
        case.motion, twist_B=rename6 @ case.motion.twist_B, quaternion=np.append(w, rename @ xyz)
    )
    renamed = forward_dynamics_crba(tree, motion, case.wrench @ rename6.T, rename @ GRAVITY_N)
    close(renamed.base, rename6 @ case.acceleration.base, 1e-10)
    close(renamed.joint, case.acceleration.joint, 1e-10)


def mirrored(tree: Tree) -> Tree:
    """The tree's image in the plane of symmetry x-z: rotations about x and z turn the other way."""
    reflect = np.array([1.0, -1.0, 1.0])
    reflect6 = np.append(-reflect, reflect)
    return replace(
        tree,
        sign=np.where(tree.axis == 1, 1.0, -1.0) * tree.sign,
        offset_P=tree.offset_P * reflect,
        inertia=tree.inertia * np.outer(reflect6, reflect6),
    )


@LAWS
@given(SEEDS)
def test_a_mirrored_aircraft_flies_the_mirrored_flight(seed: int) -> None:
    """Mirrored tree, state and loads have mirrored accelerations; joint coordinates are the same."""
    case = Case(seed)
    reflect = np.array([1.0, -1.0, 1.0])
    reflect6 = np.append(-reflect, reflect)
    motion = replace(
        case.motion,
        quaternion=case.motion.quaternion * [1, -1, 1, -1],
        twist_B=case.motion.twist_B * reflect6,
        position_N=case.motion.position_N * reflect,
    )
    image = forward_dynamics_crba(mirrored(case.tree), motion, case.wrench * reflect6, GRAVITY_N * reflect)
    close(image.base, case.acceleration.base * reflect6, 1e-10)
    close(image.joint, case.acceleration.joint, 1e-10)


def test_the_reference_aircraft_is_its_own_mirror_image() -> None:
    """Symmetric sweep of the reference aircraft in symmetric flight makes no side force, roll or yaw."""
    tree = reference_tree(3)
    n = tree.coordinates
    motion = Motion(
        [1, 0, 0, 0], [0, 0.2, 0, 150, 0, 9], np.zeros(n), np.zeros(n), [0.4] * 2, [0.5] * 2, [1.5] * 2
    )
    acceleration = forward_dynamics_crba(tree, motion, None, (0, 0, 9.81))
    scale = np.abs(acceleration.base).max()
    np.testing.assert_allclose(acceleration.base[[0, 2, 4]], 0, atol=1e-12 * scale)


def test_a_single_body_obeys_eulers_equations() -> None:
    """J omega_dot + omega x J omega = M and m (v_dot + omega x v) = F about the centre of mass."""
    rng = np.random.default_rng(3)
    full = reference_tree(1)
    tree = replace(
        full,
        **{
            name: getattr(full, name)[:1]
            for name in ("parent", "axis", "sign", "offset_P", "inertia", "coordinate", "hinge")
        },
    )
    motion = Motion(rng.normal(size=4), rng.normal(size=6), [], [], [], [], [])
    wrench = rng.normal(size=(1, 6))
    acceleration = forward_dynamics_crba(tree, motion, wrench).base
    J, mass = tree.inertia[0, :3, :3], tree.inertia[0, 3, 3]
    omega, v = motion.twist_B[:3], motion.twist_B[3:]
    # the terms that cancel are some thousand times the loads of order one
    close(J @ acceleration[:3] + np.cross(omega, J @ omega), wrench[0, :3], 1e-11)
    close(mass * (acceleration[3:] + np.cross(omega, v)), wrench[0, 3:], 1e-11)


def test_an_undamped_aircraft_keeps_energy_and_momentum_with_locked_wings() -> None:
    """Free flight without air, wings bent and let go: energy, linear and angular momentum stay.

    The explicit scheme's own energy error over this flight is below 1e-9 at this step; it falls 32-fold per
    halving.
    """
    tree = undamped(reference_tree(2))
    start = random_motion(np.random.default_rng(5), tree, angle_rad=0.05)
    start = replace(start, hinge_rate=np.zeros(2), hinge_acceleration=np.zeros(2))
    end = fly_crba(tree, start, quadratic_schedule(start), None, (0, 0, 0), 0.1, 1e-4)[-1]
    before, after = momentum(tree, start), momentum(tree, end)
    assert energy(tree, end).total == pytest.approx(energy(tree, start).total, rel=1e-8)
    assert energy(tree, end).elastic != pytest.approx(energy(tree, start).elastic, rel=0.1)
    close(after.linear_N, before.linear_N, 1e-10)
    close(after.angular_origin_N, before.angular_origin_N, 1e-10)


def test_a_morphing_aircraft_falls_on_a_parabola() -> None:
    """Whatever the hinge motors do, the centre of mass falls freely and angular momentum stays.

    The explicit scheme's error: 4e-8 m at 0.5 ms, falling 16-fold per halving.
    """
    tree = reference_tree(2)
    start = random_motion(np.random.default_rng(6), tree, angle_rad=0.05)
    gravity_N, time_s = np.array([0, 0, 9.81]), 0.2
    end = fly_crba(tree, start, quadratic_schedule(start), None, gravity_N, time_s, 2e-4)[-1]
    before, after = momentum(tree, start), momentum(tree, end)
    fallen = before.linear_N / before.mass * time_s + 0.5 * gravity_N * time_s**2
    np.testing.assert_allclose(after.centre_N - before.centre_N, fallen, atol=1e-8)
    close(after.angular_centre_N, before.angular_centre_N, 1e-8)


def test_shapes_that_do_not_fit_are_refused() -> None:
    """A wrench or state for another tree is an error that names the array, not a wrong answer."""
    tree = reference_tree(2)
    motion = random_motion(np.random.default_rng(0), tree)
    with pytest.raises(InvalidInput, match="wrench has shape"):
        forward_dynamics_crba(tree, motion, np.zeros((2, 6)))
    with pytest.raises(InvalidInput, match="q_joint has shape"):
        mass_matrix(tree, replace(motion, q_joint=np.zeros(3)))


SAY_ACCELERATIONS = """
import numpy as np
from tests.oracles.dynamics import forward_dynamics_crba, momentum, energy, mass_matrix
from tests.multibody.trees import random_motion, random_tree, random_wrench
rng = np.random.default_rng(11)
tree = random_tree(rng)
motion, wrench = random_motion(rng, tree), random_wrench(rng, tree)
a = forward_dynamics_crba(tree, motion, wrench, (0, 0, 9.81))
p = momentum(tree, motion)
answer = [*a.base, *a.joint, *p.linear_N, *p.angular_centre_N, energy(tree, motion).kinetic]
"""


def test_kernels_say_the_same_interpreted() -> None:
    """Compilation changes speed, not answers: the kernels run as plain Python too."""
    compiled: dict[str, list[float]] = {}
    exec(SAY_ACCELERATIONS, compiled)  # noqa: S102 - the same lines here and in the other interpreter
    script = SAY_ACCELERATIONS + "\nprint(*(float(x).hex() for x in answer))"
    done = subprocess.run(
        [sys.executable, "-c", script],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    interpreted = [float.fromhex(word) for word in done.stdout.split()]
    close(compiled["answer"], interpreted, 1e-12)
