"""A lattice in one position: its normal influence, and the velocity induced by all circulations together.

With one set of circulations at a time, influence need not be stored for every point, ring and component:
control points keep the normal part only, and the velocity at the edges is summed edge by edge, each with its
net circulation, at the cost of one product with a stored matrix. The distance of every point from every
corner serves all edges that meet there. The point index is innermost; each loop writes to one array, which
lets the compiler vectorise it.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.kernels.vortex import (
    grown_core,
    leg_strength,
    segment_strength,
    smoothed_leg_strength,
    smoothed_segment_strength,
)
from morphcore.jit import inlined, kernel

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]


class LatticeParts(NamedTuple):
    """The constant parts of a lattice (c corners, r rings, e bound edges, l wake legs, t strips).

    Lines : (e + l,) bound edges, then legs; ``line_end`` of a leg is -1. line_plus, line_minus : the ring
    whose circulation runs along the line, and the one against it; r for none. line_core : core radius, m, to
    the fourth, "smoothed" squared; line_width4, line_chord2 : of legs, as in `vortex.grown_core`.
    ring_corner : (r, 4); panel_side : (r,). corner, corner_arm and so on : sections and places of riders, as
    in `moving_lattice.Riders`. moment_area : (t,) cm0 times the integral of the chord squared, m^3. slope :
    (r,) of the mean line, nose up. stretch : 1 / beta of Goethert's rule. density :
    kg/m^3. control_slope : (c, r) slopes of the panels per unit deflection of each control surface.
    ring_strip : (r,) strip of each ring. limits : (t, 2) smallest (negative) and largest circulation over the
    speed, m: lift coefficient times half the chord; (0, 2) if no section stalls.
    """

    line_start: IntArray
    line_end: IntArray
    line_plus: IntArray
    line_minus: IntArray
    line_core: Array
    line_width4: Array
    line_chord2: Array
    ring_corner: IntArray
    panel_side: Array
    corner: IntArray
    corner_arm: Array
    control: IntArray
    control_arm: Array
    drag: IntArray
    drag_arm: Array
    drag_area: Array
    moment_area: Array
    control_chord: Array
    drag_chord: Array
    slope: Array
    smoothed: bool
    stretch: float
    density: float
    control_slope: Array
    ring_strip: IntArray
    limits: Array


class LatticePlace(NamedTuple):
    """Where a lattice is, and scratch (k sections; else as above).

    R_BS, x_B : (k, 3, 3), (k, 3) of the sections. corners : (c, 3); stretched : (c, 3) by Goethert's rule.
    points : (3, r + e) control points and the edges' middles, stretched. distances : (c, r + e). normals,
    tilted : (3, r). influence : (r + 1, r) normal velocity, ring by point. row : (r + e,). strength :
    (e + l,). induced : (3, e), of the circulations summed (r,). corner_velocity, control_velocity,
    drag_velocity : (c, 3), (r, 3), (3,). force : (c, 3). slope : (r,) at each control point, of the mean line
    and of deflected controls, nose up or trailing edge down.
    share : (t,) of the circulation of each strip that is kept within its limits.
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
    summed: Array
    corner_velocity: Array
    control_velocity: Array
    drag_velocity: Array
    force: Array
    slope: Array
    share: Array


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
        summed=np.zeros(rings),
        corner_velocity=np.zeros((corners, 3)),
        control_velocity=np.zeros((rings, 3)),
        drag_velocity=np.zeros(3),
        force=np.zeros((corners, 3)),
        slope=np.zeros(rings),
        share=np.zeros(parts.drag.size),
    )


@inlined
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
        place.summed[p] = inf  # data of another place
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
        _distances(
            x, y, z, place.stretched[c, 0], place.stretched[c, 1], place.stretched[c, 2], place.distances[c]
        )


@kernel
def _distances(x, y, z, px, py, pz, out):
    for p in range(out.size):
        dx, dy, dz = px - x[p], py - y[p], pz - z[p]
        out[p] = sqrt(dx * dx + dy * dy + dz * dz)


@inlined
def _ride(R, x, arm, out):
    for i in range(3):
        out[i] = x[i] + R[i, 0] * arm[0] + R[i, 1] * arm[1] + R[i, 2] * arm[2]


