"""Articulated-body algorithm over lanes: chains of links on gimbals, on hinges of prescribed motion.

Featherstone (2008), table 7.1 (articulated bodies) and section 9.2 (hybrid dynamics), with the three
revolutes of a gimbal joined into one joint of three degrees of freedom, which is the same by elimination of
its massless frames.

Rows of the lane arrays ((rows, LANES), see lanes.py):

- twist, spatial acceleration, wrench: 6 rows, angular part first, in link axes at the link's origin;
- inertia: 21 rows: angular block A (00 01 02 11 12 22), coupling block B (row by row, 9), linear block L (as
  A);
- joint scratch: ``JOINT_ROWS`` rows: rotation R child -> parent (9), S's second column's sine and cosine (2),
  bias acceleration (6), U = I S (18), inverse of S^T I S + added diagonal (00 01 02 11 12 22), and u = tau -
  S^T p (3).

The joint rates' projection is S = [R's first row; (sin lag, cos lag, 0); (0, 0, 1)] in link axes.
"""

from __future__ import annotations

from morphcore.jit import inlined, kernel
from morphcore.lanes import LANES, not_in_lanes, sine_cosine

JOINT_ROWS = 44
J_R, J_SINE, J_BIAS, J_U, J_INVERSE, J_FORCE = 0, 9, 11, 17, 35, 41
# mass, m x, m y, Ixx, Iyy, Izz, Ixy, joint offset along y, drag area, y of drag area, weights of the lag (4)
LINK_ROWS = 14
# rotation W -> B (9), motion subspace S of the hinge in W (6), rate, origin of the first link in B (3)
HINGE_ROWS = 19
H_SUBSPACE, H_RATE, H_ORIGIN = 9, 15, 16


@kernel
def gimbal_twist(twist_parent, link, q, v, joint, twist):
    """Twist of a link from its parent's and its gimbal's motion; fills R, S and the bias acceleration.

    Bias: c = dS/dt qd + v x S qd; Featherstone (2008), equation 3.42.
    """
    if not_in_lanes(twist_parent) or not_in_lanes(link) or not_in_lanes(q) or not_in_lanes(v):
        return
    if not_in_lanes(joint) or not_in_lanes(twist):
        return
    for l in range(LANES):
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
        offset = link[7, l]
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
def hinge_twist(twist_base, hinge, acceleration, twist, bias):
    """Twist of a surface's first link and its acceleration but for the base's: hinge motion is prescribed."""
    if not_in_lanes(twist_base) or not_in_lanes(twist) or not_in_lanes(bias):
        return
    r00, r01, r02 = hinge[0], hinge[1], hinge[2]
    r10, r11, r12 = hinge[3], hinge[4], hinge[5]
    r20, r21, r22 = hinge[6], hinge[7], hinge[8]
    rate = hinge[15]
    jx, jy, jz = hinge[9] * rate, hinge[10] * rate, hinge[11] * rate
    kx, ky, kz = hinge[12] * rate, hinge[13] * rate, hinge[14] * rate
    ex, ey, ez = hinge[9] * acceleration, hinge[10] * acceleration, hinge[11] * acceleration
    fx, fy, fz = hinge[12] * acceleration, hinge[13] * acceleration, hinge[14] * acceleration
    px, py, pz = hinge[16], hinge[17], hinge[18]
    for l in range(LANES):
        ax, ay, az = twist_base[0, l], twist_base[1, l], twist_base[2, l]
        bx = twist_base[3, l] + ay * pz - az * py
        by = twist_base[4, l] + az * px - ax * pz
        bz = twist_base[5, l] + ax * py - ay * px
        wx = r00 * ax + r10 * ay + r20 * az + jx
        wy = r01 * ax + r11 * ay + r21 * az + jy
        wz = r02 * ax + r12 * ay + r22 * az + jz
        ux = r00 * bx + r10 * by + r20 * bz + kx
        uy = r01 * bx + r11 * by + r21 * bz + ky
        uz = r02 * bx + r12 * by + r22 * bz + kz
        twist[0, l], twist[1, l], twist[2, l] = wx, wy, wz
        twist[3, l], twist[4, l], twist[5, l] = ux, uy, uz
        bias[0, l] = wy * jz - wz * jy + ex
        bias[1, l] = wz * jx - wx * jz + ey
        bias[2, l] = wx * jy - wy * jx + ez
        bias[3, l] = wy * kz - wz * ky + uy * jz - uz * jy + fx
        bias[4, l] = wz * kx - wx * kz + uz * jx - ux * jz + fy
        bias[5, l] = wx * ky - wy * kx + ux * jy - uy * jx + fz


