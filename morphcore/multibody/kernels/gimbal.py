"""Gimbal joints of the articulated-body pass: flap (x), torsion (y), edgewise (z) in one joint.

A gimbal's scratch has ``JOINT_ROWS`` rows: rotation R child -> parent (9), S's second column's sine and
cosine (2), bias acceleration (6), U = I S (18), inverse of S^T I S + added diagonal (00 01 02 11 12 22), and
u = tau - S^T p (3).

The joint rates' projection is S = [R's first row; (sin e, cos e, 0); (0, 0, 1)]; e: edgewise angle.
"""

from __future__ import annotations

from morphcore.jit import kernel
from morphcore.lanes import not_in_lanes, sine_cosine
from morphcore.multibody.kernels.articulated import L_OFFSET, carry_lane, inverse_symmetric

JOINT_ROWS = 44


@kernel
def gimbal_twist(lanes, twist_parent, link, q, v, joint, twist):
    """Twist of a link from its parent's and its gimbal's motion; fills R, S and the bias acceleration.

    Bias: c = dS/dt qd + v x S qd; Featherstone (2008), equation 3.42.
    """
    if (
        not_in_lanes(twist_parent, lanes)
        or not_in_lanes(link, lanes)
        or not_in_lanes(q, lanes)
        or not_in_lanes(v, lanes)
    ):
        return
    if not_in_lanes(joint, lanes) or not_in_lanes(twist, lanes):
        return
    for l in range(len(lanes)):
        s1, c1 = sine_cosine(q[0, l])
        s2, c2 = sine_cosine(q[1, l])
        s3, c3 = sine_cosine(q[2, l])
        r00, r01, r02 = c2 * c3, -c2 * s3, s2
        r10, r11, r12 = c1 * s3 + s1 * s2 * c3, c1 * c3 - s1 * s2 * s3, -s1 * c2
        r20, r21, r22 = s1 * s3 - c1 * s2 * c3, s1 * c3 + c1 * s2 * s3, c1 * c2
        joint[0, l], joint[1, l], joint[2, l] = r00, r01, r02
        joint[3, l], joint[4, l], joint[5, l] = r10, r11, r12
        joint[6, l], joint[7, l], joint[8, l] = r20, r21, r22
        joint[9, l], joint[10, l] = s3, c3
        # parent's twist at the joint, in parent axes
        ax, ay, az = twist_parent[0, l], twist_parent[1, l], twist_parent[2, l]
        offset = link[L_OFFSET, l]
        bx = twist_parent[3, l] - az * offset
        by = twist_parent[4, l]
        bz = twist_parent[5, l] + ax * offset
        # rate of the joint in link axes
        v1, v2, v3 = v[0, l], v[1, l], v[2, l]
        jx = r00 * v1 + s3 * v2
        jy = r01 * v1 + c3 * v2
        jz = r02 * v1 + v3
        wx = r00 * ax + r10 * ay + r20 * az + jx
        wy = r01 * ax + r11 * ay + r21 * az + jy
        wz = r02 * ax + r12 * ay + r22 * az + jz
        ux = r00 * bx + r10 * by + r20 * bz
        uy = r01 * bx + r11 * by + r21 * bz
        uz = r02 * bx + r12 * by + r22 * bz
        twist[0, l], twist[1, l], twist[2, l] = wx, wy, wz
        twist[3, l], twist[4, l], twist[5, l] = ux, uy, uz
        dx = (-s2 * c3 * v2 - c2 * s3 * v3) * v1 + c3 * v3 * v2
        dy = (s2 * s3 * v2 - c2 * c3 * v3) * v1 - s3 * v3 * v2
        dz = c2 * v2 * v1
        joint[11, l] = wy * jz - wz * jy + dx
        joint[12, l] = wz * jx - wx * jz + dy
        joint[13, l] = wx * jy - wy * jx + dz
        joint[14, l] = uy * jz - uz * jy
        joint[15, l] = uz * jx - ux * jz
        joint[16, l] = ux * jy - uy * jx


