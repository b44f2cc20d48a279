"""Articulated bodies over lanes: operations shared by links, gimbals and hinges.

Featherstone (2008), table 7.1 (articulated bodies) and section 9.2 (hybrid dynamics), with the three
revolutes of a gimbal combined into one joint of three degrees of freedom, which is equivalent because its
frames are massless.

Rows of the lane arrays ((rows, width), see lanes.py):

- twist, spatial acceleration, wrench, bias force: 6 rows, angular part first, in link axes at the link's
  origin;
- inertia: 21 rows: angular block A (00 01 02 11 12 22), coupling block B (row by row, 9), linear block L (as
  A).
"""

from __future__ import annotations

from morphcore.jit import inlined, kernel
from morphcore.lanes import not_in_lanes

# rows of a link's constants: its mass properties (mass, m x, m y, Ixx, Iyy, Izz, Ixy) and the offset of its
# joint along y; then the aerodynamic rows, named in aero/kernels/loads.py; then its apparent inertia on
# (omega_x, omega_y, v_z): 00 01 02 11 12 22; then what masses out of its plane add (m z, Ixz, Iyz)
L_MASS, L_OFFSET, L_APPARENT, L_UP = 0, 7, 25, 31
LINK_ROWS = 34


@inlined
def inverse_symmetric(a00, a01, a02, a11, a12, a22):
    """Inverse of a symmetric, well-scaled 3 x 3 matrix by cofactors: its six distinct elements."""
    m00, m01, m02 = a11 * a22 - a12 * a12, a02 * a12 - a01 * a22, a01 * a12 - a02 * a11
    m11, m12, m22 = a00 * a22 - a02 * a02, a01 * a02 - a00 * a12, a00 * a11 - a01 * a01
    inverse = 1.0 / (a00 * m00 + a01 * m01 + a02 * m02)
    return m00 * inverse, m01 * inverse, m02 * inverse, m11 * inverse, m12 * inverse, m22 * inverse


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


@inlined
def carry_lane(r00, r01, r02, r10, r11, r12, r20, r21, r22, px, py, pz, inertia, force, l):
    """Rotate by R and shift by p the articulated inertia and force of one lane, in place."""
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
def add_link(lanes, link, twist, wrench, inertia, force):
    """Add a flat link's rigid inertia and its bias force v x* I v - wrench to those already accumulated."""
    if not_in_lanes(link, lanes) or not_in_lanes(twist, lanes) or not_in_lanes(wrench, lanes):
        return
    if not_in_lanes(inertia, lanes) or not_in_lanes(force, lanes):
        return
    for l in range(len(lanes)):
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
def add_apparent(lanes, link, gravity, inertia, force):
    """Add a link's apparent inertia, which has no weight: accelerations here are relative to free fall.

    ``gravity`` (3 rows) in link axes.
    """
    if not_in_lanes(link, lanes) or not_in_lanes(gravity, lanes):
        return
    if not_in_lanes(inertia, lanes) or not_in_lanes(force, lanes):
        return
    for l in range(len(lanes)):
        xx, xy, xz = link[L_APPARENT, l], link[L_APPARENT + 1, l], link[L_APPARENT + 2, l]
        yy, yz, zz = link[L_APPARENT + 3, l], link[L_APPARENT + 4, l], link[L_APPARENT + 5, l]
        inertia[0, l] += xx
        inertia[1, l] += xy
        inertia[3, l] += yy
        inertia[8, l] += xz
        inertia[11, l] += yz
        inertia[20, l] += zz
        fall = gravity[2, l]
        force[0, l] += xz * fall
        force[1, l] += yz * fall
        force[5, l] += zz * fall


@kernel
def add_lump(lanes, link, twist, inertia, force):
    """Add to `add_link`'s sums what masses out of a link's plane contribute: m z, Ixz and Iyz."""
    if (
        not_in_lanes(link, lanes)
        or not_in_lanes(twist, lanes)
        or not_in_lanes(inertia, lanes)
        or not_in_lanes(force, lanes)
    ):
        return
    for l in range(len(lanes)):
        mz, ixz, iyz = link[L_UP, l], link[L_UP + 1, l], link[L_UP + 2, l]
        wx, wy, wz = twist[0, l], twist[1, l], twist[2, l]
        ux, uy, uz = twist[3, l], twist[4, l], twist[5, l]
        inertia[2, l] += ixz
        inertia[4, l] += iyz
        inertia[7, l] -= mz
        inertia[9, l] += mz
        # its share of the momentum at the origin
        hx = ixz * wz - mz * uy
        hy = iyz * wz + mz * ux
        hz = ixz * wx + iyz * wy
        gx, gy = mz * wy, -mz * wx
        force[0, l] += wy * hz - wz * hy - uz * gy
        force[1, l] += wz * hx - wx * hz + uz * gx
        force[2, l] += wx * hy - wy * hx + ux * gy - uy * gx
        force[3, l] -= wz * gy
        force[4, l] += wz * gx
        force[5, l] += wx * gy - wy * gx