@kernel
def add_link(link, twist, wrench, inertia, force):
    """Add a flat link's rigid inertia and its bias force v x* I v - wrench to what it carries already."""
    if not_in_lanes(link) or not_in_lanes(twist) or not_in_lanes(wrench):
        return
    if not_in_lanes(inertia) or not_in_lanes(force):
        return
    for l in range(LANES):
        m, mx, my = link[0, l], link[1, l], link[2, l]
        ixx, iyy, izz, ixy = link[3, l], link[4, l], link[5, l], link[6, l]
        wx, wy, wz = twist[0, l], twist[1, l], twist[2, l]
        ux, uy, uz = twist[3, l], twist[4, l], twist[5, l]
        inertia[0, l] += ixx
        inertia[1, l] += ixy
        inertia[3, l] += iyy
        inertia[5, l] += izz
        inertia[8, l] += my
        inertia[11, l] -= mx
        inertia[12, l] -= my
        inertia[13, l] += mx
        inertia[15, l] += m
        inertia[18, l] += m
        inertia[20, l] += m
        # momentum at the origin: angular (hx, hy, hz), linear (gx, gy, gz)
        hx = ixx * wx + ixy * wy + my * uz
        hy = ixy * wx + iyy * wy - mx * uz
        hz = izz * wz + mx * uy - my * ux
        gx = m * ux - my * wz
        gy = m * uy + mx * wz
        gz = m * uz + my * wx - mx * wy
        force[0, l] += wy * hz - wz * hy + uy * gz - uz * gy - wrench[0, l]
        force[1, l] += wz * hx - wx * hz + uz * gx - ux * gz - wrench[1, l]
        force[2, l] += wx * hy - wy * hx + ux * gy - uy * gx - wrench[2, l]
        force[3, l] += wy * gz - wz * gy - wrench[3, l]
        force[4, l] += wz * gx - wx * gz - wrench[4, l]
        force[5, l] += wx * gy - wy * gx - wrench[5, l]


@kernel
def add_bias(inertia, bias, force):
    """force += I c."""
    if not_in_lanes(inertia) or not_in_lanes(bias) or not_in_lanes(force):
        return
    for l in range(LANES):
        a0, a1, a2, b0, b1, b2 = bias[0, l], bias[1, l], bias[2, l], bias[3, l], bias[4, l], bias[5, l]
        force[0, l] += (
            inertia[0, l] * a0 + inertia[1, l] * a1 + inertia[2, l] * a2
            + inertia[6, l] * b0 + inertia[7, l] * b1 + inertia[8, l] * b2
        )  # fmt: skip
        force[1, l] += (
            inertia[1, l] * a0 + inertia[3, l] * a1 + inertia[4, l] * a2
            + inertia[9, l] * b0 + inertia[10, l] * b1 + inertia[11, l] * b2
        )  # fmt: skip
        force[2, l] += (
            inertia[2, l] * a0 + inertia[4, l] * a1 + inertia[5, l] * a2
            + inertia[12, l] * b0 + inertia[13, l] * b1 + inertia[14, l] * b2
        )  # fmt: skip
        force[3, l] += (
            inertia[6, l] * a0 + inertia[9, l] * a1 + inertia[12, l] * a2
            + inertia[15, l] * b0 + inertia[16, l] * b1 + inertia[17, l] * b2
        )  # fmt: skip
        force[4, l] += (
            inertia[7, l] * a0 + inertia[10, l] * a1 + inertia[13, l] * a2
            + inertia[16, l] * b0 + inertia[18, l] * b1 + inertia[19, l] * b2
        )  # fmt: skip
        force[5, l] += (
            inertia[8, l] * a0 + inertia[11, l] * a1 + inertia[14, l] * a2
            + inertia[17, l] * b0 + inertia[19, l] * b1 + inertia[20, l] * b2
        )  # fmt: skip


