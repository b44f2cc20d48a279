"""The limits of a section's lift: circulations beyond them are cut off, smoothly."""

from __future__ import annotations

import math

from morphcore.aero.kernels.gust_loads import GUST, GUST_COLUMNS, UNIFORM, in_link
from morphcore.aero.kernels.loads import (
    CHORD_X,
    CHORD_Y,
    LINK0,
    LINKS,
    OUTPUTS,
    PAIR0,
    STRIP0,
    STRIPS,
)
from morphcore.jit import inlined, kernel
from morphcore.lanes import not_in_lanes

KNEE = 0.1  # share of the limit below and above it over which the lift curve bends
TINY = 1e-100


@inlined
def capped(value, limit):
    """The value below ``1 - KNEE`` of a positive limit, the limit above ``1 + KNEE``; a parabola between.

    The curve and its slope are continuous, and the limit is never exceeded.
    """
    bend = KNEE * limit
    over = min(max(value - limit + bend, 0.0), 2.0 * bend)
    return value - over * over / (4.0 * bend) - max(value - limit - bend, 0.0)


@inlined
def kept(value, low, high, speed):
    """Share of a circulation that is kept between both limits, low < 0 < high, times the speed."""
    held = -capped(-capped(value, high * speed + TINY), -low * speed + TINY)
    return held / value if abs(value) > TINY else 1.0


@kernel
def strip_speed(lanes, surface, j, ranges, strips, overlap, air, axes, twists, sums):
    """Speed of a strip's middle on the link axis in the plane of its section, relative to the air: sums[0].

    ``twists``: rows of all links. axes : of all links, read in a gust only (`gust_loads`). sums : 2 rows.
    """
    if not_in_lanes(overlap, lanes) or not_in_lanes(axes, lanes) or not_in_lanes(twists, lanes):
        return
    if not_in_lanes(sums, lanes):
        return
    strip = surface[STRIP0] + j
    cx, cy = strips[strip, CHORD_X], strips[strip, CHORD_Y]
    for l in range(len(lanes)):
        sums[0, l] = 0.0
        sums[1, l] = 0.0
    for k in range(surface[LINKS]):
        number = surface[LINK0] + k
        if not ranges[number, 0] <= j < ranges[number, 1]:
            continue
        pair = 2 * (surface[PAIR0] + j * surface[LINKS] + k)
        part, twist = overlap[pair : pair + 2], twists[6 * number : 6 * number + 6]
        for l in range(len(lanes)):
            forward = twist[3, l] - twist[2, l] * part[1, l]
            sums[0, l] += part[0, l] * (cx * forward + cy * twist[4, l])
            sums[1, l] += part[0, l] * (twist[5, l] + twist[0, l] * part[1, l])
        if air.shape[0] > UNIFORM:
            first = UNIFORM + GUST_COLUMNS * strip + GUST
            north, east, down = air[first], air[first + 1], air[first + 2]
            own = axes[9 * number : 9 * number + 9]
            for l in range(len(lanes)):
                x, y, z = in_link(own, north, east, down, l)
                sums[0, l] -= part[0, l] * (cx * x + cy * y)
                sums[1, l] -= part[0, l] * z
    for l in range(len(lanes)):
        sums[0, l] = math.sqrt(sums[0, l] * sums[0, l] + sums[1, l] * sums[1, l])


@kernel
def limit_lift(lanes, surface, ranges, strips, overlap, air, axes, twists, limits, outputs, sums):
    """Cut off the circulation of a surface's strips at their sections' limits.

    ``limits``: of each strip, the smallest (negative) and largest circulation times width over the speed,
    m^2: lift coefficient times half the area. The others as in ``strip_speed``.
    """
    if not_in_lanes(outputs, lanes) or not_in_lanes(sums, lanes):
        return
    for j in range(surface[STRIPS]):
        strip_speed(lanes, surface, j, ranges, strips, overlap, air, axes, twists, sums)
        strip = surface[STRIP0] + j
        out = outputs[OUTPUTS * strip : OUTPUTS * strip + 3]
        low, high = limits[2 * strip], limits[2 * strip + 1]
        for l in range(len(lanes)):
            share = kept(out[0, l], low, high, sums[0, l])
            out[0, l] *= share
            out[1, l] *= share
            out[2, l] *= share
