"""Loads of a gust that is not the same everywhere, on chains of links; added to those of still air.

The air's velocity in a flight is a row of numbers: the uniform wind (3), and in a gust, for each strip, the
gust's velocity there (3) and the same as the circulation follows it, by Küssner's function (3); all in N. The
second drives the circulation beside the links' own lagged motion. The first is the local velocity: by
Kutta-Joukowski, the force of a circulation is linear in it, so what the gust adds is computed by itself, and
flights without a gust cost nothing.
"""

from __future__ import annotations

import math

from morphcore.aero.kernels.loads import (
    CHORD_X,
    CHORD_Y,
    CONTROL0,
    CONTROL_END,
    CONTROLLED,
    EDGE_DX,
    EDGE_DY,
    EDGE_X,
    EDGE_Y,
    L_CENTRE,
    L_DRAG,
    L_DRAG_Y,
    L_LIFT,
    L_MOMENT,
    L_MOMENT_Y,
    L_SLOPE,
    L_SLOPE_Y,
    LINK0,
    LINKS,
    OUTPUTS,
    PAIR0,
    STRIP0,
)
from morphcore.jit import inlined, kernel
from morphcore.lanes import not_in_lanes

UNIFORM = 3  # columns of a row of the air before the strips' gusts
GUST, FOLLOWED, GUST_COLUMNS = 0, 3, 6  # of each strip


@inlined
def in_link(axes, north, east, down, l):
    """A vector in N, in the link's axes; ``axes`` (9 rows): north, east and down in them."""
    return (
        axes[0, l] * north + axes[3, l] * east + axes[6, l] * down,
        axes[1, l] * north + axes[4, l] * east + axes[7, l] * down,
        axes[2, l] * north + axes[5, l] * east + axes[8, l] * down,
    )


@kernel
def gust_inputs(lanes, surface, k, ranges, strips, overlap, air, axes, link, inputs):
    """Subtract the gust on link ``k`` from the velocities of its strips, and from those along controls."""
    if not_in_lanes(overlap, lanes) or not_in_lanes(axes, lanes) or not_in_lanes(link, lanes):
        return
    if not_in_lanes(inputs, lanes):
        return
    number = surface[LINK0] + k
    for j in range(ranges[number, 0], ranges[number, 1]):
        strip = surface[STRIP0] + j
        pair = 2 * (surface[PAIR0] + j * surface[LINKS] + k)
        part = overlap[pair : pair + 2]
        out = inputs[2 * strip]
        first = UNIFORM + GUST_COLUMNS * strip + FOLLOWED
        north, east, down = air[first], air[first + 1], air[first + 2]
        cx, cy = strips[strip, CHORD_X], strips[strip, CHORD_Y]
        for l in range(len(lanes)):
            x, y, z = in_link(axes, north, east, down, l)
            slope = link[L_SLOPE, l] + part[1, l] * link[L_SLOPE_Y, l]
            out[l] -= part[0, l] * link[L_LIFT, l] * (z + slope * (cx * x + cy * y))
        if surface[CONTROLLED] <= j < surface[CONTROL_END]:
            along = inputs[surface[CONTROL0] + j]
            for l in range(len(lanes)):
                x, y, z = in_link(axes, north, east, down, l)
                along[l] -= part[0, l] * link[L_LIFT, l] * (cx * x + cy * y)