@kernel
def eliminate_gimbal(tau, added, joint, inertia, force):
    """Articulate inertia and bias force through a gimbal: I - U D^-1 U^T and p + U D^-1 u.

    ``tau`` (3 rows) is the joint force, ``added`` (3 rows) what the implicit step adds to the joint-space
    diagonal.
    """
    if not_in_lanes(tau) or not_in_lanes(added) or not_in_lanes(joint):
        return
    if not_in_lanes(inertia) or not_in_lanes(force):
        return
    for l in range(LANES):
        s10, s11, s12 = joint[0, l], joint[1, l], joint[2, l]
        s20, s21 = joint[9, l], joint[10, l]
        i0, i1, i2, i3, i4, i5 = (
            inertia[0, l], inertia[1, l], inertia[2, l], inertia[3, l], inertia[4, l], inertia[5, l],
        )  # fmt: skip
        b0, b1, b2 = inertia[6, l], inertia[7, l], inertia[8, l]
        b3, b4, b5 = inertia[9, l], inertia[10, l], inertia[11, l]
        b6, b7, b8 = inertia[12, l], inertia[13, l], inertia[14, l]
        # U = I S, columns flap (f), torsion (t), lag (g)
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
        # inverse by cofactors: D is symmetric positive definite and well scaled
        m00, m01, m02 = d11 * d22 - d12 * d12, d02 * d12 - d01 * d22, d01 * d12 - d02 * d11
        m11, m12, m22 = d00 * d22 - d02 * d02, d01 * d02 - d00 * d12, d00 * d11 - d01 * d01
        inverse = 1.0 / (d00 * m00 + d01 * m01 + d02 * m02)
        m00, m01, m02 = m00 * inverse, m01 * inverse, m02 * inverse
        m11, m12, m22 = m11 * inverse, m12 * inverse, m22 * inverse
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


@inlined
def congruence(r00, r01, r02, r10, r11, r12, r20, r21, r22, a00, a01, a02, a11, a12, a22):
    """R A R^T of a symmetric A: its six distinct elements."""
    t00, t01, t02 = (
        r00 * a00 + r01 * a01 + r02 * a02,
        r00 * a01 + r01 * a11 + r02 * a12,
        r00 * a02 + r01 * a12 + r02 * a22,
    )
    t10, t11, t12 = (
        r10 * a00 + r11 * a01 + r12 * a02,
        r10 * a01 + r11 * a11 + r12 * a12,
        r10 * a02 + r11 * a12 + r12 * a22,
    )
    t20, t21, t22 = (
        r20 * a00 + r21 * a01 + r22 * a02,
        r20 * a01 + r21 * a11 + r22 * a12,
        r20 * a02 + r21 * a12 + r22 * a22,
    )
    return (
        t00 * r00 + t01 * r01 + t02 * r02,
        t00 * r10 + t01 * r11 + t02 * r12,
        t00 * r20 + t01 * r21 + t02 * r22,
        t10 * r10 + t11 * r11 + t12 * r12,
        t10 * r20 + t11 * r21 + t12 * r22,
        t20 * r20 + t21 * r21 + t22 * r22,
    )


