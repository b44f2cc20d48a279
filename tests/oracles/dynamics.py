"""Dynamics of a tree by the textbook algorithms: slow, small, and the measure of the production solver.

Forces from motion by the recursive Newton-Euler algorithm, the mass matrix by the composite rigid body
algorithm, accelerations by solving the dense system. The hinges are prescribed: their accelerations are
given, the torques that this takes are results (hybrid dynamics, Featherstone (2008), section 9.1).

Base twist: [omega_B; v_B], rad/s and m/s, velocity of the fuselage reference point in body axes. Base
acceleration: the time derivative of those six components (the spatial acceleration of Featherstone (2008),
section 2.11), so that the classical acceleration of the reference point is ``v_dot + omega x v``. Springs and
dampers act in the free joints: tau = -k q - c v.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from morphcore.errors import InvalidInput
from morphcore.frames import rotation_from_quaternion
from tests.oracles.kernels.crba import composite_mass_matrix
from tests.oracles.kernels.energy import (
    body_velocities,
    kinetic_energy,
    mass_and_moment,
    momentum_about_base,
    poses_in_base,
)
from tests.oracles.kernels.rnea import joint_forces
from tests.oracles.kernels.spatial import joint_rotations
from tests.oracles.tree import Tree

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Motion:
    """Where a tree is and how it moves: the state, and the hinges' prescribed motion at this instant.

    Attributes (n free joint coordinates, m hinges)
    ----------
    quaternion : (4,) of R_NB, (w, x, y, z); normalised on use.
    twist_B : (6,) base twist [omega_B; v_B], rad/s and m/s.
    q_joint, v_joint : (n,) rad and rad/s.
    hinge_angle, hinge_rate, hinge_acceleration : (m,) rad, rad/s, rad/s^2.
    position_N : (3,) of the fuselage reference point, m; only gravity's energy and the angular momentum about
        N's origin depend on it.
    """

    quaternion: Array
    twist_B: Array
    q_joint: Array
    v_joint: Array
    hinge_angle: Array
    hinge_rate: Array
    hinge_acceleration: Array
    position_N: Array

    def __init__(
        self,
        quaternion: ArrayLike,
        twist_B: ArrayLike,
        q_joint: ArrayLike,
        v_joint: ArrayLike,
        hinge_angle: ArrayLike,
        hinge_rate: ArrayLike,
        hinge_acceleration: ArrayLike,
        position_N: ArrayLike = (0.0, 0.0, 0.0),
    ) -> None:
        given = (
            quaternion, twist_B, q_joint, v_joint, hinge_angle, hinge_rate, hinge_acceleration, position_N,
        )  # fmt: skip
        for field, value in zip(fields(self), given, strict=True):
            array = np.array(value, dtype=np.float64)
            array.setflags(write=False)
            object.__setattr__(self, field.name, array)

    @property
    def R_NB(self) -> Array:
        """Attitude, (3, 3)."""
        return rotation_from_quaternion(self.quaternion / np.linalg.norm(self.quaternion))


@dataclass(frozen=True)
class Effort:
    """What a motion takes besides springs, dampers, gravity and the given external wrenches.

    ``base_wrench_B`` (6,) [moment; force] on the base at its origin; ``joint_torque`` (n,) and
    ``hinge_torque`` (m,) along the positive joint coordinates, N m and N.
    """

    base_wrench_B: Array
    joint_torque: Array
    hinge_torque: Array


@dataclass(frozen=True)
class Acceleration:
    """``base`` (6,), derivative of the base twist's components; ``joint`` (n,), rad/s^2 and m/s^2."""

    base: Array
    joint: Array


@dataclass(frozen=True)
class Energy:
    """Energies in J; the gravitational one is relative to N's origin."""

    kinetic: float
    gravitational: float
    elastic: float

    @property
    def total(self) -> float:
        """Sum of the three."""
        return self.kinetic + self.gravitational + self.elastic


@dataclass(frozen=True)
class Momentum:
    """Momentum of the whole tree in N, with its mass and centre of mass.

    ``linear_N`` N s; ``angular_centre_N`` about the total centre of mass and ``angular_origin_N`` about N's
    origin, N m s; ``mass`` kg; ``centre_N`` m.
    """

    linear_N: Array
    angular_centre_N: Array
    angular_origin_N: Array
    mass: float
    centre_N: Array


