"""Circulation and Kutta-Joukowski forces of a lattice whose influence is frozen while velocities change."""

from __future__ import annotations

from morphcore.jit import entry_kernel


@entry_kernel
def normal_influence(normals, velocity, out):
    """Normal velocity (r, r) at control points of rings: velocity (3, rings, points), r points first."""
    rings = normals.shape[0]
    for p in range(rings):
        nx, ny, nz = normals[p, 0], normals[p, 1], normals[p, 2]
        for q in range(rings):
            out[p, q] = nx * velocity[0, q, p] + ny * velocity[1, q, p] + nz * velocity[2, q, p]


@entry_kernel
def rider_velocities(section, arm, R_BS, twist, out):
    """Velocities (m, 3) in B of points that ride on sections: at ``arm`` (m, 3) in axes of ``section`` (m,).

    R_BS (k, 3, 3) section axes to B; twist (k, 6) of the sections in their own axes.
    """
    for m in range(section.size):
        k = section[m]
        x, y, z = arm[m, 0], arm[m, 1], arm[m, 2]
        vx = twist[k, 3] + twist[k, 1] * z - twist[k, 2] * y
        vy = twist[k, 4] + twist[k, 2] * x - twist[k, 0] * z
        vz = twist[k, 5] + twist[k, 0] * y - twist[k, 1] * x
        for i in range(3):
            out[m, i] = R_BS[k, i, 0] * vx + R_BS[k, i, 1] * vy + R_BS[k, i, 2] * vz


@entry_kernel
def corner_forces(
    velocity,
    first,
    gamma,
    wind,
    corner_velocity,
    corners,
    start,
    end,
    plus,
    minus,
    density,
    local,
    out,
):
    """Force of the air on the bound edges, density * gamma * velocity x edge, half on each end corner.

    velocity (3, r, points) with the edges' midpoints from point ``first`` on; gamma (r,) circulations; wind
    (3,) and corner_velocity (c, 3) of air and structure, m/s: an edge's midpoint moves with the mean of its
    corners. local (3, e) is scratch; out (c, 3), N.
    """
    edges = start.size
    for axis in range(3):
        row = local[axis]
        for e in range(edges):
            row[e] = wind[axis] - 0.5 * (corner_velocity[start[e], axis] + corner_velocity[end[e], axis])
        for q in range(gamma.size):
            source, strength = velocity[axis, q], gamma[q]
            for e in range(edges):
                row[e] += strength * source[first + e]
    out[:] = 0.0
    for e in range(edges):
        a, b = start[e], end[e]
        strength = 0.0
        if plus[e] >= 0:
            strength += gamma[plus[e]]
        if minus[e] >= 0:
            strength -= gamma[minus[e]]
        strength *= 0.5 * density
        ex, ey, ez = (
            corners[b, 0] - corners[a, 0],
            corners[b, 1] - corners[a, 1],
            corners[b, 2] - corners[a, 2],
        )
        fx = strength * (local[1, e] * ez - local[2, e] * ey)
        fy = strength * (local[2, e] * ex - local[0, e] * ez)
        fz = strength * (local[0, e] * ey - local[1, e] * ex)
        for corner in (a, b):
            out[corner, 0] += fx
            out[corner, 1] += fy
            out[corner, 2] += fz


@entry_kernel
def add_rider_forces(section, arm, R_BS, force, out):
    """Add forces (m, 3) in B on riding points to force vectors (k, 6) of their sections, in section axes."""
    for m in range(section.size):
        k = section[m]
        fx, fy, fz = force[m, 0], force[m, 1], force[m, 2]
        x = R_BS[k, 0, 0] * fx + R_BS[k, 1, 0] * fy + R_BS[k, 2, 0] * fz
        y = R_BS[k, 0, 1] * fx + R_BS[k, 1, 1] * fy + R_BS[k, 2, 1] * fz
        z = R_BS[k, 0, 2] * fx + R_BS[k, 1, 2] * fy + R_BS[k, 2, 2] * fz
        out[k, 0] += arm[m, 1] * z - arm[m, 2] * y
        out[k, 1] += arm[m, 2] * x - arm[m, 0] * z
        out[k, 2] += arm[m, 0] * y - arm[m, 1] * x
        out[k, 3] += x
        out[k, 4] += y
        out[k, 5] += z