@kernel
def vector_through_gimbal(lanes, joint, parent, own):
    """A vector (3 rows) in the parent's axes, in the link's."""
    if not_in_lanes(joint, lanes) or not_in_lanes(parent, lanes) or not_in_lanes(own, lanes):
        return
    for l in range(len(lanes)):
        x, y, z = parent[0, l], parent[1, l], parent[2, l]
        own[0, l] = joint[0, l] * x + joint[3, l] * y + joint[6, l] * z
        own[1, l] = joint[1, l] * x + joint[4, l] * y + joint[7, l] * z
        own[2, l] = joint[2, l] * x + joint[5, l] * y + joint[8, l] * z


@kernel
def eliminate_gimbal(lanes, tau, added, joint, inertia, force):
    """Articulate inertia and bias force through a gimbal: I - U D^-1 U^T and p + U D^-1 u.

    ``tau`` (3 rows) is the joint force, ``added`` (3 rows) the implicit step's addition to the joint-space
    diagonal.
    """
    if not_in_lanes(tau, lanes) or not_in_lanes(added, lanes) or not_in_lanes(joint, lanes):
        return
    if not_in_lanes(inertia, lanes) or not_in_lanes(force, lanes):
        return
    for l in range(len(lanes)):
        s10, s11, s12 = joint[0, l], joint[1, l], joint[2, l]
        s20, s21 = joint[9, l], joint[10, l]
        i0, i1, i2, i3, i4, i5 = (
            inertia[0, l], inertia[1, l], inertia[2, l], inertia[3, l], inertia[4, l], inertia[5, l],
        )  # fmt: skip
        b0, b1, b2 = inertia[6, l], inertia[7, l], inertia[8, l]
        b3, b4, b5 = inertia[9, l], inertia[10, l], inertia[11, l]
        b6, b7, b8 = inertia[12, l], inertia[13, l], inertia[14, l]
        # U = I S, columns flap (f), torsion (t), edgewise (g)
        f0, t0, g0 = i0 * s10 + i1 * s11 + i2 * s12, i0 * s20 + i1 * s21, i2
        f1, t1, g1 = i1 * s10 + i3 * s11 + i4 * s12, i1 * s20 + i3 * s21, i4
        f2, t2, g2 = i2 * s10 + i4 * s11 + i5 * s12, i2 * s20 + i4 * s21, i5
        f3, t3, g3 = b0 * s10 + b3 * s11 + b6 * s12, b0 * s20 + b3 * s21, b6
        f4, t4, g4 = b1 * s10 + b4 * s11 + b7 * s12, b1 * s20 + b4 * s21, b7
        f5, t5, g5 = b2 * s10 + b5 * s11 + b8 * s12, b2 * s20 + b5 * s21, b8
        joint[17, l], joint[18, l], joint[19, l] = f0, f1, f2
        joint[20, l], joint[21, l], joint[22, l] = f3, f4, f5
        joint[23, l], joint[24, l], joint[25, l] = t0, t1, t2
        joint[26, l], joint[27, l], joint[28, l] = t3, t4, t5
        joint[29, l], joint[30, l], joint[31, l] = g0, g1, g2
        joint[32, l], joint[33, l], joint[34, l] = g3, g4, g5
        d00 = s10 * f0 + s11 * f1 + s12 * f2 + added[0, l]
        d01 = s20 * f0 + s21 * f1
        d02 = f2
        d11 = s20 * t0 + s21 * t1 + added[1, l]
        d12 = t2
        d22 = g2 + added[2, l]
        m00, m01, m02, m11, m12, m22 = inverse_symmetric(d00, d01, d02, d11, d12, d22)
        joint[35, l], joint[36, l], joint[37, l] = m00, m01, m02
        joint[38, l], joint[39, l], joint[40, l] = m11, m12, m22
        p0, p1, p2 = force[0, l], force[1, l], force[2, l]
        u0 = tau[0, l] - (s10 * p0 + s11 * p1 + s12 * p2)
        u1 = tau[1, l] - (s20 * p0 + s21 * p1)
        u2 = tau[2, l] - p2
        joint[41, l], joint[42, l], joint[43, l] = u0, u1, u2
        x0 = m00 * u0 + m01 * u1 + m02 * u2
        x1 = m01 * u0 + m11 * u1 + m12 * u2
        x2 = m02 * u0 + m12 * u1 + m22 * u2
        force[0, l] = p0 + f0 * x0 + t0 * x1 + g0 * x2
        force[1, l] = p1 + f1 * x0 + t1 * x1 + g1 * x2
        force[2, l] = p2 + f2 * x0 + t2 * x1 + g2 * x2
        force[3, l] += f3 * x0 + t3 * x1 + g3 * x2
        force[4, l] += f4 * x0 + t4 * x1 + g4 * x2
        force[5, l] += f5 * x0 + t5 * x1 + g5 * x2
        # I -= W U^T with W = U D^-1
        a0, a1, a2 = (
            f0 * m00 + t0 * m01 + g0 * m02,
            f0 * m01 + t0 * m11 + g0 * m12,
            f0 * m02 + t0 * m12 + g0 * m22,
        )
        inertia[0, l] = i0 - (a0 * f0 + a1 * t0 + a2 * g0)
        inertia[1, l] = i1 - (a0 * f1 + a1 * t1 + a2 * g1)
        inertia[2, l] = i2 - (a0 * f2 + a1 * t2 + a2 * g2)
        inertia[6, l] = b0 - (a0 * f3 + a1 * t3 + a2 * g3)
        inertia[7, l] = b1 - (a0 * f4 + a1 * t4 + a2 * g4)
        inertia[8, l] = b2 - (a0 * f5 + a1 * t5 + a2 * g5)
        a0, a1, a2 = (
            f1 * m00 + t1 * m01 + g1 * m02,
            f1 * m01 + t1 * m11 + g1 * m12,
            f1 * m02 + t1 * m12 + g1 * m22,
        )
        inertia[3, l] = i3 - (a0 * f1 + a1 * t1 + a2 * g1)
        inertia[4, l] = i4 - (a0 * f2 + a1 * t2 + a2 * g2)
        inertia[9, l] = b3 - (a0 * f3 + a1 * t3 + a2 * g3)
        inertia[10, l] = b4 - (a0 * f4 + a1 * t4 + a2 * g4)
        inertia[11, l] = b5 - (a0 * f5 + a1 * t5 + a2 * g5)
        a0, a1, a2 = (
            f2 * m00 + t2 * m01 + g2 * m02,
            f2 * m01 + t2 * m11 + g2 * m12,
            f2 * m02 + t2 * m12 + g2 * m22,
        )
        inertia[5, l] = i5 - (a0 * f2 + a1 * t2 + a2 * g2)
        inertia[12, l] = b6 - (a0 * f3 + a1 * t3 + a2 * g3)
        inertia[13, l] = b7 - (a0 * f4 + a1 * t4 + a2 * g4)
        inertia[14, l] = b8 - (a0 * f5 + a1 * t5 + a2 * g5)
        a0, a1, a2 = (
            f3 * m00 + t3 * m01 + g3 * m02,
            f3 * m01 + t3 * m11 + g3 * m12,
            f3 * m02 + t3 * m12 + g3 * m22,
        )
        inertia[15, l] -= a0 * f3 + a1 * t3 + a2 * g3
        inertia[16, l] -= a0 * f4 + a1 * t4 + a2 * g4
        inertia[17, l] -= a0 * f5 + a1 * t5 + a2 * g5
        a0, a1, a2 = (
            f4 * m00 + t4 * m01 + g4 * m02,
            f4 * m01 + t4 * m11 + g4 * m12,
            f4 * m02 + t4 * m12 + g4 * m22,
        )
        inertia[18, l] -= a0 * f4 + a1 * t4 + a2 * g4
        inertia[19, l] -= a0 * f5 + a1 * t5 + a2 * g5
        a0, a1, a2 = (
            f5 * m00 + t5 * m01 + g5 * m02,
            f5 * m01 + t5 * m11 + g5 * m12,
            f5 * m02 + t5 * m12 + g5 * m22,
        )
        inertia[20, l] -= a0 * f5 + a1 * t5 + a2 * g5


