"""Air loads on chains of flat links from a reduced lattice operator shared by all lanes.

The lattice is fixed on the undeformed surface; its strips ride on the links. A strip that spans a joint
belongs to both links in proportion to its width on each (``overlap``), so that loads are continuous in the
division lengths. The operator maps the normal velocity of the strips (two inputs each: at the link axis, and
its slope along the chord, which is oblique in link axes on a swept surface) to five outputs each, from which
the Kutta-Joukowski forces on all bound edges follow (see aero/operator.py for their derivation):

    0  g = Gamma dy       circulation at the trailing edge times strip width, m^3/s
    1  S = sum Gamma_i A_i              vortex moment of the strip's rings, m^4/s
    2  X = sum Gamma_i A_i x_i          its chordwise moment, m^5/s
    3  w_x   induced normal velocity weighted by the bound circulation along y, m/s
    4  w_y   the same for that along x, m/s

Both are sums over all bound edges, per circulation and width of the strip. Unless all surfaces and their
wakes are in one plane, three more outputs of each strip follow those of all strips:

    0  u_n   induced velocity in the plane, m/s, that adds to the normal force as much as motion along x
    1  m_z   moment about z of the in-plane forces of induced velocity, about the strip's middle on the axis,
             per density and g, m^2/s
    2  m_y   moment of the normal force of 0: u_n times the distance along x from the axis, m^2/s

and output 2 is m_x, the same with the distance along y. X is then S times ``VORTEX_X``, its centroid in
uniform incidence: it only meets the yaw rate, which changes the velocity along the chord by less than a
thousandth.

All quantities are in link axes; velocities are those of the structure relative to still air.
"""

from __future__ import annotations

import math

from morphcore.jit import inlined, kernel
from morphcore.lanes import not_in_lanes

OUTPUTS, MORE_OUTPUTS = 5, 3
# columns of the table of strips, in link axes about each strip's middle on the link axis (the elastic axis),
# m: middle of the trailing edge, x of the centre of circulation; the trailing edge, in the sense of the
# lifting circulation, per width of the strip; unit vector of the chord, forward, and its y over x; centroid
# of the strip's vortex moment along x
EDGE_X, CENTRE_X, EDGE_DX, EDGE_DY, EDGE_Y, CHORD_X, CHORD_Y, CHORD_SLOPE, VORTEX_X = range(9)
STRIP_COLUMNS = 9
# where a surface telescopes, further columns, 0 on others: ends of the strip, m from the root along the axis;
# area weighted by the share of the profile drag, m^2; integral of the chord squared, m^3
INBOARD, OUTBOARD, AREA, AREA_CHORD = range(STRIP_COLUMNS, STRIP_COLUMNS + 4)
SLIDING_COLUMNS = 4
# rows of a link's constants after its mass properties: drag area (m^2) and its y (m); of the slow and of the
# fast lag the decay over half a step and the weight of a step; lift factor; aerodynamic-centre offset (m,
# forward); slope of the sections (twist less zero-lift angle) at the link's origin, and its growth along y
# (1/m); what the link's yaw rate adds to v_z (m) and to omega_x (see ``sloped``); cm0 times the integral of
# the chord squared (m^3), and the y of its centroid (m); unit vector of the chords, forward, and its y over x
L_DRAG, L_DRAG_Y = 8, 9
L_SLOW_DECAY, L_SLOW_WEIGHT, L_FAST_DECAY, L_FAST_WEIGHT = 10, 11, 12, 13
L_LIFT, L_CENTRE = 14, 15
L_SLOPE, L_SLOPE_Y, L_TURN, L_TURN_Y, L_MOMENT, L_MOMENT_Y = 16, 17, 18, 19, 20, 21
L_CHORD_X, L_CHORD_Y, L_SKEW = 22, 23, 24
# Wagner's function by R. T. Jones (1940): 1 - A1 exp(-b1 s) - A2 exp(-b2 s), s in semichords travelled
JONES_A1, JONES_B1 = 0.165, 0.0455
JONES_A2, JONES_B2 = 0.335, 0.3
JONES_MEAN_LAG = JONES_A1 / JONES_B1 + JONES_A2 / JONES_B2  # semichords
# columns of the table of surfaces
LINK0, LINKS, STRIP0, STRIPS, PAIR0, PAIRED, MORE0 = 0, 1, 2, 3, 4, 5, 6
CONTROL0, CONTROLLED, CONTROL_END, LUMPED = 7, 8, 9, 10
TELESCOPES = 11  # sign of the span (+1 right, -1 left) if the surface telescopes, else 0


