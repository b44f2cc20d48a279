"""Links of a surface that telescopes: their shares of the strips, which move along it as it slides.

A surface that telescopes has strips on its visible part only. What other surfaces have as constants, the
shares of strips on links, profile drag and cm0, changes here with the extension: it is computed at each
stage from the ends of the strips, which are tabulated along the drive like the lattice.
"""

from __future__ import annotations

from morphcore.aero.kernels.loads import (
    AREA,
    AREA_CHORD,
    INBOARD,
    L_DRAG,
    L_DRAG_Y,
    L_MOMENT,
    L_MOMENT_Y,
    LINK0,
    LINKS,
    OUTBOARD,
    PAIR0,
    STRIP0,
    STRIPS,
    TELESCOPES,
)
from morphcore.jit import inlined, kernel
from morphcore.lanes import not_in_lanes
from morphcore.multibody.kernels.articulated import L_OFFSET, LINK_ROWS


@inlined
def per(total, weight):
    """total / weight; 0 where both are."""
    return total / weight if weight > 0.0 else 0.0


@kernel
def visible_links(lanes, surface, strips, constants, edges, links, overlap):
    """Fill links and overlap (rows as among the constants) of a surface at its present extension.

    constants : rows of all links; of a surface that telescopes, L_DRAG and L_MOMENT hold coefficients, and
    become areas here. edges : 2 scratch rows.
    """
    if not_in_lanes(constants, lanes) or not_in_lanes(edges, lanes):
        return
    if not_in_lanes(links, lanes) or not_in_lanes(overlap, lanes):
        return
    sign, count, strip0 = float(surface[TELESCOPES]), surface[LINKS], surface[STRIP0]
    tip = strips[strip0 + surface[STRIPS] - 1, OUTBOARD]
    for l in range(len(lanes)):
        edges[1, l] = 0.0
    for k in range(count):
        first = LINK_ROWS * (surface[LINK0] + k)
        own, out = constants[first : first + LINK_ROWS], links[first : first + LINK_ROWS]
        for i in range(LINK_ROWS):
            for l in range(len(lanes)):
                out[i, l] = own[i, l]
        for l in range(len(lanes)):
            edges[0, l] = edges[1, l]
            edges[1, l] = tip
            for i in range(L_DRAG, L_DRAG_Y + 1):
                out[i, l] = 0.0
            for i in range(L_MOMENT, L_MOMENT_Y + 1):
                out[i, l] = 0.0
        if k < count - 1:
            following = constants[first + LINK_ROWS : first + 2 * LINK_ROWS]
            for l in range(len(lanes)):
                edges[1, l] = edges[0, l] + sign * following[L_OFFSET, l]
        for j in range(surface[STRIPS]):
            inboard, outboard = strips[strip0 + j, INBOARD], strips[strip0 + j, OUTBOARD]
            area, squared = strips[strip0 + j, AREA], strips[strip0 + j, AREA_CHORD]
            pair = 2 * (surface[PAIR0] + j * count + k)
            part = overlap[pair : pair + 2]
            for l in range(len(lanes)):
                low, high = max(inboard, edges[0, l]), min(outboard, edges[1, l])
                weight = max(high - low, 0.0) / (outboard - inboard)
                y = sign * (0.5 * (low + high) - edges[0, l]) if weight > 0.0 else 0.0
                part[0, l], part[1, l] = weight, y
                out[L_DRAG, l] += weight * area
                out[L_DRAG_Y, l] += weight * area * y
                out[L_MOMENT, l] += weight * squared
                out[L_MOMENT_Y, l] += weight * squared * y
        for l in range(len(lanes)):
            out[L_DRAG_Y, l] = per(out[L_DRAG_Y, l], out[L_DRAG, l])
            out[L_MOMENT_Y, l] = per(out[L_MOMENT_Y, l], out[L_MOMENT, l])
            out[L_DRAG, l] *= own[L_DRAG, l]
            out[L_MOMENT, l] *= own[L_MOMENT, l]
