"""Kutta-Joukowski forces and profile drag of a lattice on its sections, for changing velocities."""

from __future__ import annotations

from math import sqrt

from morphcore.aero.kernels.lattice_place import induced_velocity, normal_influence, place_points
from morphcore.jit import entry_kernel, kernel


@entry_kernel
def place_lattice(parts, place, stream_B):
    """Put the lattice on the sections of ``place``, wake along stream_B (3,); compute normal influence."""
    place_points(parts, place, stream_B)
    normal_influence(parts, place)


@entry_kernel
def deflect(parts, place, deflection):
    """Set the slopes of the panels for the deflections (c,) of all control surfaces, trailing edge down."""
    for p in range(place.flap_slope.size):
        total = 0.0
        for c in range(deflection.size):
            total += deflection[c] * parts.control_slope[c, p]
        place.flap_slope[p] = total


@kernel
def rider_velocity(R, twist, arm, out):
    """Velocity (3,) in B of a point at ``arm`` on a section of axes R (3, 3) and ``twist`` (6,)."""
    vx = twist[3] + twist[1] * arm[2] - twist[2] * arm[1]
    vy = twist[4] + twist[2] * arm[0] - twist[0] * arm[2]
    vz = twist[5] + twist[0] * arm[1] - twist[1] * arm[0]
    for i in range(3):
        out[i] = R[i, 0] * vx + R[i, 1] * vy + R[i, 2] * vz


@kernel
def add_rider_force(R, arm, fx, fy, fz, out):
    """Add a force in B on a riding point to its section's force vector (6,), in section axes."""
    x = R[0, 0] * fx + R[1, 0] * fy + R[2, 0] * fz
    y = R[0, 1] * fx + R[1, 1] * fy + R[2, 1] * fz
    z = R[0, 2] * fx + R[1, 2] * fy + R[2, 2] * fz
    out[0] += arm[1] * z - arm[2] * y
    out[1] += arm[2] * x - arm[0] * z
    out[2] += arm[0] * y - arm[1] * x
    out[3] += x
    out[4] += y
    out[5] += z


@entry_kernel
def blocked_flow(parts, place, twists, wind_B, out):
    """Normal velocity (r,) that the circulations have to induce at the control points, m/s.

    ``twists`` (k, 6) of the sections in their axes; wind_B (3,). A panel with a slope also meets the velocity
    along its section's chord (x, forward); its normal is on the lifting side, hence the sign.
    """
    controlled = parts.control_slope.shape[0] > 0
    for p in range(out.size):
        k = parts.control[p]
        velocity = place.control_velocity[p]
        rider_velocity(place.R_BS[k], twists[k], parts.control_arm[p], velocity)
        total = 0.0
        for i in range(3):
            total += place.normals[i, p] * (velocity[i] - wind_B[i])
        if controlled:
            along = 0.0
            for i in range(3):
                along += place.R_BS[k, i, 0] * (velocity[i] - wind_B[i])
            total -= place.flap_slope[p] * along
        out[p] = total


@entry_kernel
def section_forces(parts, place, gamma, twists, wind_B, still, out):
    """Force vectors (k, 6) on the sections, in their axes, for the acting circulations (r,).

    Each bound edge bears density * gamma * velocity x edge, half on each end corner; its middle moves with
    the mean of its corners. Profile drag of each strip is along the velocity of its middle. ``still`` :
    tolerance of `induced_velocity`, 0 for exact.
    """
    induced_velocity(parts, place, gamma, still)
    for c in range(place.corners.shape[0]):
        k = parts.corner[c]
        rider_velocity(place.R_BS[k], twists[k], parts.corner_arm[c], place.corner_velocity[c])
    corners, moved, force = place.corners, place.corner_velocity, place.force
    force[:] = 0.0
    for e in range(place.induced.shape[1]):
        a, b = parts.line_start[e], parts.line_end[e]
        strength = 0.5 * parts.density * place.strength[e]
        ex, ey, ez = (
            corners[b, 0] - corners[a, 0],
            corners[b, 1] - corners[a, 1],
            corners[b, 2] - corners[a, 2],
        )
        u = strength * (wind_B[0] - 0.5 * (moved[a, 0] + moved[b, 0]) + place.induced[0, e])
        v = strength * (wind_B[1] - 0.5 * (moved[a, 1] + moved[b, 1]) + place.induced[1, e])
        w = strength * (wind_B[2] - 0.5 * (moved[a, 2] + moved[b, 2]) + place.induced[2, e])
        fx, fy, fz = v * ez - w * ey, w * ex - u * ez, u * ey - v * ex
        force[a, 0] += fx
        force[a, 1] += fy
        force[a, 2] += fz
        force[b, 0] += fx
        force[b, 1] += fy
        force[b, 2] += fz
    out[:] = 0.0
    for c in range(place.corners.shape[0]):
        k = parts.corner[c]
        add_rider_force(place.R_BS[k], parts.corner_arm[c], force[c, 0], force[c, 1], force[c, 2], out[k])
    flow = place.drag_velocity
    for t in range(parts.drag.size):
        k = parts.drag[t]
        rider_velocity(place.R_BS[k], twists[k], parts.drag_arm[t], flow)
        u, v, w = wind_B[0] - flow[0], wind_B[1] - flow[1], wind_B[2] - flow[2]
        factor = 0.5 * parts.density * parts.drag_area[t] * sqrt(u * u + v * v + w * w)
        add_rider_force(place.R_BS[k], parts.drag_arm[t], factor * u, factor * v, factor * w, out[k])
