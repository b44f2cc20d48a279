"""A lattice in one place: its normal influence, and the velocity that all circulations together induce.

Where the circulations are one set at a time, influence on every point need not be kept by ring and component:
control points keep its normal part only, and the velocity at the edges is summed edge by edge, each with its
net circulation, at the price of one product with a kept matrix. The distance of every point from every
corner serves all edges that meet there. The point index is innermost; loops write to one array each, which
lets the compiler take them by vectors.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.kernels.vortex import (
    leg_strength,
    segment_strength,
    smoothed_leg_strength,
    smoothed_segment_strength,
)
from morphcore.jit import kernel

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]


class LatticeParts(NamedTuple):
    """What of a lattice never changes (c corners, r rings, e bound edges, l wake legs, t strips).

    Lines : (e + l,) bound edges, then legs; ``line_end`` of a leg is -1. line_plus, line_minus : the ring
    whose circulation runs along the line and the one against it, r for none. line_core : core radius, m, to
    the fourth, "smoothed" squared. ring_corner : (r, 4); panel_side : (r,). corner, corner_arm and so on :
    sections and places of riders, as in `moving_lattice.Riders`. stretch : 1 / beta of Goethert's rule.
    density : kg/m^3.
    """

    line_start: IntArray
    line_end: IntArray
    line_plus: IntArray
    line_minus: IntArray
    line_core: Array
    ring_corner: IntArray
    panel_side: Array
    corner: IntArray
    corner_arm: Array
    control: IntArray
    control_arm: Array
    drag: IntArray
    drag_arm: Array
    drag_area: Array
    smoothed: bool
    stretch: float
    density: float


class LatticePlace(NamedTuple):
    """Where a lattice is, and scratch (k sections; else as above).

    R_BS, x_B : (k, 3, 3), (k, 3) of the sections. corners : (c, 3); stretched : (c, 3) by Goethert's rule.
    points : (3, r + e) control points and the edges' middles, stretched. distances : (c, r + e). normals,
    tilted : (3, r). influence : (r + 1, r) normal velocity, ring by point. row : (r + e,). strength :
    (e + l,). induced : (3, e). corner_velocity, control_velocity, drag_velocity : (c, 3), (r, 3),
    (3,). force : (c, 3).
    """

    R_BS: Array
    x_B: Array
    wake: Array
    corners: Array
    stretched: Array
    points: Array
    distances: Array
    normals: Array
    tilted: Array
    influence: Array
    row: Array
    strength: Array
    induced: Array
    corner_velocity: Array
    control_velocity: Array
    drag_velocity: Array
    force: Array


def lattice_place(parts: LatticeParts, sections: int, corners: int) -> LatticePlace:
    """Scratch for a lattice."""
    rings, edges = parts.panel_side.size, int(np.sum(parts.line_end >= 0))
    return LatticePlace(
        R_BS=np.zeros((sections, 3, 3)),
        x_B=np.zeros((sections, 3)),
        wake=np.zeros(3),
        corners=np.zeros((corners, 3)),
        stretched=np.zeros((corners, 3)),
        points=np.zeros((3, rings + edges)),
        distances=np.zeros((corners, rings + edges)),
        normals=np.zeros((3, rings)),
        tilted=np.zeros((3, rings)),
        influence=np.zeros((rings + 1, rings)),
        row=np.zeros(rings + edges),
        strength=np.zeros(parts.line_start.size),
        induced=np.zeros((3, edges)),
        corner_velocity=np.zeros((corners, 3)),
        control_velocity=np.zeros((rings, 3)),
        drag_velocity=np.zeros(3),
        force=np.zeros((corners, 3)),
    )


@kernel
def place_points(parts, place, stream_B):
    """Corners, normals, points and distances of a lattice whose sections are placed; wake along stream_B."""
    rings, edges = place.normals.shape[1], place.induced.shape[1]
    norm = sqrt(stream_B[0] ** 2 + stream_B[1] ** 2 + stream_B[2] ** 2)
    u = place.wake
    for i in range(3):
        u[i] = stream_B[i] / norm
    more = parts.stretch - 1.0
    for c in range(place.corners.shape[0]):
        _ride(place.R_BS[parts.corner[c]], place.x_B[parts.corner[c]], parts.corner_arm[c], place.corners[c])
        x, y, z = place.corners[c, 0], place.corners[c, 1], place.corners[c, 2]
        along = more * (x * u[0] + y * u[1] + z * u[2])
        place.stretched[c, 0] = x + along * u[0]
        place.stretched[c, 1] = y + along * u[1]
        place.stretched[c, 2] = z + along * u[2]
    for p in range(rings):
        control = place.control_velocity[p]  # not yet in use
        _ride(place.R_BS[parts.control[p]], place.x_B[parts.control[p]], parts.control_arm[p], control)
        along = more * (control[0] * u[0] + control[1] * u[1] + control[2] * u[2])
        for i in range(3):
            place.points[i, p] = control[i] + along * u[i]
        _normal(place.corners, parts.ring_corner[p], parts.panel_side[p], place.normals, p)
        along = more * (place.normals[0, p] * u[0] + place.normals[1, p] * u[1] + place.normals[2, p] * u[2])
        for i in range(3):
            place.tilted[i, p] = place.normals[i, p] + along * u[i]
    for e in range(edges):
        a, b = parts.line_start[e], parts.line_end[e]
        for i in range(3):
            place.points[i, rings + e] = 0.5 * (place.stretched[a, i] + place.stretched[b, i])
    x, y, z = place.points[0], place.points[1], place.points[2]
    for c in range(place.corners.shape[0]):
        px, py, pz = place.stretched[c, 0], place.stretched[c, 1], place.stretched[c, 2]
        distance = place.distances[c]
        for p in range(rings + edges):
            dx, dy, dz = px - x[p], py - y[p], pz - z[p]
            distance[p] = sqrt(dx * dx + dy * dy + dz * dz)


@kernel
def _ride(R, x, arm, out):
    for i in range(3):
        out[i] = x[i] + R[i, 0] * arm[0] + R[i, 1] * arm[1] + R[i, 2] * arm[2]


@kernel
def _normal(corners, of_ring, side, out, p):
    """Unit normal of a ring on the lifting side, across the diagonals, as `vlm.panel_normals`."""
    root_front, tip_front, root_aft, tip_aft = of_ring[0], of_ring[1], of_ring[2], of_ring[3]
    ax = corners[tip_front, 0] - corners[root_aft, 0]
    ay = corners[tip_front, 1] - corners[root_aft, 1]
    az = corners[tip_front, 2] - corners[root_aft, 2]
    bx = corners[root_front, 0] - corners[tip_aft, 0]
    by = corners[root_front, 1] - corners[tip_aft, 1]
    bz = corners[root_front, 2] - corners[tip_aft, 2]
    x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    factor = side / sqrt(x * x + y * y + z * z)
    out[0, p], out[1, p], out[2, p] = factor * x, factor * y, factor * z


@kernel
def _line(parts, place, line, first, count, out):
    """Factors k of one line's velocity -k (e x a) at ``count`` points from ``first`` on."""
    start, end = parts.line_start[line], parts.line_end[line]
    px, py, pz = place.stretched[start, 0], place.stretched[start, 1], place.stretched[start, 2]
    x = place.points[0, first : first + count]
    y = place.points[1, first : first + count]
    z = place.points[2, first : first + count]
    from_start = place.distances[start, first : first + count]
    core = parts.line_core[line]
    if end < 0:
        ex, ey, ez = place.wake[0], place.wake[1], place.wake[2]
        if parts.smoothed:
            for p in range(count):
                ax, ay, az = px - x[p], py - y[p], pz - z[p]
                cx, cy, cz = ey * az - ez * ay, ez * ax - ex * az, ex * ay - ey * ax
                along, cross2 = ax * ex + ay * ey + az * ez, cx * cx + cy * cy + cz * cz
                out[p] = smoothed_leg_strength(from_start[p], along, cross2, core)
        else:
            for p in range(count):
                ax, ay, az = px - x[p], py - y[p], pz - z[p]
                cx, cy, cz = ey * az - ez * ay, ez * ax - ex * az, ex * ay - ey * ax
                along, cross2 = ax * ex + ay * ey + az * ez, cx * cx + cy * cy + cz * cz
                out[p] = leg_strength(from_start[p], along, cross2, core)
        return ex, ey, ez
    from_end = place.distances[end, first : first + count]
    ex, ey, ez = (
        place.stretched[end, 0] - px,
        place.stretched[end, 1] - py,
        place.stretched[end, 2] - pz,
    )
    length2 = ex * ex + ey * ey + ez * ez
    if parts.smoothed:
        for p in range(count):
            ax, ay, az = px - x[p], py - y[p], pz - z[p]
            cx, cy, cz = ey * az - ez * ay, ez * ax - ex * az, ex * ay - ey * ax
            dot = ax * (ax + ex) + ay * (ay + ey) + az * (az + ez)
            cross2 = cx * cx + cy * cy + cz * cz
            out[p] = smoothed_segment_strength(from_start[p], from_end[p], dot, cross2, length2, core)
    else:
        for p in range(count):
            ax, ay, az = px - x[p], py - y[p], pz - z[p]
            cx, cy, cz = ey * az - ez * ay, ez * ax - ex * az, ex * ay - ey * ax
            dot = ax * (ax + ex) + ay * (ay + ey) + az * (az + ez)
            cross2 = cx * cx + cy * cy + cz * cz
            out[p] = segment_strength(from_start[p], from_end[p], dot, cross2, length2, core)
    return ex, ey, ez


