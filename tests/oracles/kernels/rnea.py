"""Recursive Newton-Euler algorithm on a floating base: forces from motion, O(bodies)."""

from __future__ import annotations

from morphcore.jit import entry_kernel
from tests.oracles.kernels.spatial import (
    add_cross_force,
    add_cross_motion,
    add_force_to_parent,
    inertia_times,
    motion_to_child,
)


@entry_kernel
def joint_forces(
    parent,
    axis,
    sign,
    offset_P,
    inertia,
    rotation,
    rate,
    acceleration,
    base_velocity,
    base_acceleration,
    wrench,
    velocity,
    spatial_acceleration,
    scratch,
    out,
):
    """Force that each body receives through its joint, for a given motion of the whole tree.

    Featherstone (2008), table 5.1 in body coordinates, with the base moving freely (section 9.3).

    Parameters
    ----------
    parent, axis, sign, offset_P, inertia : as in ``Tree``.
    rotation : (b, 3, 3), R_PC of every joint.
    rate, acceleration : (b,) of the joint coordinates, rad/s and rad/s^2; the base's entries are not read.
    base_velocity : (6,), spatial velocity of the base in its axes.
    base_acceleration : (6,), its derivative in those axes *less gravity's* (Featherstone's trick: gravity
        enters as an upward acceleration of the base).
    wrench : (b, 6), external force on every body at its origin and in its axes, N m and N; gravity excluded.
    velocity, spatial_acceleration : (b, 6) workspace; afterwards the spatial velocities and accelerations of
        all bodies.
    scratch : (1, 6) workspace.
    out : (b, 6), force transmitted from parent to body at the body's origin; row 0 is what must act on the
        base besides ``wrench`` and gravity.
    """
    momentum = scratch[0]
    # root -> tips: velocities, accelerations and each body's own equation of motion
    for body in range(parent.size):
        if body == 0:
            for i in range(6):
                velocity[0, i] = base_velocity[i]
                spatial_acceleration[0, i] = base_acceleration[i]
        else:
            a = axis[body]
            above = parent[body]
            joint_rate = sign[body] * rate[body]
            motion_to_child(rotation[body], offset_P[body], velocity[above], velocity[body])
            motion_to_child(
                rotation[body], offset_P[body], spatial_acceleration[above], spatial_acceleration[body]
            )
            # the joint axis turns with the body: v x (S rate); v may still lack S rate, as S x S = 0
            for i in range(6):
                momentum[i] = 0.0
            momentum[a] = joint_rate
            add_cross_motion(velocity[body], momentum, spatial_acceleration[body])
            spatial_acceleration[body, a] += sign[body] * acceleration[body]
            velocity[body, a] += joint_rate
        inertia_times(inertia[body], spatial_acceleration[body], out[body])
        inertia_times(inertia[body], velocity[body], momentum)
        add_cross_force(velocity[body], momentum, out[body])
        for i in range(6):
            out[body, i] -= wrench[body, i]
    # tips -> root: every joint carries what hangs on it
    for body in range(parent.size - 1, 0, -1):
        add_force_to_parent(rotation[body], offset_P[body], out[body], out[parent[body]])
