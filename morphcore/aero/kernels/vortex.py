"""Velocity induced by straight vortices, regularised by a core of one of two laws.

Segments and semi-infinite legs avoid the cancellation in the textbook form (Katz & Plotkin 2001, equation
10.115). On the vortex's extension, where the true velocity vanishes, that form divides rounding noise by the
squared distance from the line and ends in 0/0; and on a straight wing every edge is in line with its
neighbours.

"Line" is the core of Vatistas (Vatistas, Kozel & Mih 1991, n = 2): a factor h^2 / sqrt(h^4 + core^4), with h
the distance from the vortex's *line*, so that a vortex cut in two induces what the whole one does.

"Smoothed" adds a cut-off to the denominator of the product form,
``(|a| + |b|) / (|a||b| (|a||b| + a.b) + core^2 l^2)`` (van Garrel 2003, ECN-C--03-079, whose cut-off has no
unit; the l^2 of the segment's length makes it a length, as in OpenFAST's OLAF). Near the middle of a long
vortex it is a factor h^2 / (h^2 + 2 core^2), which at a distance of four cores still removes 11 per cent
("line": 0.2), and a vortex cut in two does not induce what the whole one does.
"""

from __future__ import annotations

from math import sqrt

from morphcore.jit import inlined

FOUR_PI = 12.566370614359172
# avoids 0 * inf for a point on a corner; far below any product of lengths (m^2 and m^8)
TINY = 1e-150


@inlined
def segment_strength(a, b, dot, cross2, length2, core4):
    """Factor k of a segment's velocity -k (e x a), 1/m^2; "line".

    a, b : distances of start and end from the point; dot, cross2 : product of both vectors and square of
    e x a; length2 : of the segment. ``core4`` is the core radius to the fourth, m^4.
    """
    ab = a * b + TINY
    # (ab + dot)(ab - dot) = cross2, and one of the two factors is always a sum: alongside (dot < 0) the
    # singular 1 / cross2 meets the core's cross2 and drops out; beyond the ends nothing is singular
    root = sqrt(cross2 * cross2 + core4 * length2 * length2 + TINY)
    alongside = dot <= 0.0
    above = ab - dot if alongside else cross2
    below = 1.0 if alongside else ab + dot
    return (a + b) * above / (FOUR_PI * ab * below * root)


@inlined
def leg_strength(a, along, cross2, core4):
    """Factor k of a leg's velocity -k (u x a), 1/m; "line". ``along`` is a . u, else as above."""
    root = sqrt(cross2 * cross2 + core4)
    # along < 0: the point lies downstream of the start, next to the leg
    alongside = along <= 0.0
    above = a - along if alongside else cross2
    below = 1.0 if alongside else a + along
    return above / (FOUR_PI * (a + TINY) * below * root)


@inlined
def grown_core(along, core4, width4, chord2):
    """Core radius to the fourth, m^4, of a wake leg beside a point; "line". ``along`` as in ``leg_strength``.

    Grows downstream from the core at the trailing edge to the width of the leg's strips (``width4``, m^4),
    most of it within two chords (``chord2``, m^2): a surface close to the wake of another one then meets a
    sheet instead of single vortices whose places between its own strips are an accident.
    """
    behind2 = along * along if along < 0.0 else 0.0
    grown = behind2 / (behind2 + chord2)
    grown *= grown
    return core4 + width4 * grown * grown


@inlined
def smoothed_segment_strength(a, b, dot, cross2, length2, core2):
    """Factor k of a segment as in ``segment_strength``; "smoothed", core radius squared, m^2."""
    ab = a * b + TINY
    # ab + dot, alongside (dot < 0) without cancellation; see segment_strength
    total = cross2 / (ab - dot) if dot <= 0.0 else ab + dot
    return (a + b) / (FOUR_PI * (ab * total + core2 * length2 + TINY))