@inlined
def rotated_block(r00, r01, r02, r10, r11, r12, r20, r21, r22, b0, b1, b2, b3, b4, b5, b6, b7, b8):
    """R B R^T of a general 3 x 3 B, row by row."""
    t00, t01, t02 = (
        r00 * b0 + r01 * b3 + r02 * b6,
        r00 * b1 + r01 * b4 + r02 * b7,
        r00 * b2 + r01 * b5 + r02 * b8,
    )
    t10, t11, t12 = (
        r10 * b0 + r11 * b3 + r12 * b6,
        r10 * b1 + r11 * b4 + r12 * b7,
        r10 * b2 + r11 * b5 + r12 * b8,
    )
    t20, t21, t22 = (
        r20 * b0 + r21 * b3 + r22 * b6,
        r20 * b1 + r21 * b4 + r22 * b7,
        r20 * b2 + r21 * b5 + r22 * b8,
    )
    return (
        t00 * r00 + t01 * r01 + t02 * r02, t00 * r10 + t01 * r11 + t02 * r12, t00 * r20 + t01 * r21 + t02 *
        r22, t10 * r00 + t11 * r01 + t12 * r02, t10 * r10 + t11 * r11 + t12 * r12, t10 * r20 + t11 * r21 + t12
        * r22, t20 * r00 + t21 * r01 + t22 * r02, t20 * r10 + t21 * r11 + t22 * r12, t20 * r20 + t21 * r21 +
        t22 * r22,
    )  # fmt: skip


@inlined
def shifted_inertia(
    px, py, pz, a0, a1, a2, a3, a4, a5, b0, b1, b2, b3, b4, b5, b6, b7, b8, l0, l1, l2, l3, l4, l5
):
    """Blocks A and B of an articulated inertia moved from a point at p to the origin; L stays.

    B' = B + p x L; A' = A - B [p x] + [p x] B'^T; Featherstone (2008), table 2.1 applied to I' = X^T I X.
    """
    n0, n1, n2 = b0 + py * l2 - pz * l1, b1 + py * l4 - pz * l3, b2 + py * l5 - pz * l4
    n3, n4, n5 = b3 + pz * l0 - px * l2, b4 + pz * l1 - px * l4, b5 + pz * l2 - px * l5
    n6, n7, n8 = b6 + px * l1 - py * l0, b7 + px * l3 - py * l1, b8 + px * l4 - py * l2
    return (
        a0 + py * (b2 + n2) - pz * (b1 + n1),
        a1 + pz * b0 - px * b2 + py * n5 - pz * n4,
        a2 + px * b1 - py * b0 + py * n8 - pz * n7,
        a3 + pz * (b3 + n3) - px * (b5 + n5),
        a4 + px * b4 - py * b3 + pz * n6 - px * n8,
        a5 + px * (b7 + n7) - py * (b6 + n6),
        n0, n1, n2, n3, n4, n5, n6, n7, n8,
    )  # fmt: skip


@kernel
def carry_through_gimbal(link, joint, inertia, force):
    """Express what a link carries, in place, in its parent's axes and at its parent's origin."""
    if not_in_lanes(link) or not_in_lanes(joint) or not_in_lanes(inertia) or not_in_lanes(force):
        return
    for l in range(LANES):
        r00, r01, r02 = joint[0, l], joint[1, l], joint[2, l]
        r10, r11, r12 = joint[3, l], joint[4, l], joint[5, l]
        r20, r21, r22 = joint[6, l], joint[7, l], joint[8, l]
        carry_lane(r00, r01, r02, r10, r11, r12, r20, r21, r22, 0.0, link[7, l], 0.0, inertia, force, l)


