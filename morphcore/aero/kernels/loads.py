"""Air loads on chains of flat links from a reduced lattice operator shared by all lanes.

The lattice is fixed on the undeformed surface; its strips ride on the links. A strip that spans a joint
belongs to both links in proportion to its width on each (``overlap``), so that loads are continuous in the
division lengths. The operator maps the normal velocity of the strips (two inputs each: at the link axis, and
its slope along the chord) to five outputs each, from which the Kutta-Joukowski forces on all bound edges
follow (see aero/operator.py for their derivation):

    0  g = Gamma dy       circulation at the trailing edge times strip width, m^3/s
    1  S = sum Gamma_i A_i              vortex moment of the strip's rings, m^4/s
    2  X = sum Gamma_i A_i x_i          its chordwise moment, m^5/s
    3  w_x   induced normal velocity weighted by the bound spanwise circulation, m/s
    4  w_y   the same for the chordwise edges, m/s

All quantities are in link axes; velocities are those of the structure relative to still air.
"""

from __future__ import annotations

import math

from morphcore.jit import kernel
from morphcore.lanes import not_in_lanes

OUTPUTS = 5
# rows of a link's constants after its mass properties: drag area (m^2) and its y (m); of the slow and of the
# fast lag the decay over half a step and the weight of a step; lift factor; aerodynamic-centre offset (m,
# forward)
L_DRAG, L_DRAG_Y = 8, 9
L_SLOW_DECAY, L_SLOW_WEIGHT, L_FAST_DECAY, L_FAST_WEIGHT = 10, 11, 12, 13
L_LIFT, L_CENTRE = 14, 15
# Wagner's function by R. T. Jones (1940): 1 - A1 exp(-b1 s) - A2 exp(-b2 s), s in semichords travelled
JONES_A1, JONES_B1 = 0.165, 0.0455
JONES_A2, JONES_B2 = 0.335, 0.3
JONES_MEAN_LAG = JONES_A1 / JONES_B1 + JONES_A2 / JONES_B2  # semichords
# columns of the table of surfaces
LINK0, LINKS, STRIP0, STRIPS, PAIR0, PAIRED, CONTROL0, CONTROLLED, CONTROL_END = 0, 1, 2, 3, 4, 5, 6, 7, 8


@kernel
def lagged_motion(lanes, link, twist, slow, fast, previous, effective):
    """Compute the motion that drives the circulation: lagged (v_z, omega_x, omega_y) times lift factor.

    ``slow`` and ``fast`` hold both exponentials carried to the present for a motion that stayed at
    ``previous``; the contribution of its linear change since then, in proportion to the lag weights of the
    link, is added here.
    """
    if (
        not_in_lanes(link, lanes)
        or not_in_lanes(twist, lanes)
        or not_in_lanes(slow, lanes)
        or not_in_lanes(fast, lanes)
    ):
        return
    if not_in_lanes(previous, lanes) or not_in_lanes(effective, lanes):
        return
    now = 1.0 - JONES_A1 - JONES_A2
    for i in range(3):
        source = twist[(5, 0, 1)[i]]
        for l in range(len(lanes)):
            motion = source[l]
            change = motion - previous[i, l]
            effective[i, l] = link[L_LIFT, l] * (
                now * motion
                + JONES_A1 * (slow[i, l] + link[L_SLOW_WEIGHT, l] * change)
                + JONES_A2 * (fast[i, l] + link[L_FAST_WEIGHT, l] * change)
            )


@kernel
def strip_inputs(lanes, surface, ranges, overlap, effective, inputs):
    """Normal velocity of each strip of a surface at the link axis and its slope along x: two rows each."""
    if not_in_lanes(overlap, lanes) or not_in_lanes(effective, lanes) or not_in_lanes(inputs, lanes):
        return
    strip0, strips = surface[STRIP0], surface[STRIPS]
    for j in range(2 * strip0, 2 * (strip0 + strips)):
        row = inputs[j]
        for l in range(len(lanes)):
            row[l] = 0.0
    for k in range(surface[LINKS]):
        link = surface[LINK0] + k
        motion = effective[3 * link : 3 * link + 3]
        for j in range(ranges[link, 0], ranges[link, 1]):
            pair = 2 * (surface[PAIR0] + j * surface[LINKS] + k)
            part = overlap[pair : pair + 2]
            out = inputs[2 * (strip0 + j) : 2 * (strip0 + j) + 2]
            for l in range(len(lanes)):
                weight = part[0, l]
                out[0, l] += weight * (motion[0, l] + part[1, l] * motion[1, l])
                out[1, l] -= weight * motion[2, l]


