"""Torque of the hinge motors along a flight, and the loads on its surfaces."""

from __future__ import annotations

from morphcore.aero.kernels.loads import (
    CHORD_X,
    CHORD_Y,
    LINK0,
    LINKS,
    LUMPED,
    OUTPUTS,
    PAIR0,
    STRIP0,
    STRIPS,
)
from morphcore.jit import entry_kernel, kernel
from morphcore.models.kernels.chain import clear
from morphcore.models.kernels.layout import (
    APPARENT,
    LINKS_C,
    OMEGA,
    S_CARRIED,
    S_INERTIA,
    S_SUMS,
    constant_rows,
    gravity_rows_of_scratch,
    joint_rows_of_scratch,
    link_rows_of_scratch,
)
from morphcore.multibody.kernels.articulated import LINK_ROWS, add_apparent, add_bias, add_link, add_lump
from morphcore.multibody.kernels.gimbal import JOINT_ROWS, carry_through_gimbal
from morphcore.simulate.kernels.step import instant_rates


@entry_kernel
def torques(
    lanes,
    surfaces, ranges, shared, strips, hinges, hinge_accelerations, columns, screws, operators, wind,
    constants, states, zero, block, scratch, inputs, outputs, rates, out, twist_rates, roots, bodies,
    sections,
):  # fmt: skip
    """Inverse dynamics of every wing at each of some instants of one flight.

    Leaves the accelerations of all links in the scratch block by the forward pass, then sums over each wing,
    from its tip to its root, the wrench that each link needs: I a + v x* I v - air load (recursive
    Newton-Euler, Featherstone (2008), table 5.1). Gravity is in the accelerations. The parts between hinges
    have no mass: all hinges of a surface carry the same wrench, and the torque of each is its projection on
    the screw.

    Parameters (t instants, s surfaces, h hinges)
    ----------
    columns : (s + 1,) first hinge of each surface, and h. screws : (t, h, 6) `multibody.hinges.hinge_screws`.
    states : (t, rows) of one flight; the others as in ``rates_of_blocks``, with a leading axis t.
    block : (rows, width) and the rest of the scratch: provided by the caller. out : (t, h) N m, along the
    positive angles. twist_rates : (t, 6) rad/s^2 and m/s^2, of the components of omega_B and v_B.
    roots : (t, s, 6) wrench on each surface at its first link's origin, in W, N m and N. bodies, sections :
    what `report_bodies` and `report_sections` fill in; (0, ...) if nobody needs it.
    """
    links = ranges.shape[0]
    coordinates = 3 * (links - surfaces.shape[0])
    w_twist, w_wrench, _, w_acceleration, _ = link_rows_of_scratch(links)
    _, _, _, w_joint, _ = joint_rows_of_scratch(links, coordinates)
    inertia = scratch[S_INERTIA : S_INERTIA + 21]
    force = scratch[S_CARRIED : S_CARRIED + 6]
    for n in range(states.shape[0]):
        for i in range(states.shape[1]):
            for l in range(len(lanes)):
                block[i, l] = states[n, i]
        instant_rates(
            lanes,
            surfaces, ranges, shared, strips[n], hinges[n], hinge_accelerations[n], operators[n], wind[n],
            constants, block, zero, scratch, inputs, outputs, rates,
        )  # fmt: skip
        for i in range(6):
            twist_rates[n, i] = rates[OMEGA + i, 0]
        if bodies.shape[0] > 0:
            report_bodies(lanes, surfaces, shared, constants, scratch, links, bodies[n])
            report_sections(surfaces, ranges, strips[n], constants, scratch, outputs, links, sections[n])
        last_joint = coordinates // 3
        for s in range(surfaces.shape[0] - 1, -1, -1):
            clear(lanes, force)
            for k in range(surfaces[s, 1] - 1, -1, -1):
                link = surfaces[s, 0] + k
                rows = constants[LINKS_C + LINK_ROWS * link : LINKS_C + LINK_ROWS * link + LINK_ROWS]
                clear(lanes, inertia)  # of this link alone
                add_link(
                    lanes,
                    rows,
                    scratch[w_twist + 6 * link : w_twist + 6 * link + 6],
                    scratch[w_wrench + 6 * link : w_wrench + 6 * link + 6],
                    inertia,
                    force,
                )
                if shared[APPARENT] != 0.0:
                    row = gravity_rows_of_scratch(links) + 3 * link
                    add_apparent(lanes, rows, scratch[row : row + 3], inertia, force)
                if surfaces[s, LUMPED]:
                    twist = scratch[w_twist + 6 * link : w_twist + 6 * link + 6]
                    add_lump(lanes, rows, twist, inertia, force)
                add_bias(
                    lanes, inertia, scratch[w_acceleration + 6 * link : w_acceleration + 6 * link + 6], force
                )
                if k > 0:
                    last_joint -= 1
                    joint = scratch[
                        w_joint + JOINT_ROWS * last_joint : w_joint + JOINT_ROWS * (last_joint + 1)
                    ]
                    carry_through_gimbal(lanes, rows, joint, inertia, force)
            for i in range(6):
                roots[n, s, i] = force[i, 0]
            for h in range(columns[s], columns[s + 1]):
                torque = 0.0
                for i in range(6):
                    torque += screws[n, h, i] * force[i, 0]
                out[n, h] = torque


