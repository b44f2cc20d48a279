"""Spatial algebra in body coordinates: one body at a time, angular part first.

A motion vector is [omega; v] in rad/s and m/s, a force vector [n; f] in N m and N, both at the body's origin
and in its axes. Featherstone (2008), chapter 2. Body C hangs on its parent P: ``R_PC`` (3, 3) takes
components in C to components in P, ``offset_P`` (3,) is the origin of C from that of P in the axes of P, m.
"""

from __future__ import annotations

import math

from morphcore.jit import entry_kernel, kernel


@kernel
def axis_rotation(axis, angle, out):
    """R_PC of a revolute joint: right-handed rotation by ``angle`` (rad) about coordinate axis 0, 1 or 2."""
    c, s = math.cos(angle), math.sin(angle)
    j, k = (axis + 1) % 3, (axis + 2) % 3
    for row in range(3):
        for column in range(3):
            out[row, column] = 0.0
    out[axis, axis] = 1.0
    out[j, j] = c
    out[k, k] = c
    out[j, k] = -s
    out[k, j] = s


@entry_kernel
def joint_rotations(axis, sign, angle, out):
    """R_PC of every body, (b, 3, 3), from joint coordinates (b,) in rad; the base's is the identity."""
    for body in range(axis.size):
        if axis[body] < 0:
            axis_rotation(0, 0.0, out[body])
        else:
            axis_rotation(axis[body], sign[body] * angle[body], out[body])


@kernel
def motion_to_child(R_PC, offset_P, motion_P, out):
    """Move a motion vector from the parent's frame to the child's. Featherstone (2008), table 2.1."""
    wx, wy, wz = motion_P[0], motion_P[1], motion_P[2]
    x, y, z = offset_P[0], offset_P[1], offset_P[2]
    vx = motion_P[3] + wy * z - wz * y
    vy = motion_P[4] + wz * x - wx * z
    vz = motion_P[5] + wx * y - wy * x
    for i in range(3):
        out[i] = R_PC[0, i] * wx + R_PC[1, i] * wy + R_PC[2, i] * wz
        out[3 + i] = R_PC[0, i] * vx + R_PC[1, i] * vy + R_PC[2, i] * vz


@kernel
def add_force_to_parent(R_PC, offset_P, force_C, out):
    """Add a force vector, moved from the child's frame to the parent's. Same table, transposed."""
    fx = R_PC[0, 0] * force_C[3] + R_PC[0, 1] * force_C[4] + R_PC[0, 2] * force_C[5]
    fy = R_PC[1, 0] * force_C[3] + R_PC[1, 1] * force_C[4] + R_PC[1, 2] * force_C[5]
    fz = R_PC[2, 0] * force_C[3] + R_PC[2, 1] * force_C[4] + R_PC[2, 2] * force_C[5]
    x, y, z = offset_P[0], offset_P[1], offset_P[2]
    out[0] += R_PC[0, 0] * force_C[0] + R_PC[0, 1] * force_C[1] + R_PC[0, 2] * force_C[2] + y * fz - z * fy
    out[1] += R_PC[1, 0] * force_C[0] + R_PC[1, 1] * force_C[1] + R_PC[1, 2] * force_C[2] + z * fx - x * fz
    out[2] += R_PC[2, 0] * force_C[0] + R_PC[2, 1] * force_C[1] + R_PC[2, 2] * force_C[2] + x * fy - y * fx
    out[3] += fx
    out[4] += fy
    out[5] += fz


@kernel
def inertia_times(inertia, motion, out):
    """Spatial momentum or inertial force, (6,), of a (6, 6) inertia."""
    for row in range(6):
        total = 0.0
        for column in range(6):
            total += inertia[row, column] * motion[column]
        out[row] = total


@kernel
def add_inertia_to_parent(R_PC, offset_P, inertia_C, scratch, out):
    """Add X^T I X, the child's (6, 6) inertia seen from the parent's origin.

    Featherstone (2008), equation 2.66. Column by column: the force that answers a unit motion of the parent.
    ``scratch`` is (4, 6).
    """
    unit, motion_C, force_C, force_P = scratch[0], scratch[1], scratch[2], scratch[3]
    for column in range(6):
        for i in range(6):
            unit[i] = 0.0
            force_P[i] = 0.0
        unit[column] = 1.0
        motion_to_child(R_PC, offset_P, unit, motion_C)
        inertia_times(inertia_C, motion_C, force_C)
        add_force_to_parent(R_PC, offset_P, force_C, force_P)
        for row in range(6):
            out[row, column] += force_P[row]


@kernel
def add_cross_motion(velocity, motion, out):
    """Add velocity x motion. Featherstone (2008), equation 2.31."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        out[i] += velocity[j] * motion[k] - velocity[k] * motion[j]
        out[3 + i] += velocity[j] * motion[3 + k] - velocity[k] * motion[3 + j]
        out[3 + i] += velocity[3 + j] * motion[k] - velocity[3 + k] * motion[j]


@kernel
def add_cross_force(velocity, force, out):
    """Add velocity x* force. Featherstone (2008), equation 2.32."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        out[i] += velocity[j] * force[k] - velocity[k] * force[j]
        out[i] += velocity[3 + j] * force[3 + k] - velocity[3 + k] * force[3 + j]
        out[3 + i] += velocity[j] * force[3 + k] - velocity[k] * force[3 + j]