def inverse_dynamics(
    tree: Tree,
    motion: Motion,
    acceleration: Acceleration,
    wrench: ArrayLike | None = None,
    gravity_N: ArrayLike = (0.0, 0.0, 0.0),
) -> Effort:
    """The effort that a motion takes.

    Recursive Newton-Euler algorithm, Featherstone (2008), table 5.1.

    Parameters
    ----------
    acceleration : of base and free joints; that of the hinges is in ``motion``.
    wrench : (b, 6) external wrench [moment; force] on every body, in its axes at its origin, N m and N; None
        for none.
    gravity_N : (3,) m/s^2.

    Raises
    ------
    InvalidInput : an array's shape does not fit the tree.
    """
    _check(tree, motion)
    base_acceleration = _shaped("base", acceleration.base, (6,))
    joint_acceleration = _shaped("joint", acceleration.joint, (tree.coordinates,))
    forces = _wrenches(tree, wrench)
    base_acceleration[3:] -= motion.R_NB.T @ _shaped("gravity_N", gravity_N, (3,))
    transmitted = np.empty((tree.bodies, 6))
    joint_forces(
        tree.parent,
        tree.axis,
        tree.sign,
        tree.offset_P,
        tree.inertia,
        _rotations(tree, motion),
        _per_body(tree, motion.v_joint, motion.hinge_rate),
        _per_body(tree, joint_acceleration, motion.hinge_acceleration),
        motion.twist_B,
        base_acceleration,
        forces,
        np.empty((tree.bodies, 6)),
        np.empty((tree.bodies, 6)),
        np.empty((1, 6)),
        transmitted,
    )
    bodies = np.arange(tree.bodies)
    along_axis = tree.sign * transmitted[bodies, np.maximum(tree.axis, 0)]
    joint_torque, hinge_torque = np.empty(tree.coordinates), np.empty(tree.hinges)
    free, prescribed = tree.coordinate >= 0, tree.hinge >= 0
    joint_torque[tree.coordinate[free]] = along_axis[free]
    hinge_torque[tree.hinge[prescribed]] = along_axis[prescribed]
    joint_torque += tree.stiffness * motion.q_joint + tree.damping * motion.v_joint
    return Effort(transmitted[0], joint_torque, hinge_torque)


def mass_matrix(tree: Tree, motion: Motion) -> Array:
    """Mass matrix (6 + n, 6 + n) of [base twist; free joint rates], by the composite rigid body algorithm.

    Featherstone (2008), table 6.2; only the angles in ``motion`` matter.
    """
    _check(tree, motion)
    size = 6 + tree.coordinates
    matrix = np.empty((size, size))
    composite_mass_matrix(
        tree.parent,
        tree.axis,
        tree.sign,
        tree.offset_P,
        tree.inertia,
        tree.coordinate,
        _rotations(tree, motion),
        np.empty((tree.bodies, 6, 6)),
        np.empty((4, 6)),
        matrix,
    )
    return matrix


def bias(
    tree: Tree, motion: Motion, wrench: ArrayLike | None = None, gravity_N: ArrayLike = (0.0, 0.0, 0.0)
) -> Array:
    """The h of M a + h = 0, (6 + n,).

    Velocity terms, hinge accelerations, springs, dampers, gravity and wrenches. Featherstone (2008), equation
    6.2: inverse dynamics at zero acceleration of the unknowns.
    """
    effort = inverse_dynamics(
        tree, motion, Acceleration(np.zeros(6), np.zeros(tree.coordinates)), wrench, gravity_N
    )
    return np.concatenate([effort.base_wrench_B, effort.joint_torque])


def forward_dynamics_crba(
    tree: Tree, motion: Motion, wrench: ArrayLike | None = None, gravity_N: ArrayLike = (0.0, 0.0, 0.0)
) -> Acceleration:
    """Accelerations of base and free joints under external wrenches (b, 6), as in ``inverse_dynamics``.

    Solves M a = -h densely: O((6 + n)^3), for tests. Featherstone (2008), section 6.1.
    """
    force = -bias(tree, motion, wrench, gravity_N)
    solution: Array = np.linalg.solve(mass_matrix(tree, motion), force).astype(np.float64)
    return Acceleration(base=solution[:6], joint=solution[6:])


def hinge_torque(
    tree: Tree, motion: Motion, wrench: ArrayLike | None = None, gravity_N: ArrayLike = (0.0, 0.0, 0.0)
) -> Array:
    """Torque (m,), N m, of the hinge motors along the positive hinge coordinates."""
    acceleration = forward_dynamics_crba(tree, motion, wrench, gravity_N)
    return inverse_dynamics(tree, motion, acceleration, wrench, gravity_N).hinge_torque