@inlined
def carry_lane(r00, r01, r02, r10, r11, r12, r20, r21, r22, px, py, pz, inertia, force, l):
    """Rotate by R and move by p the articulated inertia and force of one lane, in place."""
    a0, a1, a2, a3, a4, a5 = congruence(
        r00, r01, r02, r10, r11, r12, r20, r21, r22,
        inertia[0, l], inertia[1, l], inertia[2, l], inertia[3, l], inertia[4, l], inertia[5, l],
    )  # fmt: skip
    b0, b1, b2, b3, b4, b5, b6, b7, b8 = rotated_block(
        r00, r01, r02, r10, r11, r12, r20, r21, r22,
        inertia[6, l], inertia[7, l], inertia[8, l], inertia[9, l], inertia[10, l], inertia[11, l],
        inertia[12, l], inertia[13, l], inertia[14, l],
    )  # fmt: skip
    l0, l1, l2, l3, l4, l5 = congruence(
        r00, r01, r02, r10, r11, r12, r20, r21, r22,
        inertia[15, l], inertia[16, l], inertia[17, l], inertia[18, l], inertia[19, l], inertia[20, l],
    )  # fmt: skip
    a0, a1, a2, a3, a4, a5, b0, b1, b2, b3, b4, b5, b6, b7, b8 = shifted_inertia(
        px, py, pz, a0, a1, a2, a3, a4, a5, b0, b1, b2, b3, b4, b5, b6, b7, b8, l0, l1, l2, l3, l4, l5
    )
    inertia[0, l], inertia[1, l], inertia[2, l] = a0, a1, a2
    inertia[3, l], inertia[4, l], inertia[5, l] = a3, a4, a5
    inertia[6, l], inertia[7, l], inertia[8, l] = b0, b1, b2
    inertia[9, l], inertia[10, l], inertia[11, l] = b3, b4, b5
    inertia[12, l], inertia[13, l], inertia[14, l] = b6, b7, b8
    inertia[15, l], inertia[16, l], inertia[17, l] = l0, l1, l2
    inertia[18, l], inertia[19, l], inertia[20, l] = l3, l4, l5
    m0, m1, m2 = force[0, l], force[1, l], force[2, l]
    f0, f1, f2 = force[3, l], force[4, l], force[5, l]
    g0 = r00 * f0 + r01 * f1 + r02 * f2
    g1 = r10 * f0 + r11 * f1 + r12 * f2
    g2 = r20 * f0 + r21 * f1 + r22 * f2
    force[0, l] = r00 * m0 + r01 * m1 + r02 * m2 + py * g2 - pz * g1
    force[1, l] = r10 * m0 + r11 * m1 + r12 * m2 + pz * g0 - px * g2
    force[2, l] = r20 * m0 + r21 * m1 + r22 * m2 + px * g1 - py * g0
    force[3, l], force[4, l], force[5, l] = g0, g1, g2


@kernel
def carry_through_hinge(hinge, inertia, force):
    """Express what a surface carries, in place, in B at the fuselage reference point."""
    if not_in_lanes(inertia) or not_in_lanes(force):
        return
    r00, r01, r02 = hinge[0], hinge[1], hinge[2]
    r10, r11, r12 = hinge[3], hinge[4], hinge[5]
    r20, r21, r22 = hinge[6], hinge[7], hinge[8]
    px, py, pz = hinge[16], hinge[17], hinge[18]
    for l in range(LANES):
        carry_lane(r00, r01, r02, r10, r11, r12, r20, r21, r22, px, py, pz, inertia, force, l)


@kernel
def accumulate(inertia, force, total_inertia, total_force):
    """Add a surface's articulated inertia and force to the fuselage's."""
    if (
        not_in_lanes(inertia)
        or not_in_lanes(force)
        or not_in_lanes(total_inertia)
        or not_in_lanes(total_force)
    ):
        return
    for i in range(21):
        for l in range(LANES):
            total_inertia[i, l] += inertia[i, l]
    for i in range(6):
        for l in range(LANES):
            total_force[i, l] += force[i, l]