@inlined
def sloped(link, twist, l):
    """The link's motion (v_z, omega_x, omega_y) with that of its sections' slope added.

    In linear theory a section of slope s meets the normal velocity v_z + y omega_x + u s of a flat one. The
    velocity along its chord is u = u0 - y c r with the chord's x component c and the yaw rate r = omega_z,
    the slope s = s0 + s1 y. On a link from 0 to L the product's y^2 is replaced by the line L y - L^2 / 6, of
    the same integral and moment. The sum is then the motion of a flat link, with v_z + s0 u0 + s1 L^2 / 6 c r
    and omega_x + s1 u0 - (s0 + s1 L) c r, and lags as such. On an oblique chord omega_y takes a share that
    leaves the velocity's slope along the chord as it is.
    """
    forward = link[L_CHORD_X, l] * twist[3, l] + link[L_CHORD_Y, l] * twist[4, l]
    turn = twist[2, l]
    raised = link[L_SLOPE_Y, l] * forward + link[L_TURN_Y, l] * turn
    return (
        twist[5, l] + link[L_SLOPE, l] * forward + link[L_TURN, l] * turn,
        twist[0, l] + raised,
        twist[1, l] + link[L_SKEW, l] * raised,
    )


@inlined
def lagged(motion, change, slow, fast, slow_weight, fast_weight):
    """A component of the motion after Jones' lag, from both lag states and the change since those."""
    return (
        (1.0 - JONES_A1 - JONES_A2) * motion
        + JONES_A1 * (slow + slow_weight * change)
        + JONES_A2 * (fast + fast_weight * change)
    )


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
    for l in range(len(lanes)):
        z, x, y = sloped(link, twist, l)
        lift, w_slow, w_fast = link[L_LIFT, l], link[L_SLOW_WEIGHT, l], link[L_FAST_WEIGHT, l]
        effective[0, l] = lift * lagged(z, z - previous[0, l], slow[0, l], fast[0, l], w_slow, w_fast)
        effective[1, l] = lift * lagged(x, x - previous[1, l], slow[1, l], fast[1, l], w_slow, w_fast)
        effective[2, l] = lift * lagged(y, y - previous[2, l], slow[2, l], fast[2, l], w_slow, w_fast)


@kernel
def strip_inputs(lanes, surface, ranges, strips, overlap, effective, inputs):
    """Normal velocity of each strip of a surface at the link axis and its slope along the chord: two rows."""
    if not_in_lanes(overlap, lanes) or not_in_lanes(effective, lanes) or not_in_lanes(inputs, lanes):
        return
    strip0 = surface[STRIP0]
    for j in range(2 * strip0, 2 * (strip0 + surface[STRIPS])):
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
            cx, cy = strips[strip0 + j, CHORD_X], strips[strip0 + j, CHORD_Y]
            for l in range(len(lanes)):
                weight = part[0, l]
                out[0, l] += weight * (motion[0, l] + part[1, l] * motion[1, l])
                out[1, l] += weight * (cy * motion[1, l] - cx * motion[2, l])


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
            forward = twist[3, l] - part[1, l] * twist[2, l]
            along = link[L_CHORD_X, l] * forward + link[L_CHORD_Y, l] * twist[4, l]
            out[l] += part[0, l] * link[L_LIFT, l] * along


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


@inlined
def open_edge(twist, g, edge, edge_y, ex, ey, behind, w_x, l):
    """Forces of a strip's open trailing edge in the velocity there: lift, suction along x and y, drag."""
    wx, wy, wz = twist[0, l], twist[1, l], twist[2, l]
    lift = g * (ey * (twist[3, l] - wz * edge_y) - ex * (twist[4, l] + wz * edge))
    suction = g * (twist[5, l] + wx * edge_y - wy * edge)
    return lift, ey * suction, ex * suction, g * (wy * behind + w_x)