@inlined
def _normal(corners, of_ring, side, out, p):
    """Unit normal of a ring on the lifting side, across the diagonals."""
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
def _segments(x, y, z, from_start, from_end, px, py, pz, ex, ey, ez, core, smoothed, out):
    """Factors k of a segment's velocity -k (e x a) at points; the core law is chosen outside the loops."""
    length2 = ex * ex + ey * ey + ez * ez
    if smoothed:
        for p in range(out.size):
            ax, ay, az = px - x[p], py - y[p], pz - z[p]
            cx, cy, cz = ey * az - ez * ay, ez * ax - ex * az, ex * ay - ey * ax
            dot = ax * (ax + ex) + ay * (ay + ey) + az * (az + ez)
            cross2 = cx * cx + cy * cy + cz * cz
            out[p] = smoothed_segment_strength(from_start[p], from_end[p], dot, cross2, length2, core)
    else:
        for p in range(out.size):
            ax, ay, az = px - x[p], py - y[p], pz - z[p]
            cx, cy, cz = ey * az - ez * ay, ez * ax - ex * az, ex * ay - ey * ax
            dot = ax * (ax + ex) + ay * (ay + ey) + az * (az + ez)
            cross2 = cx * cx + cy * cy + cz * cz
            out[p] = segment_strength(from_start[p], from_end[p], dot, cross2, length2, core)


@kernel
def _legs(x, y, z, from_start, px, py, pz, ux, uy, uz, core, width4, chord2, smoothed, out):
    """Factors k of a leg's velocity -k (u x a) at points."""
    if smoothed:
        for p in range(out.size):
            ax, ay, az = px - x[p], py - y[p], pz - z[p]
            cx, cy, cz = uy * az - uz * ay, uz * ax - ux * az, ux * ay - uy * ax
            along, cross2 = ax * ux + ay * uy + az * uz, cx * cx + cy * cy + cz * cz
            out[p] = smoothed_leg_strength(from_start[p], along, cross2, core)
    else:
        for p in range(out.size):
            ax, ay, az = px - x[p], py - y[p], pz - z[p]
            cx, cy, cz = uy * az - uz * ay, uz * ax - ux * az, ux * ay - uy * ax
            along, cross2 = ax * ux + ay * uy + az * uz, cx * cx + cy * cy + cz * cz
            out[p] = leg_strength(from_start[p], along, cross2, grown_core(along, core, width4, chord2))


@kernel
def _project(x, y, z, px, py, pz, ex, ey, ez, nx, ny, nz, k):
    """Replace k by k times (e x a) . n."""
    for p in range(k.size):
        ax, ay, az = px - x[p], py - y[p], pz - z[p]
        cx, cy, cz = ey * az - ez * ay, ez * ax - ex * az, ex * ay - ey * ax
        k[p] = k[p] * (cx * nx[p] + cy * ny[p] + cz * nz[p])


@kernel
def _add(factor, k, out):
    for p in range(k.size):
        out[p] += factor * k[p]


@kernel
def _subtract_turned(k, y, z, py, pz, ey, ez, out):
    """Subtract one component of k (e x a) from ``out``."""
    for p in range(k.size):
        out[p] -= k[p] * (ey * (pz - z[p]) - ez * (py - y[p]))


@inlined
def _along(parts, place, line):
    """Start (3) and edge or direction (3) of a line."""
    start, end = parts.line_start[line], parts.line_end[line]
    px, py, pz = place.stretched[start, 0], place.stretched[start, 1], place.stretched[start, 2]
    if end < 0:
        return px, py, pz, place.wake[0], place.wake[1], place.wake[2]
    ex, ey, ez = place.stretched[end, 0] - px, place.stretched[end, 1] - py, place.stretched[end, 2] - pz
    return px, py, pz, ex, ey, ez


