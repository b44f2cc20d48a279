"""Free flights of a tree in MuJoCo, to hold other integrators against.

MuJoCo gives the mass matrix and all forces of the exported model. The hinges' accelerations are prescribed,
the other ones follow from the remaining rows (hybrid dynamics), and a classical Runge-Kutta scheme of order
four with small steps integrates them. None of our own dynamics takes part.
"""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from morphcore.frames import rotation_from_quaternion
from tests.oracles.dynamics import Motion
from tests.oracles.mjcf import mjcf
from tests.oracles.tree import Tree

Array = NDArray[np.float64]
HingeSchedule = Callable[[float], tuple[Array, Array, Array]]


class MujocoTree:
    """A tree in MuJoCo, its state set and read in our conventions."""

    def __init__(self, tree: Tree, gravity_N: ArrayLike) -> None:
        self.tree = tree
        self.model = mujoco.MjModel.from_xml_string(mjcf(tree, gravity_N=gravity_N))
        self.data = mujoco.MjData(self.model)

        def addresses(prefix: str, count: int) -> list[int]:
            return [self.model.joint(f"{prefix}_{i}").id for i in range(count)]

        joints, hinges = addresses("joint", tree.coordinates), addresses("hinge", tree.hinges)
        self.joint_qpos, self.joint_dof = self.model.jnt_qposadr[joints], self.model.jnt_dofadr[joints]
        self.hinge_qpos, self.hinge_dof = self.model.jnt_qposadr[hinges], self.model.jnt_dofadr[hinges]
        self.unknown = np.concatenate([np.arange(6), self.joint_dof]).astype(int)
        self.bodies = [b for b in range(tree.bodies) if tree.inertia[b, 3, 3] > 0]
        self.body_ids = [self.model.body(f"body_{b}").id for b in self.bodies]

    def evaluate(
        self, position_N: Array, quaternion: Array, velocity: Array, hinge: tuple[Array, Array], wrench: Array
    ) -> tuple[Array, Array]:
        """Mass matrix and generalized force of all MuJoCo's degrees of freedom.

        ``velocity`` is [v_N, omega_B, free joint rates], ``hinge`` angles and rates, ``wrench`` (b, 6) in
        body axes at the bodies' origins. Joint angles are to be set in ``data.qpos`` before.
        """
        data = self.data
        data.qpos[:3], data.qpos[3:7] = position_N, quaternion / np.linalg.norm(quaternion)
        data.qpos[self.hinge_qpos], data.qvel[self.hinge_dof] = hinge
        data.qvel[self.unknown] = velocity
        mujoco.mj_forward(self.model, data)
        force = data.qfrc_passive - data.qfrc_bias
        applied = np.zeros(self.model.nv)
        for b, i in zip(self.bodies, self.body_ids, strict=True):
            if np.any(wrench[b]):
                R_NX = data.xmat[i].reshape(3, 3)
                mujoco.mj_applyFT(
                    self.model, data, R_NX @ wrench[b, 3:], R_NX @ wrench[b, :3], data.xpos[i], i, applied
                )
        matrix = np.empty((self.model.nv, self.model.nv))
        for column, unit in enumerate(np.eye(self.model.nv)):
            mujoco.mj_mulM(self.model, data, matrix[column], unit)
        return matrix, force + applied

    def equations(self, motion: Motion, wrench: Array) -> tuple[Array, Array]:
        """M and h of ``M a + h = 0`` in our unknowns [base twist derivative, free joint accelerations].

        MuJoCo's base velocity is [v_N, omega_B] = T [omega_B, v_B]; its derivative is T (a + [0, omega x v]).
        """
        self.data.qpos[self.joint_qpos] = motion.q_joint
        R_NB, omega_B, v_B = motion.R_NB, motion.twist_B[:3], motion.twist_B[3:]
        velocity = np.concatenate([R_NB @ v_B, omega_B, motion.v_joint])
        matrix, force = self.evaluate(
            motion.position_N, motion.quaternion, velocity, (motion.hinge_angle, motion.hinge_rate), wrench
        )
        size = self.unknown.size
        T = np.eye(size)
        T[:3, :3], T[:3, 3:6], T[3:6, :3], T[3:6, 3:6] = 0, R_NB, np.eye(3), 0
        M_known = matrix[np.ix_(self.unknown, self.hinge_dof)]
        M = matrix[np.ix_(self.unknown, self.unknown)]
        turning = np.zeros(size)
        turning[:3] = R_NB @ np.cross(omega_B, v_B)
        h = M @ turning + M_known @ motion.hinge_acceleration - force[self.unknown]
        return T.T @ M @ T, T.T @ h

    def derivative(self, state: Array, hinge: tuple[Array, Array, Array], wrench: Array) -> Array:
        """Time derivative of [position_N, quaternion, q_joint, v_N, omega_B, v_joint]."""
        n = self.tree.coordinates
        position, quaternion, q_joint, velocity = np.split(state, [3, 7, 7 + n])
        self.data.qpos[self.joint_qpos] = q_joint
        angle, rate, acceleration = hinge
        matrix, force = self.evaluate(position, quaternion, velocity, (angle, rate), wrench)
        known = matrix[np.ix_(self.unknown, self.hinge_dof)] @ acceleration
        solution = np.linalg.solve(matrix[np.ix_(self.unknown, self.unknown)], force[self.unknown] - known)
        w, v = quaternion[0], quaternion[1:]
        omega = velocity[3:6]
        quaternion_rate = 0.5 * np.concatenate([[-v @ omega], w * omega + np.cross(v, omega)])
        return np.concatenate([velocity[:3], quaternion_rate, velocity[6:], solution])


