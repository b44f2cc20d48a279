"""Links of a surface that telescopes: their shares of the strips and the stiffness of their joints.

A surface that telescopes has strips on its visible part only, and the inner panel holds its hidden part
straight. What other surfaces have as constants, the shares of strips on links, profile drag, cm0, stiffness
and damping of joints, changes here with the extension: it is computed at each stage from the ends of the
strips, which are tabulated along the drive like the lattice.
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

HELD = 1e-3  # compliance of the parts that another panel holds straight, as a share of their own


@inlined
def per(total, weight):
    """total / weight; 0 where both are."""
    return total / weight if weight > 0.0 else 0.0


@inlined
def telescopes(surfaces):
    """Whether any surface does."""
    found = False
    for s in range(surfaces.shape[0]):
        found = found or surfaces[s, TELESCOPES] != 0
    return found


@kernel
def held_joints(lanes, surfaces, strips, links, stiffness, damping, held_stiffness, held_damping):
    """Stiffness and damping of all joints, with those of hidden parts held: rows as among the constants.

    A joint of the chain stands for a segment of the beam: it turns as the segment bends under a moment that
    falls linearly to the tip (`models.links.joint_stiffness`). Only the visible part of it bends; with the
    share of the segment's compliance (taken as that of a uniform one) that is visible its stiffness is
    divided, by HELD at least, as in the flexible model.

    links : constants' rows of all links; L_DRAG_Y holds the outboard end of the segment of the joint at the
    link's outboard end, m from the root.
    """
    if not_in_lanes(links, lanes) or not_in_lanes(stiffness, lanes) or not_in_lanes(damping, lanes):
        return
    if not_in_lanes(held_stiffness, lanes) or not_in_lanes(held_damping, lanes):
        return
    joint = 0
    for s in range(surfaces.shape[0]):
        strip0, first = surfaces[s, STRIP0], surfaces[s, LINK0]
        slides = surfaces[s, TELESCOPES] != 0
        hidden, tip = strips[strip0, INBOARD], strips[strip0 + surfaces[s, STRIPS] - 1, OUTBOARD]
        for k in range(surfaces[s, LINKS] - 1):
            own = links[LINK_ROWS * (first + k) : LINK_ROWS * (first + k + 1)]
            inner = links[LINK_ROWS * (first + k - 1) : LINK_ROWS * (first + k)] if k > 0 else own
            for l in range(len(lanes)):
                share = 1.0
                if slides:
                    end, start = own[L_DRAG_Y, l], inner[L_DRAG_Y, l] if k > 0 else 0.0
                    seen = min(max(start, hidden), end)
                    all_of_it = (tip - start) ** 2 - (tip - end) ** 2
                    share = max(((tip - seen) ** 2 - (tip - end) ** 2) / all_of_it, HELD)
                for i in range(3 * joint, 3 * joint + 3):
                    held_stiffness[i, l] = stiffness[i, l] / share
                    held_damping[i, l] = damping[i, l] / share
            joint += 1


@kernel
def visible_links(lanes, surface, strips, constants, edges, links, overlap):
    """Fill links and overlap (rows as among the constants) of a surface at its present extension.

    constants : rows of all links; of a surface that telescopes, L_DRAG and L_MOMENT hold coefficients that
    are multiplied by areas here, and L_DRAG_Y is as in ``held_joints``. edges : 2 scratch rows.
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