@kernel
def control_inputs(lanes, surface, k, ranges, overlap, link, twist, inputs):
    """Add what link ``k`` gives to the velocity along the chord of each strip with controls.

    These are the strips from CONTROLLED to CONTROL_END, one row each at CONTROL0 + strip. The operator's
    columns of these inputs hold the deflections, lagged beforehand.
    """
    if not_in_lanes(overlap, lanes) or not_in_lanes(link, lanes) or not_in_lanes(twist, lanes):
        return
    if not_in_lanes(inputs, lanes):
        return
    control0 = surface[CONTROL0]
    if k == 0:
        for j in range(surface[CONTROLLED], surface[CONTROL_END]):
            row = inputs[control0 + j]
            for l in range(len(lanes)):
                row[l] = 0.0
    number = surface[LINK0] + k
    first, end = max(ranges[number, 0], surface[CONTROLLED]), min(ranges[number, 1], surface[CONTROL_END])
    for j in range(first, end):
        pair = 2 * (surface[PAIR0] + j * surface[LINKS] + k)
        part = overlap[pair : pair + 2]
        out = inputs[control0 + j]
        for l in range(len(lanes)):
            out[l] += part[0, l] * link[L_LIFT, l] * (twist[3, l] - part[1, l] * twist[2, l])


@kernel
def lane_product(lanes, matrix, inputs, outputs):
    """outputs = matrix @ inputs, (rows, columns) x (columns, width); rows a multiple of 8, columns of 4."""
    if not_in_lanes(inputs, lanes) or not_in_lanes(outputs, lanes):
        return
    rows, columns = matrix.shape
    for o in range(0, rows, 8):
        y = outputs[o : o + 8]
        m = matrix[o : o + 8]
        for r in range(8):
            for l in range(len(lanes)):
                y[r, l] = 0.0
        for i in range(0, columns, 4):
            x = inputs[i : i + 4]
            a0, b0, c0, d0 = m[0, i], m[0, i + 1], m[0, i + 2], m[0, i + 3]
            a1, b1, c1, d1 = m[1, i], m[1, i + 1], m[1, i + 2], m[1, i + 3]
            a2, b2, c2, d2 = m[2, i], m[2, i + 1], m[2, i + 2], m[2, i + 3]
            a3, b3, c3, d3 = m[3, i], m[3, i + 1], m[3, i + 2], m[3, i + 3]
            a4, b4, c4, d4 = m[4, i], m[4, i + 1], m[4, i + 2], m[4, i + 3]
            a5, b5, c5, d5 = m[5, i], m[5, i + 1], m[5, i + 2], m[5, i + 3]
            a6, b6, c6, d6 = m[6, i], m[6, i + 1], m[6, i + 2], m[6, i + 3]
            a7, b7, c7, d7 = m[7, i], m[7, i + 1], m[7, i + 2], m[7, i + 3]
            for l in range(len(lanes)):
                p, q, s, t = x[0, l], x[1, l], x[2, l], x[3, l]
                y[0, l] += a0 * p + b0 * q + c0 * s + d0 * t
                y[1, l] += a1 * p + b1 * q + c1 * s + d1 * t
                y[2, l] += a2 * p + b2 * q + c2 * s + d2 * t
                y[3, l] += a3 * p + b3 * q + c3 * s + d3 * t
                y[4, l] += a4 * p + b4 * q + c4 * s + d4 * t
                y[5, l] += a5 * p + b5 * q + c5 * s + d5 * t
                y[6, l] += a6 * p + b6 * q + c6 * s + d6 * t
                y[7, l] += a7 * p + b7 * q + c7 * s + d7 * t