@kernel
def link_wrench(lanes, surface, k, ranges, strips, overlap, outputs, link, twist, density, sums, wrench):
    """Wrench (6 rows) of the air on link ``k`` of a surface: its share of the strips, profile drag, cm0.

    ``strips`` : table of the strips. ``sums``: 6 scratch rows. Each strip has the force of its open trailing
    edge in the velocity there and the moments of its closed rings (see aero/operator.py); the in-plane force
    of a pitch rate acts at the centre of circulation. Profile drag is quadratic in the velocity at the link's
    centre of drag area, the moment cm0 of the sections in its part in their planes.
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
    for i in range(6):
        row = sums[i]
        for l in range(len(lanes)):
            row[l] = 0.0
    number = surface[LINK0] + k
    cx, cy = strips[surface[STRIP0], CHORD_X], strips[surface[STRIP0], CHORD_Y]
    for j in range(ranges[number, 0], ranges[number, 1]):
        pair = 2 * (surface[PAIR0] + j * surface[LINKS] + k)
        part = overlap[pair : pair + 2]
        strip = surface[STRIP0] + j
        out = outputs[OUTPUTS * strip : OUTPUTS * strip + OUTPUTS]
        edge, centre = strips[strip, EDGE_X], strips[strip, CENTRE_X]
        ex, ey, aside = strips[strip, EDGE_DX], strips[strip, EDGE_DY], strips[strip, EDGE_Y]
        slope = strips[strip, CHORD_SLOPE]
        behind = centre - edge
        if surface[MORE0] < 0:
            for l in range(len(lanes)):
                wz, weight, y = twist[2, l], part[0, l], part[1, l]
                g, moment, edge_y = weight * out[0, l], weight * out[1, l], y + aside
                lift, forward, across, back = open_edge(twist, g, edge, edge_y, ex, ey, behind, out[3, l], l)
                sums[0, l] -= edge_y * lift + moment * twist[4, l] + weight * out[2, l] * wz
                sums[1, l] += edge * lift + moment * (twist[3, l] - wz * y) - weight * out[2, l] * wz * slope
                sums[2, l] += y * back - edge_y * forward - edge * across
                sums[3, l] += forward - back
                sums[4, l] += moment * twist[0, l] - across - g * out[4, l]
                sums[5, l] -= lift
            continue
        more = outputs[surface[MORE0] + MORE_OUTPUTS * j : surface[MORE0] + MORE_OUTPUTS * (j + 1)]
        vortex_x, vortex_y = strips[strip, VORTEX_X], slope * strips[strip, VORTEX_X]
        for l in range(len(lanes)):
            wz, weight, y = twist[2, l], part[0, l], part[1, l]
            g, moment, edge_y = weight * out[0, l], weight * out[1, l], y + aside
            lift, forward, across, back = open_edge(twist, g, edge, edge_y, ex, ey, behind, out[3, l], l)
            normal = g * more[0, l]
            sums[0, l] += y * normal + g * out[2, l] - edge_y * lift - moment * (twist[4, l] + wz * vortex_x)
            sums[1, l] += edge * lift + moment * (twist[3, l] - wz * (y + vortex_y)) - g * more[2, l]
            sums[2, l] += y * back - edge_y * forward - edge * across + g * more[1, l]
            sums[3, l] += forward - back
            sums[4, l] += moment * twist[0, l] - across - g * out[4, l]
            sums[5, l] += normal - lift
    for l in range(len(lanes)):
        wx, wz = twist[0, l], twist[2, l]
        fx, fy, fz = density * sums[3, l], density * sums[4, l], density * sums[5, l]
        shift = link[L_CENTRE, l]
        mx = density * sums[0, l] + shift * cy * fz
        my = density * sums[1, l] - shift * cx * fz
        mz = density * sums[2, l] + shift * (cx * fy - cy * fx)
        y = link[L_DRAG_Y, l]
        vx, vy, vz = twist[3, l] - wz * y, twist[4, l], twist[5, l] + wx * y
        drag = -0.5 * density * link[L_DRAG, l] * math.sqrt(vx * vx + vy * vy + vz * vz)
        dx, dy, dz = drag * vx, drag * vy, drag * vz
        y0 = link[L_MOMENT_Y, l]
        along, normal = cx * (twist[3, l] - wz * y0) + cy * twist[4, l], twist[5, l] + wx * y0
        nose_up = 0.5 * density * link[L_MOMENT, l] * (along * along + normal * normal)
        wrench[0, l] = mx - cy * nose_up + y * dz
        wrench[1, l] = my + cx * nose_up
        wrench[2, l] = mz - y * dx
        wrench[3, l] = fx + dx
        wrench[4, l] = fy + dy
        wrench[5, l] = fz + dz