def energy(tree: Tree, motion: Motion, gravity_N: ArrayLike = (0.0, 0.0, 0.0)) -> Energy:
    """Kinetic, gravitational and elastic energy of the tree."""
    velocity = body_twists(tree, motion)
    total = momentum(tree, motion)
    return Energy(
        kinetic=float(kinetic_energy(tree.inertia, velocity, np.empty((1, 6)))),
        gravitational=float(-total.mass * (_shaped("gravity_N", gravity_N, (3,)) @ total.centre_N)),
        elastic=float(0.5 * np.sum(tree.stiffness * motion.q_joint**2)),
    )


def momentum(tree: Tree, motion: Motion) -> Momentum:
    """Linear and angular momentum of the tree, body by body."""
    rotations = _rotations(tree, motion)
    R_BX, r_B = np.empty((tree.bodies, 3, 3)), np.empty((tree.bodies, 3))
    poses_in_base(tree.parent, tree.offset_P, rotations, R_BX, r_B)
    about_base, moments = np.empty(6), np.empty(4)
    momentum_about_base(tree.inertia, body_twists(tree, motion), R_BX, r_B, np.empty((1, 6)), about_base)
    mass_and_moment(tree.inertia, R_BX, r_B, moments)
    mass = float(moments[0])
    R_NB = motion.R_NB
    arm_N = R_NB @ (moments[1:] / mass)
    linear_N, angular_N = R_NB @ about_base[3:], R_NB @ about_base[:3]
    return Momentum(
        linear_N=linear_N,
        angular_centre_N=angular_N - np.cross(arm_N, linear_N),
        angular_origin_N=angular_N + np.cross(motion.position_N, linear_N),
        mass=mass,
        centre_N=motion.position_N + arm_N,
    )


def body_poses(tree: Tree, motion: Motion) -> tuple[Array, Array]:
    """Attitude R_NX (b, 3, 3) and origin r_N (b, 3), m, of every body."""
    _check(tree, motion)
    R_BX, r_B = np.empty((tree.bodies, 3, 3)), np.empty((tree.bodies, 3))
    poses_in_base(tree.parent, tree.offset_P, _rotations(tree, motion), R_BX, r_B)
    return motion.R_NB @ R_BX, motion.position_N + r_B @ motion.R_NB.T


def body_twists(tree: Tree, motion: Motion) -> Array:
    """Spatial velocity (b, 6) [omega; v] of every body in its own axes at its origin, rad/s and m/s."""
    _check(tree, motion)
    velocity = np.empty((tree.bodies, 6))
    body_velocities(
        tree.parent,
        tree.axis,
        tree.sign,
        tree.offset_P,
        _rotations(tree, motion),
        _per_body(tree, motion.v_joint, motion.hinge_rate),
        motion.twist_B,
        velocity,
    )
    return velocity


def _rotations(tree: Tree, motion: Motion) -> Array:
    rotations = np.empty((tree.bodies, 3, 3))
    joint_rotations(tree.axis, tree.sign, _per_body(tree, motion.q_joint, motion.hinge_angle), rotations)
    return rotations


def _per_body(tree: Tree, of_coordinates: Array, of_hinges: Array) -> Array:
    """Scatter joint values (n,) and hinge values (m,) to the bodies they move, (b,)."""
    values = np.zeros(tree.bodies)
    free, prescribed = tree.coordinate >= 0, tree.hinge >= 0
    values[free] = of_coordinates[tree.coordinate[free]]
    values[prescribed] = of_hinges[tree.hinge[prescribed]]
    return values


def _wrenches(tree: Tree, wrench: ArrayLike | None) -> Array:
    if wrench is None:
        return np.zeros((tree.bodies, 6))
    return _shaped("wrench", wrench, (tree.bodies, 6))


def _shaped(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Array:
    array = np.array(value, dtype=np.float64, order="C")
    if array.shape != shape:
        raise InvalidInput(f"{name} has shape {array.shape}", hint=f"this tree needs {shape}")
    return array


def _check(tree: Tree, motion: Motion) -> None:
    n, m = tree.coordinates, tree.hinges
    shapes = ((4,), (6,), (n,), (n,), (m,), (m,), (m,), (3,))
    for field, shape in zip(fields(motion), shapes, strict=True):
        _shaped(field.name, getattr(motion, field.name), shape)
