"""Surfaces of prescribed motion in the articulated-body pass (Featherstone 2008, section 9.2).

A surface moves relative to the fuselage by the combined motion of its hinges, see `multibody.hinges`: their
number does not affect the cost here.
"""

from __future__ import annotations

from morphcore.jit import kernel
from morphcore.lanes import not_in_lanes
from morphcore.multibody.kernels.articulated import carry_lane

# rotation W -> B (9), twist relative to the fuselage in W (6), origin of the first link in B (3)
HINGE_ROWS = 18
H_ROTATION, H_TWIST, H_ORIGIN = 0, 9, 15


@kernel
def hinge_twist(lanes, twist_base, hinge, acceleration, twist, bias):
    """Twist of a surface's first link, and its acceleration without the base's.

    acceleration : (6,) time derivative of the relative twist in W.
    """
    if not_in_lanes(twist_base, lanes) or not_in_lanes(twist, lanes) or not_in_lanes(bias, lanes):
        return
    r00, r01, r02 = hinge[0], hinge[1], hinge[2]
    r10, r11, r12 = hinge[3], hinge[4], hinge[5]
    r20, r21, r22 = hinge[6], hinge[7], hinge[8]
    jx, jy, jz = hinge[H_TWIST], hinge[H_TWIST + 1], hinge[H_TWIST + 2]
    kx, ky, kz = hinge[H_TWIST + 3], hinge[H_TWIST + 4], hinge[H_TWIST + 5]
    ex, ey, ez = acceleration[0], acceleration[1], acceleration[2]
    fx, fy, fz = acceleration[3], acceleration[4], acceleration[5]
    px, py, pz = hinge[H_ORIGIN], hinge[H_ORIGIN + 1], hinge[H_ORIGIN + 2]
    for l in range(len(lanes)):
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
def vector_through_hinge(lanes, hinge, base, own):
    """A vector (3 rows) in B, in the axes of a surface's first link."""
    if not_in_lanes(base, lanes) or not_in_lanes(own, lanes):
        return
    r00, r01, r02 = hinge[0], hinge[1], hinge[2]
    r10, r11, r12 = hinge[3], hinge[4], hinge[5]
    r20, r21, r22 = hinge[6], hinge[7], hinge[8]
    for l in range(len(lanes)):
        x, y, z = base[0, l], base[1, l], base[2, l]
        own[0, l] = r00 * x + r10 * y + r20 * z
        own[1, l] = r01 * x + r11 * y + r21 * z
        own[2, l] = r02 * x + r12 * y + r22 * z


@kernel
def carry_through_hinge(lanes, hinge, inertia, force):
    """Transform a surface's accumulated inertia and force, in place, to B at the fuselage reference point."""
    if not_in_lanes(inertia, lanes) or not_in_lanes(force, lanes):
        return
    r00, r01, r02 = hinge[0], hinge[1], hinge[2]
    r10, r11, r12 = hinge[3], hinge[4], hinge[5]
    r20, r21, r22 = hinge[6], hinge[7], hinge[8]
    px, py, pz = hinge[H_ORIGIN], hinge[H_ORIGIN + 1], hinge[H_ORIGIN + 2]
    for l in range(len(lanes)):
        carry_lane(r00, r01, r02, r10, r11, r12, r20, r21, r22, px, py, pz, inertia, force, l)


@kernel
def hinge_acceleration(lanes, base, hinge, bias, acceleration):
    """Acceleration of a surface's first link from the base's."""
    if not_in_lanes(base, lanes) or not_in_lanes(bias, lanes) or not_in_lanes(acceleration, lanes):
        return
    r00, r01, r02 = hinge[0], hinge[1], hinge[2]
    r10, r11, r12 = hinge[3], hinge[4], hinge[5]
    r20, r21, r22 = hinge[6], hinge[7], hinge[8]
    px, py, pz = hinge[H_ORIGIN], hinge[H_ORIGIN + 1], hinge[H_ORIGIN + 2]
    for l in range(len(lanes)):
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