def fly_mujoco(
    tree: Tree,
    initial: Motion,
    hinge_schedule: HingeSchedule,
    wrench_B: Array,
    gravity_N: ArrayLike,
    duration_s: float,
    step_s: float,
    *,
    every: int = 1,
) -> tuple[Array, Array, Array, Array]:
    """Fly from ``initial`` with prescribed hinges and constant wrenches.

    ``wrench_B`` is (b, 6), [moment; force] in each body's axes at its origin, N m and N.
    ``hinge_schedule(t)`` gives angle, rate and acceleration, (m,) each, in rad, rad/s, rad/s^2; the hinge
    motion in ``initial`` is not read. ``every`` thins the output. Explicit steps: stay below 2.7 times the
    fastest time constant.

    Returns
    -------
    times (k,), quaternion (k, 4), position_N (k, 3), q_joint (k, n)
    """
    wrench = np.asarray(wrench_B, dtype=np.float64)
    massless = tree.inertia[:, 3, 3] == 0
    if np.any(wrench[massless]):
        raise ValueError("MuJoCo has no massless bodies to put a wrench on")
    body = MujocoTree(tree, gravity_N)
    n = tree.coordinates
    state = np.concatenate(
        [
            initial.position_N,
            initial.quaternion,
            initial.q_joint,
            rotation_from_quaternion(initial.quaternion) @ initial.twist_B[3:],
            initial.twist_B[:3],
            initial.v_joint,
        ]
    )
    steps = round(duration_s / step_s)
    states = [state]
    for i in range(steps):
        start, middle, end = (hinge_schedule((i + part) * step_s) for part in (0.0, 0.5, 1.0))
        k1 = body.derivative(state, start, wrench)
        k2 = body.derivative(state + 0.5 * step_s * k1, middle, wrench)
        k3 = body.derivative(state + 0.5 * step_s * k2, middle, wrench)
        k4 = body.derivative(state + step_s * k3, end, wrench)
        state = state + step_s / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        state[3:7] /= np.linalg.norm(state[3:7])
        if (i + 1) % every == 0 or i + 1 == steps:
            states.append(state)
    kept = [0, *(i + 1 for i in range(steps) if (i + 1) % every == 0 or i + 1 == steps)]
    history = np.array(states)
    return np.array(kept) * step_s, history[:, 3:7], history[:, :3], history[:, 7 : 7 + n]