@kernel
def normal_influence(parts, place):
    """Fill in the normal velocity at every control point of every ring of unit circulation, wake included."""
    rings = place.normals.shape[1]
    place.influence[:] = 0.0
    k = place.row
    x, y, z = place.points[0], place.points[1], place.points[2]
    # the stretched velocity is w + (stretch - 1) u u.w, its normal part w . tilted
    nx, ny, nz = place.tilted[0], place.tilted[1], place.tilted[2]
    for line in range(parts.line_start.size):
        ex, ey, ez = _line(parts, place, line, 0, rings, k)
        start = parts.line_start[line]
        px, py, pz = place.stretched[start, 0], place.stretched[start, 1], place.stretched[start, 2]
        for p in range(rings):
            ax, ay, az = px - x[p], py - y[p], pz - z[p]
            cx, cy, cz = ey * az - ez * ay, ez * ax - ex * az, ex * ay - ey * ax
            k[p] = k[p] * (cx * nx[p] + cy * ny[p] + cz * nz[p])
        along, against = place.influence[parts.line_plus[line]], place.influence[parts.line_minus[line]]
        for p in range(rings):
            along[p] -= k[p]
        for p in range(rings):
            against[p] += k[p]


@kernel
def induced_velocity(parts, place, gamma):
    """Fill in the velocity (3, e) at the edges' middles that rings of circulation gamma (r,) induce."""
    rings, edges = place.normals.shape[1], place.induced.shape[1]
    place.induced[:] = 0.0
    k = place.row
    x, y, z = place.points[0, rings:], place.points[1, rings:], place.points[2, rings:]
    u, v, w = place.induced[0], place.induced[1], place.induced[2]
    for line in range(parts.line_start.size):
        plus, minus = parts.line_plus[line], parts.line_minus[line]
        strength = (gamma[plus] if plus < rings else 0.0) - (gamma[minus] if minus < rings else 0.0)
        place.strength[line] = strength
        ex, ey, ez = _line(parts, place, line, rings, edges, k)
        start = parts.line_start[line]
        px, py, pz = place.stretched[start, 0], place.stretched[start, 1], place.stretched[start, 2]
        ex, ey, ez = strength * ex, strength * ey, strength * ez
        for p in range(edges):
            u[p] -= k[p] * (ey * (pz - z[p]) - ez * (py - y[p]))
        for p in range(edges):
            v[p] -= k[p] * (ez * (px - x[p]) - ex * (pz - z[p]))
        for p in range(edges):
            w[p] -= k[p] * (ex * (py - y[p]) - ey * (px - x[p]))
    more = parts.stretch - 1.0
    if more > 0.0:
        for p in range(edges):
            along = more * (u[p] * place.wake[0] + v[p] * place.wake[1] + w[p] * place.wake[2])
            u[p] += along * place.wake[0]
            v[p] += along * place.wake[1]
            w[p] += along * place.wake[2]


@kernel
def refine(influence, inverse, right, residual, tolerance, most, gamma):
    """Improve gamma (r,) until ``influence`` (r + 1, r), ring by point, times it gives right (r,).

    With the inverse (r, r) of a like matrix, point by ring: what is left goes down by the part by which both
    differ. Returns whether it became smaller than ``tolerance`` times the largest of right in ``most`` passes.
    """
    rings = right.size
    scale = 0.0
    for p in range(rings):
        scale = max(scale, abs(right[p]))
    for turn in range(most + 1):
        for p in range(rings):
            residual[p] = right[p]
        for q in range(rings):
            strength, row = gamma[q], influence[q]
            for p in range(rings):
                residual[p] -= strength * row[p]
        left = 0.0
        for p in range(rings):
            left = max(left, abs(residual[p]))
        if left <= tolerance * scale:
            return True
        if turn < most:
            for p in range(rings):
                strength, row = residual[p], inverse[p]
                for q in range(rings):
                    gamma[q] += strength * row[q]
    return False