@kernel
def add_bias(lanes, inertia, bias, force):
    """force += I c."""
    if not_in_lanes(inertia, lanes) or not_in_lanes(bias, lanes) or not_in_lanes(force, lanes):
        return
    for l in range(len(lanes)):
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
def accumulate(lanes, inertia, force, total_inertia, total_force):
    """Add a surface's articulated inertia and force to the fuselage's."""
    if (
        not_in_lanes(inertia, lanes)
        or not_in_lanes(force, lanes)
        or not_in_lanes(total_inertia, lanes)
        or not_in_lanes(total_force, lanes)
    ):
        return
    for i in range(21):
        for l in range(len(lanes)):
            total_inertia[i, l] += inertia[i, l]
    for i in range(6):
        for l in range(len(lanes)):
            total_force[i, l] += force[i, l]


@kernel
def accumulate_pair(lanes, inertia, force, total_inertia, total_force):
    """Add a surface's articulated inertia and force, and those of its mirror image, to the fuselage's.

    Under reflection about the x-z plane the components (wx, wz, v_y) change sign. Products of two components
    that both change or both keep their sign are doubled, the others cancel.
    """
    if (
        not_in_lanes(inertia, lanes)
        or not_in_lanes(force, lanes)
        or not_in_lanes(total_inertia, lanes)
        or not_in_lanes(total_force, lanes)
    ):
        return
    for l in range(len(lanes)):
        total_inertia[0, l] += 2.0 * inertia[0, l]
        total_inertia[2, l] += 2.0 * inertia[2, l]
        total_inertia[3, l] += 2.0 * inertia[3, l]
        total_inertia[5, l] += 2.0 * inertia[5, l]
        total_inertia[7, l] += 2.0 * inertia[7, l]
        total_inertia[9, l] += 2.0 * inertia[9, l]
        total_inertia[11, l] += 2.0 * inertia[11, l]
        total_inertia[13, l] += 2.0 * inertia[13, l]
        total_inertia[15, l] += 2.0 * inertia[15, l]
        total_inertia[17, l] += 2.0 * inertia[17, l]
        total_inertia[18, l] += 2.0 * inertia[18, l]
        total_inertia[20, l] += 2.0 * inertia[20, l]
        total_force[1, l] += 2.0 * force[1, l]
        total_force[3, l] += 2.0 * force[3, l]
        total_force[5, l] += 2.0 * force[5, l]


@kernel
def solve_base(lanes, inertia, force, acceleration):
    """Base acceleration [w'; v'] from I [w'; v'] = -[n; f], by blocks of three.

    With I = [A B; B^T L]: (A - B L^-1 B^T) w' = B L^-1 f - n and v' = -L^-1 (f + B^T w'). L holds masses, the
    Schur complement the inertia about their centre: both positive definite and well scaled.
    """
    if not_in_lanes(inertia, lanes) or not_in_lanes(force, lanes) or not_in_lanes(acceleration, lanes):
        return
    for l in range(len(lanes)):
        b0, b1, b2 = inertia[6, l], inertia[7, l], inertia[8, l]
        b3, b4, b5 = inertia[9, l], inertia[10, l], inertia[11, l]
        b6, b7, b8 = inertia[12, l], inertia[13, l], inertia[14, l]
        l00, l01, l02, l11, l12, l22 = inverse_symmetric(
            inertia[15, l], inertia[16, l], inertia[17, l], inertia[18, l], inertia[19, l], inertia[20, l]
        )
        c00, c01, c02, c11, c12, c22 = congruence(
            b0, b1, b2, b3, b4, b5, b6, b7, b8, l00, l01, l02, l11, l12, l22
        )
        s00, s01, s02, s11, s12, s22 = inverse_symmetric(
            inertia[0, l] - c00, inertia[1, l] - c01, inertia[2, l] - c02,
            inertia[3, l] - c11, inertia[4, l] - c12, inertia[5, l] - c22,
        )  # fmt: skip
        fx, fy, fz = force[3, l], force[4, l], force[5, l]
        ux = l00 * fx + l01 * fy + l02 * fz
        uy = l01 * fx + l11 * fy + l12 * fz
        uz = l02 * fx + l12 * fy + l22 * fz
        nx = b0 * ux + b1 * uy + b2 * uz - force[0, l]
        ny = b3 * ux + b4 * uy + b5 * uz - force[1, l]
        nz = b6 * ux + b7 * uy + b8 * uz - force[2, l]
        wx = s00 * nx + s01 * ny + s02 * nz
        wy = s01 * nx + s11 * ny + s12 * nz
        wz = s02 * nx + s12 * ny + s22 * nz
        fx += b0 * wx + b3 * wy + b6 * wz
        fy += b1 * wx + b4 * wy + b7 * wz
        fz += b2 * wx + b5 * wy + b8 * wz
        acceleration[0, l], acceleration[1, l], acceleration[2, l] = wx, wy, wz
        acceleration[3, l] = -(l00 * fx + l01 * fy + l02 * fz)
        acceleration[4, l] = -(l01 * fx + l11 * fy + l12 * fz)
        acceleration[5, l] = -(l02 * fx + l12 * fy + l22 * fz)
