"""Free flights in MuJoCo with profile drag on the links: wings forced by the air, prescribed hinges.

The dynamics are MuJoCo's alone (tests/multibody/mujoco_flight.py); the drag is implemented independently from
the velocities that MuJoCo reports.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from morphcore.frames import rotation_from_quaternion
from morphcore.simulate.schedule import Schedule
from tests.multibody.mujoco_flight import MujocoTree
from tests.oracles.tree import Tree

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Drag:
    """A drag area in m^2 on a body, at a point in its axes, m."""

    body: int
    area: float
    point: Array


class DraggedMujoco(MujocoTree):
    """A tree in moving air: every drag area is blown at with half rho v^2."""

    def __init__(
        self, tree: Tree, gravity_N: ArrayLike, drags: Sequence[Drag], density: float, wind_N: Array
    ) -> None:
        super().__init__(tree, gravity_N)
        self.drags, self.density, self.wind_N = drags, density, wind_N
        self.ids = dict(zip(self.bodies, self.body_ids, strict=True))

    def evaluate(
        self, position_N: Array, quaternion: Array, velocity: Array, hinge: tuple[Array, Array], wrench: Array
    ) -> tuple[Array, Array]:
        """As in the parent class, with the drag of this motion added to ``wrench``."""
        data = self.data
        data.qpos[:3], data.qpos[3:7] = position_N, quaternion / np.linalg.norm(quaternion)
        data.qpos[self.hinge_qpos], data.qvel[self.hinge_dof] = hinge
        data.qvel[self.unknown] = velocity
        mujoco.mj_fwdPosition(self.model, data)
        mujoco.mj_fwdVelocity(self.model, data)
        wrench = wrench.copy()
        twist = np.empty(6)
        for drag in self.drags:
            body = self.ids[drag.body]
            mujoco.mj_objectVelocity(self.model, self.data, mujoco.mjtObj.mjOBJ_XBODY, body, twist, 1)
            wind = self.data.xmat[body].reshape(3, 3).T @ self.wind_N
            v = twist[3:] + np.cross(twist[:3], drag.point) - wind
            force = -0.5 * self.density * drag.area * np.linalg.norm(v) * v
            wrench[drag.body] += np.concatenate([np.cross(drag.point, force), force])
        return super().evaluate(position_N, quaternion, velocity, hinge, wrench)


def fly_dragged(
    body: DraggedMujoco,
    state_B: Array,
    schedules: Sequence[Schedule],
    thrust: Array,
    duration_s: float,
    step_s: float,
    *,
    every: int,
) -> Array:
    """Quaternions and joint angles (k, 4 + n) along a flight, every so many steps, by Runge and Kutta.

    Parameters
    ----------
    state_B : first rows of the lanes' state: quaternion, omega_B, v_B, position_N, joint angles and rates.
    thrust : (6,) constant moment and force on the fuselage, in B, N m and N.
    """
    n = body.tree.coordinates
    wrench = np.zeros((body.tree.bodies, 6))
    wrench[0] = thrust
    R_NB = rotation_from_quaternion(state_B[:4])
    q_joint, v_joint = state_B[13 : 13 + n], state_B[13 + n : 13 + 2 * n]
    state = np.concatenate(
        [state_B[10:13], state_B[:4], q_joint, R_NB @ state_B[7:10], state_B[4:7], v_joint]
    )
    steps = round(duration_s / step_s)
    motions = [schedule.motion(0.5 * step_s * np.arange(2 * steps + 1)) for schedule in schedules]
    hinges = np.array([[m.angle, m.rate, m.acceleration] for m in motions]).T  # (times, 3, hinges)
    kept = [state]
    for i in range(steps):
        start, middle, end = (tuple(hinges[2 * i + part]) for part in range(3))
        k1 = body.derivative(state, start, wrench)
        k2 = body.derivative(state + 0.5 * step_s * k1, middle, wrench)
        k3 = body.derivative(state + 0.5 * step_s * k2, middle, wrench)
        k4 = body.derivative(state + step_s * k3, end, wrench)
        state = state + step_s / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        state[3:7] /= np.linalg.norm(state[3:7])
        if (i + 1) % every == 0:
            kept.append(state)
    history = np.array(kept)
    return history[:, 3 : 7 + n]