@kernel
def report_bodies(lanes, surfaces, shared, constants, scratch, links, out):
    """Fill in the motion of each link and the air's whole force on it, out (links, 18), in its own axes.

    The wrench of the air with that of the apparent mass, the twist relative to the air, and the acceleration
    relative to free fall, six numbers each, as they stand in the scratch block.
    """
    w_twist, w_wrench, _, w_acceleration, _ = link_rows_of_scratch(links)
    inertia = scratch[S_INERTIA : S_INERTIA + 21]
    moved = scratch[S_SUMS : S_SUMS + 6]  # what the apparent mass takes
    for s in range(surfaces.shape[0]):
        for k in range(surfaces[s, LINKS]):
            link = surfaces[s, LINK0] + k
            acceleration = scratch[w_acceleration + 6 * link : w_acceleration + 6 * link + 6]
            clear(lanes, moved)
            if shared[APPARENT] != 0.0:
                clear(lanes, inertia)
                row = gravity_rows_of_scratch(links) + 3 * link
                rows = constants[LINKS_C + LINK_ROWS * link : LINKS_C + LINK_ROWS * link + LINK_ROWS]
                add_apparent(lanes, rows, scratch[row : row + 3], inertia, moved)
                add_bias(lanes, inertia, acceleration, moved)
            for i in range(6):
                out[link, i] = scratch[w_wrench + 6 * link + i, 0] - moved[i, 0]
                out[link, 6 + i] = scratch[w_twist + 6 * link + i, 0]
                out[link, 12 + i] = acceleration[i, 0]


@kernel
def report_sections(surfaces, ranges, strips, constants, scratch, outputs, links, out):
    """Fill in each strip's circulation times width, and two components of its velocity, out (strips, 3).

    The velocity, relative to the air, is that of the strip's middle on the axis: along the chord, and normal.
    """
    w_twist, _, _, _, _ = link_rows_of_scratch(links)
    _, _, c_overlap = constant_rows(links, 3 * (links - surfaces.shape[0]))
    for s in range(surfaces.shape[0]):
        for j in range(surfaces[s, STRIPS]):
            strip = surfaces[s, STRIP0] + j
            cx, cy = strips[strip, CHORD_X], strips[strip, CHORD_Y]
            forward, normal = 0.0, 0.0
            for k in range(surfaces[s, LINKS]):
                link = surfaces[s, LINK0] + k
                if ranges[link, 0] <= j < ranges[link, 1]:
                    pair = c_overlap + 2 * (surfaces[s, PAIR0] + j * surfaces[s, LINKS] + k)
                    share, y = constants[pair, 0], constants[pair + 1, 0]
                    twist = scratch[w_twist + 6 * link : w_twist + 6 * link + 6, 0]
                    forward += share * (cx * (twist[3] - twist[2] * y) + cy * twist[4])
                    normal += share * (twist[5] + twist[0] * y)
            out[strip, 0] = outputs[OUTPUTS * strip, 0]
            out[strip, 1], out[strip, 2] = forward, normal