@kernel
def solve_base(inertia, force, factor, acceleration):
    """Base acceleration from I a = -p, by L D L^T; ``factor`` holds 21 scratch rows."""
    if not_in_lanes(inertia) or not_in_lanes(force) or not_in_lanes(factor) or not_in_lanes(acceleration):
        return
    for l in range(LANES):  # into the lower triangle, row by row
        factor[0, l] = inertia[0, l]
        factor[1, l], factor[2, l] = inertia[1, l], inertia[3, l]
        factor[3, l], factor[4, l], factor[5, l] = inertia[2, l], inertia[4, l], inertia[5, l]
        factor[6, l], factor[7, l], factor[8, l] = inertia[6, l], inertia[9, l], inertia[12, l]
        factor[9, l] = inertia[15, l]
        factor[10, l], factor[11, l], factor[12, l] = inertia[7, l], inertia[10, l], inertia[13, l]
        factor[13, l], factor[14, l] = inertia[16, l], inertia[18, l]
        factor[15, l], factor[16, l], factor[17, l] = inertia[8, l], inertia[11, l], inertia[14, l]
        factor[18, l], factor[19, l], factor[20, l] = inertia[17, l], inertia[19, l], inertia[20, l]
    for i in range(6):
        row = i * (i + 1) // 2
        for j in range(i):
            col = j * (j + 1) // 2
            for k in range(j):
                a, b = factor[row + k], factor[col + k]
                d = factor[k * (k + 1) // 2 + k]
                c = factor[row + j]
                for l in range(LANES):
                    c[l] -= a[l] * b[l] * d[l]
            c = factor[row + j]
            d = factor[col + j]
            for l in range(LANES):
                c[l] /= d[l]
        e = factor[row + i]
        for k in range(i):
            a = factor[row + k]
            d = factor[k * (k + 1) // 2 + k]
            for l in range(LANES):
                e[l] -= a[l] * a[l] * d[l]
    for i in range(6):
        row = i * (i + 1) // 2
        x = acceleration[i]
        p = force[i]
        for l in range(LANES):
            x[l] = -p[l]
        for k in range(i):
            a, y = factor[row + k], acceleration[k]
            for l in range(LANES):
                x[l] -= a[l] * y[l]
    for i in range(6):
        d, x = factor[i * (i + 1) // 2 + i], acceleration[i]
        for l in range(LANES):
            x[l] /= d[l]
    for i in range(5, -1, -1):
        x = acceleration[i]
        for k in range(i + 1, 6):
            a, y = factor[k * (k + 1) // 2 + i], acceleration[k]
            for l in range(LANES):
                x[l] -= a[l] * y[l]


@kernel
def hinge_acceleration(base, hinge, bias, acceleration):
    """Acceleration of a surface's first link from the base's."""
    if not_in_lanes(base) or not_in_lanes(bias) or not_in_lanes(acceleration):
        return
    r00, r01, r02 = hinge[0], hinge[1], hinge[2]
    r10, r11, r12 = hinge[3], hinge[4], hinge[5]
    r20, r21, r22 = hinge[6], hinge[7], hinge[8]
    px, py, pz = hinge[16], hinge[17], hinge[18]
    for l in range(LANES):
        ax, ay, az = base[0, l], base[1, l], base[2, l]
        bx = base[3, l] + ay * pz - az * py
        by = base[4, l] + az * px - ax * pz
        bz = base[5, l] + ax * py - ay * px
        acceleration[0, l] = r00 * ax + r10 * ay + r20 * az + bias[0, l]
        acceleration[1, l] = r01 * ax + r11 * ay + r21 * az + bias[1, l]
        acceleration[2, l] = r02 * ax + r12 * ay + r22 * az + bias[2, l]
        acceleration[3, l] = r00 * bx + r10 * by + r20 * bz + bias[3, l]
        acceleration[4, l] = r01 * bx + r11 * by + r21 * bz + bias[4, l]
        acceleration[5, l] = r02 * bx + r12 * by + r22 * bz + bias[5, l]


@kernel
def gimbal_acceleration(parent, link, joint, acceleration, joint_acceleration):
    """Joint accelerations D^-1 (u - U^T a) and the link's own acceleration."""
    if not_in_lanes(parent) or not_in_lanes(link) or not_in_lanes(joint):
        return
    if not_in_lanes(acceleration) or not_in_lanes(joint_acceleration):
        return
    for l in range(LANES):
        r00, r01, r02 = joint[0, l], joint[1, l], joint[2, l]
        r10, r11, r12 = joint[3, l], joint[4, l], joint[5, l]
        r20, r21, r22 = joint[6, l], joint[7, l], joint[8, l]
        ax, ay, az = parent[0, l], parent[1, l], parent[2, l]
        offset = link[7, l]
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