@kernel
def carry_through_gimbal(lanes, link, joint, inertia, force):
    """Transform a link's accumulated inertia and force, in place, to its parent's axes and origin."""
    if (
        not_in_lanes(link, lanes)
        or not_in_lanes(joint, lanes)
        or not_in_lanes(inertia, lanes)
        or not_in_lanes(force, lanes)
    ):
        return
    for l in range(len(lanes)):
        r00, r01, r02 = joint[0, l], joint[1, l], joint[2, l]
        r10, r11, r12 = joint[3, l], joint[4, l], joint[5, l]
        r20, r21, r22 = joint[6, l], joint[7, l], joint[8, l]
        carry_lane(
            r00, r01, r02, r10, r11, r12, r20, r21, r22, 0.0, link[L_OFFSET, l], 0.0, inertia, force, l
        )


@kernel
def gimbal_acceleration(lanes, parent, link, joint, acceleration, joint_acceleration):
    """Joint accelerations D^-1 (u - U^T a) and the link's own acceleration."""
    if not_in_lanes(parent, lanes) or not_in_lanes(link, lanes) or not_in_lanes(joint, lanes):
        return
    if not_in_lanes(acceleration, lanes) or not_in_lanes(joint_acceleration, lanes):
        return
    for l in range(len(lanes)):
        r00, r01, r02 = joint[0, l], joint[1, l], joint[2, l]
        r10, r11, r12 = joint[3, l], joint[4, l], joint[5, l]
        r20, r21, r22 = joint[6, l], joint[7, l], joint[8, l]
        ax, ay, az = parent[0, l], parent[1, l], parent[2, l]
        offset = link[L_OFFSET, l]
        bx, by, bz = parent[3, l] - az * offset, parent[4, l], parent[5, l] + ax * offset
        wx = r00 * ax + r10 * ay + r20 * az
        wy = r01 * ax + r11 * ay + r21 * az
        wz = r02 * ax + r12 * ay + r22 * az
        ux = r00 * bx + r10 * by + r20 * bz
        uy = r01 * bx + r11 * by + r21 * bz
        uz = r02 * bx + r12 * by + r22 * bz
        u0 = joint[41, l] - (
            joint[17, l] * wx + joint[18, l] * wy + joint[19, l] * wz
            + joint[20, l] * ux + joint[21, l] * uy + joint[22, l] * uz
        )  # fmt: skip
        u1 = joint[42, l] - (
            joint[23, l] * wx + joint[24, l] * wy + joint[25, l] * wz
            + joint[26, l] * ux + joint[27, l] * uy + joint[28, l] * uz
        )  # fmt: skip
        u2 = joint[43, l] - (
            joint[29, l] * wx + joint[30, l] * wy + joint[31, l] * wz
            + joint[32, l] * ux + joint[33, l] * uy + joint[34, l] * uz
        )  # fmt: skip
        x0 = joint[35, l] * u0 + joint[36, l] * u1 + joint[37, l] * u2
        x1 = joint[36, l] * u0 + joint[38, l] * u1 + joint[39, l] * u2
        x2 = joint[37, l] * u0 + joint[39, l] * u1 + joint[40, l] * u2
        joint_acceleration[0, l], joint_acceleration[1, l], joint_acceleration[2, l] = x0, x1, x2
        s3, c3 = joint[9, l], joint[10, l]
        acceleration[0, l] = wx + joint[11, l] + r00 * x0 + s3 * x1
        acceleration[1, l] = wy + joint[12, l] + r01 * x0 + c3 * x1
        acceleration[2, l] = wz + joint[13, l] + r02 * x0 + x2
        acceleration[3, l] = ux + joint[14, l]
        acceleration[4, l] = uy + joint[15, l]
        acceleration[5, l] = uz + joint[16, l]