@inlined
def smoothed_leg_strength(a, along, cross2, core2):
    """Factor k of a leg as in ``leg_strength``; "smoothed"."""
    # a + along, downstream of the start (along < 0) without cancellation
    total = cross2 / (a - along + TINY) if along <= 0.0 else a + along
    return 1.0 / (FOUR_PI * (a * total + core2))


@inlined
def segment_velocity(ax, ay, az, ex, ey, ez, core4):
    """Velocity (3 components, 1/m of unit circulation) of a segment from P + a to P + a + e, at P; "line".

    ``a`` runs from the point to the segment's start, ``e`` from start to end, m; ``core4`` is the core radius
    to the fourth, m^4. Circulation is right-handed about ``e``.
    """
    bx, by, bz = ax + ex, ay + ey, az + ez
    # e x a, not a x b: no cancellation far away
    cx, cy, cz = ey * az - ez * ay, ez * ax - ex * az, ex * ay - ey * ax
    a = sqrt(ax * ax + ay * ay + az * az)
    b = sqrt(bx * bx + by * by + bz * bz)
    dot = ax * bx + ay * by + az * bz
    cross2 = cx * cx + cy * cy + cz * cz
    k = segment_strength(a, b, dot, cross2, ex * ex + ey * ey + ez * ez, core4)
    # the vector from start to point is -a: e x (-a) turns the law right-handed
    return -k * cx, -k * cy, -k * cz


@inlined
def leg_velocity(ax, ay, az, ux, uy, uz, core4, width4, chord2):
    """Velocity (3 components, 1/m of unit circulation) of a semi-infinite vortex along u from P + a; "line".

    ``u`` is a unit vector. Circulation is right-handed about ``u``; ``width4`` and ``chord2`` as in
    ``grown_core``, the others as in ``segment_velocity``.
    """
    cx, cy, cz = uy * az - uz * ay, uz * ax - ux * az, ux * ay - uy * ax
    a = sqrt(ax * ax + ay * ay + az * az)
    along = ax * ux + ay * uy + az * uz
    k = leg_strength(a, along, cx * cx + cy * cy + cz * cz, grown_core(along, core4, width4, chord2))
    return -k * cx, -k * cy, -k * cz


@inlined
def smoothed_segment_velocity(ax, ay, az, ex, ey, ez, core2):
    """Velocity (3 components, 1/m of unit circulation) of a segment as in ``segment_velocity``; "smoothed".

    ``core2`` is the core radius squared, m^2.
    """
    bx, by, bz = ax + ex, ay + ey, az + ez
    cx, cy, cz = ey * az - ez * ay, ez * ax - ex * az, ex * ay - ey * ax
    a = sqrt(ax * ax + ay * ay + az * az)
    b = sqrt(bx * bx + by * by + bz * bz)
    dot = ax * bx + ay * by + az * bz
    cross2 = cx * cx + cy * cy + cz * cz
    k = smoothed_segment_strength(a, b, dot, cross2, ex * ex + ey * ey + ez * ez, core2)
    return -k * cx, -k * cy, -k * cz


@inlined
def smoothed_leg_velocity(ax, ay, az, ux, uy, uz, core2):
    """Velocity (3 components, 1/m of unit circulation) of a leg as in ``leg_velocity``; "smoothed".

    The limit of the segment e = l u for l -> infinity: b -> l, ab + dot -> l (a + a.u), cross -> l (u x a):
    numerator and denominator both grow as l^2 and leave ``(u x -a) / (a (a + a.u) + core^2) / 4 pi``.
    """
    cx, cy, cz = uy * az - uz * ay, uz * ax - ux * az, ux * ay - uy * ax
    a = sqrt(ax * ax + ay * ay + az * az)
    k = smoothed_leg_strength(a, ax * ux + ay * uy + az * uz, cx * cx + cy * cy + cz * cz, core2)
    return -k * cx, -k * cy, -k * cz