@inlined
def normal_influence(parts, place):
    """Compute the normal velocity at every control point from every unit ring, wake included."""
    rings = place.normals.shape[1]
    place.influence[:] = 0.0
    k = place.row[:rings]
    x, y, z = place.points[0, :rings], place.points[1, :rings], place.points[2, :rings]
    # the stretched velocity is w + (stretch - 1) u u.w, its normal part w . tilted
    nx, ny, nz = place.tilted[0], place.tilted[1], place.tilted[2]
    for line in range(parts.line_start.size):
        px, py, pz, ex, ey, ez = _along(parts, place, line)
        core, end = parts.line_core[line], parts.line_end[line]
        from_start = place.distances[parts.line_start[line], :rings]
        if end < 0:
            width4, chord2 = parts.line_width4[line], parts.line_chord2[line]
            _legs(x, y, z, from_start, px, py, pz, ex, ey, ez, core, width4, chord2, parts.smoothed, k)
        else:
            from_end = place.distances[end, :rings]
            _segments(x, y, z, from_start, from_end, px, py, pz, ex, ey, ez, core, parts.smoothed, k)
        _project(x, y, z, px, py, pz, ex, ey, ez, nx, ny, nz, k)
        _add(-1.0, k, place.influence[parts.line_plus[line]])
        _add(1.0, k, place.influence[parts.line_minus[line]])


@inlined
def induced_velocity(parts, place, gamma, still):
    """Compute the lines' net circulations and the velocity (3, e) that they induce at the edges' middles.

    gamma : (r,) of the rings. The velocity is kept if no circulation has changed by more than ``still`` of
    the largest since it was summed in this place.
    """
    rings = place.normals.shape[1]
    largest, moved = 0.0, 0.0
    for q in range(rings):
        largest = max(largest, abs(gamma[q]))
        moved = max(moved, abs(gamma[q] - place.summed[q]))
    for line in range(parts.line_start.size):
        plus, minus = parts.line_plus[line], parts.line_minus[line]
        strength = (gamma[plus] if plus < rings else 0.0) - (gamma[minus] if minus < rings else 0.0)
        place.strength[line] = strength
    if not moved <= still * largest:
        _sum_induced(parts, place, gamma)


@inlined
def _sum_induced(parts, place, gamma):
    """Sum the velocity (3, e) at the edges' middles line by line."""
    rings, edges = place.normals.shape[1], place.induced.shape[1]
    for q in range(rings):
        place.summed[q] = gamma[q]
    place.induced[:] = 0.0
    k = place.row[:edges]
    x, y, z = place.points[0, rings:], place.points[1, rings:], place.points[2, rings:]
    u, v, w = place.induced[0], place.induced[1], place.induced[2]
    for line in range(parts.line_start.size):
        strength = place.strength[line]
        px, py, pz, ex, ey, ez = _along(parts, place, line)
        core, end = parts.line_core[line], parts.line_end[line]
        from_start = place.distances[parts.line_start[line], rings:]
        if end < 0:
            width4, chord2 = parts.line_width4[line], parts.line_chord2[line]
            _legs(x, y, z, from_start, px, py, pz, ex, ey, ez, core, width4, chord2, parts.smoothed, k)
        else:
            from_end = place.distances[end, rings:]
            _segments(x, y, z, from_start, from_end, px, py, pz, ex, ey, ez, core, parts.smoothed, k)
        ex, ey, ez = strength * ex, strength * ey, strength * ez
        _subtract_turned(k, y, z, py, pz, ey, ez, u)
        _subtract_turned(k, z, x, pz, px, ez, ex, v)
        _subtract_turned(k, x, y, px, py, ex, ey, w)
    more = parts.stretch - 1.0
    if more > 0.0:
        for p in range(edges):
            along = more * (u[p] * place.wake[0] + v[p] * place.wake[1] + w[p] * place.wake[2])
            u[p] += along * place.wake[0]
            v[p] += along * place.wake[1]
            w[p] += along * place.wake[2]


@kernel
def refine(influence, inverse, right, residual, tolerance, maximum, gamma):
    """Improve gamma (r,) until ``influence`` (r + 1, r), ring by point, times it gives right (r,).

    Uses the inverse (r, r), point by ring, of a similar matrix: each pass reduces the residual in proportion
    to the difference of the two. Returns whether it fell below ``tolerance`` times the largest element of
    right within ``most`` passes.
    """
    rings = right.size
    scale = 0.0
    for p in range(rings):
        scale = max(scale, abs(right[p]))
    for turn in range(maximum + 1):
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
        if turn < maximum:
            for p in range(rings):
                strength, row = residual[p], inverse[p]
                for q in range(rings):
                    gamma[q] += strength * row[q]
    return False