@kernel
def link_wrench(lanes, surface, k, ranges, strips, overlap, outputs, link, twist, density, sums, wrench):
    """Wrench (6 rows) of the air on link ``k`` of a surface: its share of the strips, and profile drag.

    ``strips`` (n, 3): trailing edge x and circulation centre x of each strip from the link axis, m, and the
    slope dx/dy of the trailing edge. ``sums``: 13 scratch rows. Profile drag is quadratic in the velocity at
    the link's centre of drag area.
    """
    if (
        not_in_lanes(overlap, lanes)
        or not_in_lanes(outputs, lanes)
        or not_in_lanes(link, lanes)
        or not_in_lanes(twist, lanes)
    ):
        return
    if not_in_lanes(sums, lanes) or not_in_lanes(wrench, lanes):
        return
    for i in range(13):
        row = sums[i]
        for l in range(len(lanes)):
            row[l] = 0.0
    number = surface[LINK0] + k
    slope = strips[surface[STRIP0], 2]  # one slope for the whole surface: taper is linear
    for j in range(ranges[number, 0], ranges[number, 1]):
        pair = 2 * (surface[PAIR0] + j * surface[LINKS] + k)
        part = overlap[pair : pair + 2]
        strip = surface[STRIP0] + j
        out = outputs[OUTPUTS * strip : OUTPUTS * strip + OUTPUTS]
        edge, centre = strips[strip, 0], strips[strip, 1]
        for l in range(len(lanes)):
            weight, y = part[0, l], part[1, l]
            g = weight * out[0, l]
            moment = weight * out[1, l]
            sums[0, l] += g
            sums[1, l] += g * y
            sums[2, l] += g * y * y
            sums[3, l] += g * edge
            sums[4, l] += g * edge * y
            sums[5, l] += moment
            sums[6, l] += moment * y
            sums[7, l] += weight * out[2, l]
            sums[8, l] += g * centre
            sums[9, l] += g * centre * y
            sums[10, l] += g * out[3, l]
            sums[11, l] += g * y * out[3, l]
            sums[12, l] += g * out[4, l]
    for l in range(len(lanes)):
        wx, wy, wz = twist[0, l], twist[1, l], twist[2, l]
        ux, uy, uz = twist[3, l], twist[4, l], twist[5, l]
        g0, g1, g2 = sums[0, l], sums[1, l], sums[2, l]
        # a slanted trailing edge also meets spanwise flow; slope times chord times yaw rate is neglected
        vy_slope = uy * slope
        wz_slope = wz * slope
        lift = ux * g0 - wz * g1 - vy_slope * g0 - wz_slope * sums[3, l]
        fz = -density * lift
        fx = density * (uz * g0 + wx * g1 - wy * sums[8, l] - sums[10, l])
        fy = density * (sums[5, l] * wx - sums[12, l])
        mx = -density * (
            sums[5, l] * uy + sums[7, l] * wz + ux * g1 - wz * g2 - vy_slope * g1 - wz_slope * sums[4, l]
        )
        my = density * (
            sums[5, l] * ux - sums[6, l] * wz + ux * sums[3, l] - wz * sums[4, l] - vy_slope * sums[3, l]
        )
        mz = -density * (uz * g1 + wx * g2 - wy * sums[9, l] - sums[11, l])
        my -= link[L_CENTRE, l] * fz
        mz += link[L_CENTRE, l] * fy
        y = link[L_DRAG_Y, l]
        vx, vy, vz = ux - wz * y, uy, uz + wx * y
        drag = -0.5 * density * link[L_DRAG, l] * math.sqrt(vx * vx + vy * vy + vz * vz)
        dx, dy, dz = drag * vx, drag * vy, drag * vz
        wrench[0, l] = mx + y * dz
        wrench[1, l] = my
        wrench[2, l] = mz - y * dx
        wrench[3, l] = fx + dx
        wrench[4, l] = fy + dy
        wrench[5, l] = fz + dz
