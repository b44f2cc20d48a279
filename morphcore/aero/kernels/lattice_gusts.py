"""A gust on a lattice that rides on sections, and the limits of its sections' lift.

``gust`` is a row of numbers, for each strip the gust's velocity (3) and what of it goes into the lagged
circulation (3), in N, as in `gust_loads`; empty without a gust. ``R_NB`` is the fuselage's attitude. What the
gust adds to flow and forces is computed by itself, so that flights without one cost nothing.
"""

from __future__ import annotations

from math import sqrt

from morphcore.aero.kernels.gust_loads import FOLLOWED, GUST, GUST_COLUMNS
from morphcore.aero.kernels.lattice_forces import add_rider_force, rider_velocity
from morphcore.aero.kernels.stall import kept
from morphcore.jit import entry_kernel, inlined


@inlined
def in_body(R_NB, gust, first, axis):
    """Component in B of a velocity in N that begins at a column of the row."""
    return R_NB[0, axis] * gust[first] + R_NB[1, axis] * gust[first + 1] + R_NB[2, axis] * gust[first + 2]


@entry_kernel
def add_gust_flow(parts, place, R_NB, gust, out):
    """Add the gust's part to the normal velocity (r,) of `lattice_forces.blocked_flow`."""
    for p in range(out.size):
        first = GUST_COLUMNS * parts.ring_strip[p] + FOLLOWED
        k, slope = parts.control[p], place.slope[p]
        for i in range(3):
            velocity = in_body(R_NB, gust, first, i)
            chord = place.R_BS[k, i, 0] * parts.control_chord[p, 0]
            chord += place.R_BS[k, i, 1] * parts.control_chord[p, 1]
            out[p] -= (place.normals[i, p] - slope * chord) * velocity


@entry_kernel
def add_gust_forces(parts, place, R_NB, gust, twists, wind_B, out):
    """Add the gust's part to the forces (k, 6) of `lattice_forces.section_forces`, called just before.

    An edge between two strips meets the mean of their gusts.
    """
    rings, w = parts.panel_side.size, place.drag_velocity
    for e in range(place.induced.shape[1]):
        plus, minus = parts.line_plus[e], parts.line_minus[e]
        one = plus if plus < rings else minus
        two = minus if minus < rings else plus
        for i in range(3):
            w[i] = 0.5 * in_body(R_NB, gust, GUST_COLUMNS * parts.ring_strip[one] + GUST, i)
            w[i] += 0.5 * in_body(R_NB, gust, GUST_COLUMNS * parts.ring_strip[two] + GUST, i)
        a, b = parts.line_start[e], parts.line_end[e]
        strength = 0.5 * parts.density * place.strength[e]
        ex = strength * (place.corners[b, 0] - place.corners[a, 0])
        ey = strength * (place.corners[b, 1] - place.corners[a, 1])
        ez = strength * (place.corners[b, 2] - place.corners[a, 2])
        fx, fy, fz = w[1] * ez - w[2] * ey, w[2] * ex - w[0] * ez, w[0] * ey - w[1] * ex
        for c in (a, b):
            k = parts.corner[c]
            add_rider_force(place.R_BS[k], parts.corner_arm[c], fx, fy, fz, out[k])
    for t in range(parts.drag.size):
        k, first = parts.drag[t], GUST_COLUMNS * t + GUST
        R, flow = place.R_BS[k], place.drag_velocity
        rider_velocity(R, twists[k], parts.drag_arm[t], flow)
        u, v, n = wind_B[0] - flow[0], wind_B[1] - flow[1], wind_B[2] - flow[2]
        gu, gv, gn = (
            u + in_body(R_NB, gust, first, 0),
            v + in_body(R_NB, gust, first, 1),
            n + in_body(R_NB, gust, first, 2),
        )
        factor = 0.5 * parts.density * parts.drag_area[t]
        before, after = factor * sqrt(u * u + v * v + n * n), factor * sqrt(gu * gu + gv * gv + gn * gn)
        fx, fy, fz = after * gu - before * u, after * gv - before * v, after * gn - before * n
        add_rider_force(R, parts.drag_arm[t], fx, fy, fz, out[k])
        cx, cy = parts.drag_chord[t, 0], parts.drag_chord[t, 1]
        change = _in_section(R, cx, cy, gu, gv, gn) - _in_section(R, cx, cy, u, v, n)
        nose_up = 0.5 * parts.density * parts.moment_area[t] * change
        out[k, 0] -= cy * nose_up
        out[k, 1] += cx * nose_up


@inlined
def _in_section(R, cx, cy, u, v, w):
    """Square of the part of a velocity in B that is in the section's plane."""
    x = (R[0, 0] * u + R[1, 0] * v + R[2, 0] * w) * cx + (R[0, 1] * u + R[1, 1] * v + R[2, 1] * w) * cy
    z = R[0, 2] * u + R[1, 2] * v + R[2, 2] * w
    return x * x + z * z


@entry_kernel
def limit_circulation(parts, place, R_NB, gust, twists, wind_B, acting, worst):
    """Cut off the acting circulations (r,) at the limits of their sections' lift, in place.

    A strip's rings are reduced alike. worst : (3,) gets the largest ratio of lift to its limit before, the
    strip's number, and 1 for its upper limit, 0 for its lower one.
    """
    worst[:] = 0.0
    strips, flow = parts.drag.size, place.drag_velocity
    for p in range(acting.size):
        place.share[parts.ring_strip[p]] = acting[p]  # that of the trailing edge remains
    for t in range(strips):
        k = parts.drag[t]
        R = place.R_BS[k]
        rider_velocity(R, twists[k], parts.drag_arm[t], flow)
        for i in range(3):
            flow[i] -= wind_B[i]
            if gust.size:
                flow[i] -= in_body(R_NB, gust, GUST_COLUMNS * t + GUST, i)
        speed = sqrt(
            _in_section(R, parts.drag_chord[t, 0], parts.drag_chord[t, 1], flow[0], flow[1], flow[2])
        )
        low, high, gamma = parts.limits[t, 0], parts.limits[t, 1], place.share[t]
        ratio = gamma / (speed * (high if gamma > 0.0 else low))
        if ratio > worst[0]:
            worst[0], worst[1] = ratio, t
            worst[2] = 1.0 if gamma > 0.0 else 0.0
        place.share[t] = kept(gamma, low, high, speed)
    for p in range(acting.size):
        acting[p] *= place.share[parts.ring_strip[p]]
