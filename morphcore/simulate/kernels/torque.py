"""Torque of the hinge motors along a flight."""

from __future__ import annotations

from morphcore.aero.kernels.loads import LUMPED
from morphcore.jit import entry_kernel
from morphcore.models.kernels.chain import clear
from morphcore.models.kernels.layout import (
    APPARENT,
    LINKS_C,
    S_CARRIED,
    S_INERTIA,
    VELOCITY,
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
    constants, states, zero, block, scratch, inputs, outputs, rates, out, velocity_rates,
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
    positive
    angles. velocity_rates : (t, 3) m/s^2, of the components of v_B.
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
        for i in range(3):
            velocity_rates[n, i] = rates[VELOCITY + i, 0]
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
            for h in range(columns[s], columns[s + 1]):
                torque = 0.0
                for i in range(6):
                    torque += screws[n, h, i] * force[i, 0]
                out[n, h] = torque
