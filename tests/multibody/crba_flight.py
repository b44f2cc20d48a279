"""Free flights of a tree with the library's dense dynamics and small explicit steps: slow and simple."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tests.oracles.dynamics import Motion, forward_dynamics_crba
from tests.oracles.tree import Tree

Array = NDArray[np.float64]
HingeSchedule = Callable[[float], tuple[Array, Array, Array]]


def quadratic_schedule(motion: Motion) -> HingeSchedule:
    """Hinge motion that goes on from ``motion`` at t = 0 with constant acceleration."""
    angle, rate, acceleration = motion.hinge_angle, motion.hinge_rate, motion.hinge_acceleration
    return lambda t: (angle + rate * t + 0.5 * acceleration * t**2, rate + acceleration * t, acceleration)


def at_time(motion: Motion, schedule: HingeSchedule, time_s: float) -> Motion:
    """The same state with the hinge motion of ``time_s``."""
    angle, rate, acceleration = schedule(time_s)
    return replace(motion, hinge_angle=angle, hinge_rate=rate, hinge_acceleration=acceleration)


def runge_kutta_step(
    tree: Tree,
    motion: Motion,
    schedule: HingeSchedule,
    time_s: float,
    step_s: float,
    wrench: ArrayLike | None,
    gravity_N: ArrayLike,
) -> Motion:
    """One step of the classical scheme of order four; ``step_s`` may be negative."""

    def rates(part: float, slope: Array | None) -> Array:
        here = motion if slope is None else _moved(motion, part * step_s * slope)
        here = at_time(here, schedule, time_s + part * step_s)
        acceleration = forward_dynamics_crba(tree, here, wrench, gravity_N)
        w, v = here.quaternion[0], here.quaternion[1:]
        omega, v_B = here.twist_B[:3], here.twist_B[3:]
        quaternion_rate = 0.5 * np.concatenate([[-v @ omega], w * omega + np.cross(v, omega)])
        return np.concatenate(
            [here.R_NB @ v_B, quaternion_rate, here.v_joint, acceleration.base, acceleration.joint]
        )

    k1 = rates(0.0, None)
    k2 = rates(0.5, k1)
    k3 = rates(0.5, k2)
    k4 = rates(1.0, k3)
    after = _moved(motion, step_s / 6 * (k1 + 2 * k2 + 2 * k3 + k4))
    after = replace(after, quaternion=after.quaternion / np.linalg.norm(after.quaternion))
    return at_time(after, schedule, time_s + step_s)


def fly_crba(
    tree: Tree,
    initial: Motion,
    schedule: HingeSchedule,
    wrench_B: ArrayLike | None,
    gravity_N: ArrayLike,
    duration_s: float,
    step_s: float,
) -> list[Motion]:
    """All motions of a flight, the first and the last included."""
    motions = [at_time(initial, schedule, 0.0)]
    for i in range(round(duration_s / step_s)):
        motions.append(runge_kutta_step(tree, motions[-1], schedule, i * step_s, step_s, wrench_B, gravity_N))
    return motions


def _moved(motion: Motion, by: Array) -> Motion:
    n = motion.q_joint.size
    position, quaternion, q_joint, twist, v_joint = np.split(by, [3, 7, 7 + n, 13 + n])
    return replace(
        motion,
        position_N=motion.position_N + position,
        quaternion=motion.quaternion + quaternion,
        q_joint=motion.q_joint + q_joint,
        twist_B=motion.twist_B + twist,
        v_joint=motion.v_joint + v_joint,
    )
