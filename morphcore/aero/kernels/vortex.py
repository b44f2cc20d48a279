"""Velocity induced by straight vortices, regularised by a core.

Both laws are written without the difference of nearly equal numbers of the textbook form (Katz & Plotkin
2001, equation 10.115), which on the vortex's extension, where the true velocity vanishes, divides rounding
noise by the squared distance from the line and ends in 0/0. On a straight wing every edge lies in line with
its neighbours.

The core is Vatistas's (Vatistas, Kozel & Mih 1991, n = 2): a factor h^2 / sqrt(h^4 + core^4), with h the
distance from the vortex's *line*, so that a vortex cut in two induces what the whole one does.
"""

from __future__ import annotations

from math import sqrt

from morphcore.jit import inlined

FOUR_PI = 12.566370614359172
# keeps a point that sits on a corner from 0 * inf; far below any product of lengths (m^2 and m^8)
TINY = 1e-150


@inlined
def segment_velocity(ax, ay, az, ex, ey, ez, core4):
    """Velocity (3 components, 1/m of unit circulation) of a segment from P + a to P + a + e, at a point P.

    ``a`` runs from the point to the segment's start, ``e`` from start to end, m; ``core4`` is the core radius
    to the fourth, m^4. Circulation is right-handed about ``e``.
    """
    bx, by, bz = ax + ex, ay + ey, az + ez
    # e x a, not a x b: no cancellation far away
    cx, cy, cz = ey * az - ez * ay, ez * ax - ex * az, ex * ay - ey * ax
    cross2 = cx * cx + cy * cy + cz * cz
    length2 = ex * ex + ey * ey + ez * ez
    a = sqrt(ax * ax + ay * ay + az * az)
    b = sqrt(bx * bx + by * by + bz * bz)
    ab = a * b + TINY
    dot = ax * bx + ay * by + az * bz
    # (ab + dot)(ab - dot) = cross2, and one of the two factors is always a sum: alongside (dot < 0) the
    # singular 1 / cross2 meets the core's cross2 and drops out; beyond the ends nothing is singular
    root = sqrt(cross2 * cross2 + core4 * length2 * length2 + TINY)
    beside = dot <= 0.0
    above = ab - dot if beside else cross2
    below = 1.0 if beside else ab + dot
    k = (a + b) * above / (FOUR_PI * ab * below * root)
    # the vector from start to point is -a: e x (-a) turns the law right-handed
    return -k * cx, -k * cy, -k * cz


@inlined
def leg_velocity(ax, ay, az, ux, uy, uz, core4):
    """Velocity (3 components, 1/m of unit circulation) of a semi-infinite vortex along u from P + a, at P.

    ``u`` is a unit vector. Circulation is right-handed about ``u``; arguments as in ``segment_velocity``.
    """
    cx, cy, cz = uy * az - uz * ay, uz * ax - ux * az, ux * ay - uy * ax
    cross2 = cx * cx + cy * cy + cz * cz
    a = sqrt(ax * ax + ay * ay + az * az)
    along = ax * ux + ay * uy + az * uz
    root = sqrt(cross2 * cross2 + core4)
    # along < 0: the point lies downstream of the start, beside the leg
    beside = along <= 0.0
    above = a - along if beside else cross2
    below = 1.0 if beside else a + along
    k = above / (FOUR_PI * (a + TINY) * below * root)
    return -k * cx, -k * cy, -k * cz