@kernel
def gust_wrench(
    lanes, surface, k, ranges, strips, overlap, outputs, air, axes, link, twist, density, sums, wrench
):
    """Add to the wrench (6 rows) of the air on link ``k`` what the local velocity of the gust changes.

    The forces of the circulation, as in ``link_wrench``, and the differences of profile drag and cm0 in the
    mean gust over the link. ``sums``: 6 scratch rows.
    """
    if (
        not_in_lanes(overlap, lanes)
        or not_in_lanes(outputs, lanes)
        or not_in_lanes(axes, lanes)
        or not_in_lanes(link, lanes)
    ):
        return
    if not_in_lanes(twist, lanes) or not_in_lanes(sums, lanes) or not_in_lanes(wrench, lanes):
        return
    number = surface[LINK0] + k
    cx, cy = strips[surface[STRIP0], CHORD_X], strips[surface[STRIP0], CHORD_Y]
    for i in range(6):
        row = sums[i]
        for l in range(len(lanes)):
            row[l] = 0.0
    for j in range(ranges[number, 0], ranges[number, 1]):
        strip = surface[STRIP0] + j
        pair = 2 * (surface[PAIR0] + j * surface[LINKS] + k)
        part = overlap[pair : pair + 2]
        out = outputs[OUTPUTS * strip : OUTPUTS * strip + OUTPUTS]
        edge, aside = strips[strip, EDGE_X], strips[strip, EDGE_Y]
        ex, ey = strips[strip, EDGE_DX], strips[strip, EDGE_DY]
        first = UNIFORM + GUST_COLUMNS * strip + GUST
        north, east, down = air[first], air[first + 1], air[first + 2]
        for l in range(len(lanes)):
            x, y, z = in_link(axes, north, east, down, l)
            weight, edge_y = part[0, l], part[1, l] + aside
            g, moment = weight * out[0, l], weight * out[1, l]
            lift, suction = g * (ex * y - ey * x), -g * z
            forward, across = ey * suction, ex * suction
            sums[0, l] -= edge_y * lift - moment * y
            sums[1, l] += edge * lift - moment * x
            sums[2, l] -= edge_y * forward + edge * across
            sums[3, l] += forward
            sums[4, l] -= across
            sums[5, l] -= lift
    for l in range(len(lanes)):
        fx, fy, fz = density * sums[3, l], density * sums[4, l], density * sums[5, l]
        shift = link[L_CENTRE, l]
        wrench[0, l] += density * sums[0, l] + shift * cy * fz
        wrench[1, l] += density * sums[1, l] - shift * cx * fz
        wrench[2, l] += density * sums[2, l] + shift * (cx * fy - cy * fx)
        wrench[3, l] += fx
        wrench[4, l] += fy
        wrench[5, l] += fz
        sums[0, l] = sums[1, l] = sums[2, l] = 0.0
        sums[3, l] = 1e-300  # a link of no width has no strips
    for j in range(ranges[number, 0], ranges[number, 1]):
        strip = surface[STRIP0] + j
        part = overlap[2 * (surface[PAIR0] + j * surface[LINKS] + k)]
        first = UNIFORM + GUST_COLUMNS * strip + GUST
        north, east, down = air[first], air[first + 1], air[first + 2]
        for l in range(len(lanes)):
            x, y, z = in_link(axes, north, east, down, l)
            sums[0, l] += part[l] * x
            sums[1, l] += part[l] * y
            sums[2, l] += part[l] * z
            sums[3, l] += part[l]
    for l in range(len(lanes)):
        gx, gy, gz = sums[0, l] / sums[3, l], sums[1, l] / sums[3, l], sums[2, l] / sums[3, l]
        y, wx, wz = link[L_DRAG_Y, l], twist[0, l], twist[2, l]
        vx, vy, vz = twist[3, l] - wz * y, twist[4, l], twist[5, l] + wx * y
        ux, uy, uz = vx - gx, vy - gy, vz - gz
        factor = -0.5 * density * link[L_DRAG, l]
        before = factor * math.sqrt(vx * vx + vy * vy + vz * vz)
        after = factor * math.sqrt(ux * ux + uy * uy + uz * uz)
        dx, dy, dz = after * ux - before * vx, after * uy - before * vy, after * uz - before * vz
        y0 = link[L_MOMENT_Y, l]
        along, normal = cx * (twist[3, l] - wz * y0) + cy * twist[4, l], twist[5, l] + wx * y0
        along_gust = along - cx * gx - cy * gy
        changed = along_gust * along_gust + (normal - gz) * (normal - gz) - along * along - normal * normal
        nose_up = 0.5 * density * link[L_MOMENT, l] * changed
        wrench[0, l] += y * dz - cy * nose_up
        wrench[1, l] += cx * nose_up
        wrench[2, l] -= y * dx
        wrench[3, l] += dx
        wrench[4, l] += dy
        wrench[5, l] += dz
