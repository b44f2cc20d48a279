"""Accelerations of the equivalent model's tree: a fuselage with chains of links on hinges, over lanes.

Combines the passes: twists from root to tips, air loads, articulated inertias from tips to root,
accelerations from root to tips. Rows as in layout.py.
"""

from __future__ import annotations

from morphcore.aero.kernels.gust_loads import UNIFORM, gust_inputs, gust_wrench
from morphcore.aero.kernels.loads import (
    CONTROL_END,
    LINK0,
    LINKS,
    LUMPED,
    PAIRED,
    TELESCOPES,
    control_inputs,
    lagged_motion,
    lane_product,
    link_wrench,
    strip_inputs,
)
from morphcore.aero.kernels.stall import limit_lift
from morphcore.jit import kernel
from morphcore.lanes import not_in_lanes
from morphcore.models.kernels.layout import (
    APPARENT,
    DENSITY,
    FUSELAGE,
    GRAVITY,
    LIMITS,
    LINKS_C,
    S_BASE_ACCELERATION,
    S_BASE_FORCE,
    S_BASE_INERTIA,
    S_CARRIED,
    S_GRAVITY,
    S_INERTIA,
    S_SUMS,
    S_TWIST,
    S_WIND,
    axis_rows_of_scratch,
    constant_rows,
    gravity_rows_of_scratch,
    joint_rows_of_scratch,
    link_rows_of_scratch,
    state_rows,
    visible_rows_of_scratch,
)
from morphcore.models.kernels.telescope import visible_links
from morphcore.multibody.kernels.articulated import (
    LINK_ROWS,
    accumulate,
    accumulate_pair,
    add_apparent,
    add_bias,
    add_link,
    add_lump,
    solve_base,
)
from morphcore.multibody.kernels.gimbal import (
    JOINT_ROWS,
    carry_through_gimbal,
    eliminate_gimbal,
    gimbal_acceleration,
    gimbal_twist,
    vector_through_gimbal,
)
from morphcore.multibody.kernels.hinge import (
    carry_through_hinge,
    hinge_acceleration,
    hinge_twist,
    vector_through_hinge,
)


@kernel
def body_axes(lanes, state, wind, gravity, scratch):
    """Fill the scratch block with the twist relative to the air, and wind and gravity in B."""
    if not_in_lanes(state, lanes) or not_in_lanes(scratch, lanes):
        return
    wn, we, wd = wind[0], wind[1], wind[2]
    for l in range(len(lanes)):
        a, b, c, d = state[0, l], state[1, l], state[2, l], state[3, l]
        nx, ny, nz = a * a + b * b - c * c - d * d, 2.0 * (b * c - a * d), 2.0 * (b * d + a * c)
        ex, ey, ez = 2.0 * (b * c + a * d), a * a - b * b + c * c - d * d, 2.0 * (c * d - a * b)
        dx, dy, dz = 2.0 * (b * d - a * c), 2.0 * (c * d + a * b), a * a - b * b - c * c + d * d
        ax, ay, az = nx * wn + ex * we + dx * wd, ny * wn + ey * we + dy * wd, nz * wn + ez * we + dz * wd
        scratch[0, l], scratch[1, l], scratch[2, l] = state[4, l], state[5, l], state[6, l]
        scratch[3, l], scratch[4, l], scratch[5, l] = state[7, l] - ax, state[8, l] - ay, state[9, l] - az
        scratch[S_WIND, l], scratch[S_WIND + 1, l], scratch[S_WIND + 2, l] = ax, ay, az
        scratch[S_GRAVITY, l] = gravity * dx
        scratch[S_GRAVITY + 1, l] = gravity * dy
        scratch[S_GRAVITY + 2, l] = gravity * dz


@kernel
def start_base(lanes, constants, twist, shared, inertia, force):
    """Set the fuselage's inertia and its bias force v x* I v minus the constant force and moment."""
    if (
        not_in_lanes(constants, lanes)
        or not_in_lanes(twist, lanes)
        or not_in_lanes(inertia, lanes)
        or not_in_lanes(force, lanes)
    ):
        return
    for i in range(21):
        value = shared[FUSELAGE + i]
        row = inertia[i]
        for l in range(len(lanes)):
            row[l] = value
    clear(lanes, force)
    add_bias(lanes, inertia, twist, force)  # momentum of the fuselage
    for l in range(len(lanes)):
        hx, hy, hz = force[0, l], force[1, l], force[2, l]
        gx, gy, gz = force[3, l], force[4, l], force[5, l]
        wx, wy, wz = twist[0, l], twist[1, l], twist[2, l]
        ux, uy, uz = twist[3, l], twist[4, l], twist[5, l]
        force[0, l] = wy * hz - wz * hy + uy * gz - uz * gy - constants[3, l]
        force[1, l] = wz * hx - wx * hz + uz * gx - ux * gz - constants[4, l]
        force[2, l] = wx * hy - wy * hx + ux * gy - uy * gx - constants[5, l]
        force[3, l] = wy * gz - wz * gy - constants[0, l]
        force[4, l] = wz * gx - wx * gz - constants[1, l]
        force[5, l] = wx * gy - wy * gx - constants[2, l]


@kernel
def clear(lanes, block):  # noqa: ARG001 - every kernel takes the number of lanes
    """Set some rows to zero, as one long vector."""
    rows = block.reshape(-1)
    for i in range(rows.size):
        rows[i] = 0.0


@kernel
def accelerations(
    lanes,
    surfaces,
    ranges,
    shared,
    strips,
    hinges,
    hinge_accelerations,
    operator,
    wind,
    constants,
    state,
    scratch,
    inputs,
    outputs,
):
    """Base and joint accelerations of a block, for joint forces and added diagonal in the scratch block.

    ``hinges`` (s, HINGE_ROWS), ``hinge_accelerations`` (s, 6): motion of the surfaces relative to the
    fuselage.

    Leaves the spatial acceleration of the fuselage (without gravity) in rows S_BASE_ACCELERATION, and joint
    accelerations and the links' twists in their own rows.
    """
    links = ranges.shape[0]
    joints = links - surfaces.shape[0]
    coordinates = 3 * joints
    w_twist, w_wrench, w_bias, _, w_effective = link_rows_of_scratch(links)
    _, _, _, w_joint, _ = joint_rows_of_scratch(links, coordinates)
    s_q, s_v, s_slow, s_fast, s_previous, _ = state_rows(links, coordinates)
    _, _, c_overlap = constant_rows(links, coordinates)
    overlap = constants[c_overlap:]
    density = shared[DENSITY]

    body_axes(lanes, state, wind, shared[GRAVITY], scratch)
    base_twist = scratch[S_TWIST : S_TWIST + 6]

    # root -> tips: twists
    joint_number = 0
    for s in range(surfaces.shape[0]):
        for k in range(surfaces[s, LINKS]):
            link = surfaces[s, LINK0] + k
            twist = scratch[w_twist + 6 * link : w_twist + 6 * link + 6]
            if k == 0:
                hinge_twist(
                    lanes,
                    base_twist,
                    hinges[s],
                    hinge_accelerations[s],
                    twist,
                    scratch[w_bias + 6 * link : w_bias + 6 * link + 6],
                )
            else:
                c = 3 * joint_number
                gimbal_twist(
                    lanes,
                    scratch[w_twist + 6 * link - 6 : w_twist + 6 * link],
                    constants[LINKS_C + LINK_ROWS * link : LINKS_C + LINK_ROWS * link + LINK_ROWS],
                    state[s_q + c : s_q + c + 3],
                    state[s_v + c : s_v + c + 3],
                    scratch[w_joint + JOINT_ROWS * joint_number : w_joint + JOINT_ROWS * (joint_number + 1)],
                    twist,
                )
                joint_number += 1
            lagged_motion(
                lanes,
                constants[LINKS_C + LINK_ROWS * link : LINKS_C + LINK_ROWS * link + LINK_ROWS],
                twist,
                state[s_slow + 3 * link : s_slow + 3 * link + 3],
                state[s_fast + 3 * link : s_fast + 3 * link + 3],
                state[s_previous + 3 * link : s_previous + 3 * link + 3],
                scratch[w_effective + 3 * link : w_effective + 3 * link + 3],
            )

    # air loads
    effective = scratch[w_effective : w_effective + 3 * links]
    w_seen, w_seen_joints, _, w_seen_overlap = visible_rows_of_scratch(links, coordinates)
    for s in range(surfaces.shape[0]):
        if surfaces[s, TELESCOPES] != 0:
            visible_links(
                lanes, surfaces[s], strips, constants[LINKS_C:], scratch[S_SUMS : S_SUMS + 2],
                scratch[w_seen:w_seen_joints], scratch[w_seen_overlap:],
            )  # fmt: skip
            shares = scratch[w_seen_overlap:]
        else:
            shares = overlap
        strip_inputs(lanes, surfaces[s], ranges, strips, shares, effective, inputs)
        if surfaces[s, CONTROL_END] > 0:
            for k in range(surfaces[s, LINKS]):
                link = surfaces[s, LINK0] + k
                control_inputs(
                    lanes, surfaces[s], k, ranges, overlap,
                    constants[LINKS_C + LINK_ROWS * link : LINKS_C + LINK_ROWS * link + LINK_ROWS],
                    scratch[w_twist + 6 * link : w_twist + 6 * link + 6],
                    inputs,
                )  # fmt: skip
    in_gust, axes0 = wind.shape[0] > UNIFORM, axis_rows_of_scratch(links, coordinates)[0] + 9
    if in_gust:
        axes_of_links(lanes, surfaces, hinges, state, scratch, links, coordinates)
        for s in range(surfaces.shape[0]):
            for k in range(surfaces[s, LINKS]):
                link = surfaces[s, LINK0] + k
                gust_inputs(
                    lanes, surfaces[s], k, ranges, strips, overlap, wind,
                    scratch[axes0 + 9 * link : axes0 + 9 * link + 9],
                    constants[LINKS_C + LINK_ROWS * link : LINKS_C + LINK_ROWS * link + LINK_ROWS],
                    inputs,
                )  # fmt: skip
    lane_product(lanes, operator, inputs, outputs)
    if shared.shape[0] > LIMITS:
        for s in range(surfaces.shape[0]):
            limit_lift(
                lanes, surfaces[s], ranges, strips, overlap, wind,
                scratch[axes0 : axes0 + 9 * links], scratch[w_twist : w_twist + 6 * links],
                shared[LIMITS:], outputs, scratch[S_SUMS : S_SUMS + 6],
            )  # fmt: skip
    for s in range(surfaces.shape[0]):
        if surfaces[s, TELESCOPES] != 0:
            rows, shares = scratch[w_seen:w_seen_joints], scratch[w_seen_overlap:]
        else:
            rows, shares = constants[LINKS_C:], overlap
        for k in range(surfaces[s, LINKS]):
            link = surfaces[s, LINK0] + k
            link_wrench(
                lanes, surfaces[s], k, ranges, strips, shares, outputs,
                rows[LINK_ROWS * link : LINK_ROWS * link + LINK_ROWS],
                scratch[w_twist + 6 * link : w_twist + 6 * link + 6],
                density,
                scratch[S_SUMS : S_SUMS + 6],
                scratch[w_wrench + 6 * link : w_wrench + 6 * link + 6],
            )  # fmt: skip
            if in_gust:
                gust_wrench(
                    lanes, surfaces[s], k, ranges, strips, overlap, outputs, wind,
                    scratch[axes0 + 9 * link : axes0 + 9 * link + 9],
                    constants[LINKS_C + LINK_ROWS * link : LINKS_C + LINK_ROWS * link + LINK_ROWS],
                    scratch[w_twist + 6 * link : w_twist + 6 * link + 6],
                    density,
                    scratch[S_SUMS : S_SUMS + 6],
                    scratch[w_wrench + 6 * link : w_wrench + 6 * link + 6],
                )  # fmt: skip

    if shared[APPARENT] != 0.0:
        gravity_of_links(lanes, surfaces, hinges, scratch, links, coordinates)
    articulate(
        lanes, surfaces, shared, hinges, constants, scratch, links, coordinates,
    )  # fmt: skip


@kernel
def axes_of_links(lanes, surfaces, hinges, state, scratch, links, coordinates):
    """Fill in the axes of N in those of the fuselage and of all links, which a gust needs."""
    base, _ = axis_rows_of_scratch(links, coordinates)
    _, _, _, w_joint, _ = joint_rows_of_scratch(links, coordinates)
    north, east, down = scratch[base : base + 3], scratch[base + 3 : base + 6], scratch[base + 6 : base + 9]
    if not_in_lanes(state, lanes) or not_in_lanes(scratch, lanes):
        return
    for l in range(len(lanes)):
        a, b, c, d = state[0, l], state[1, l], state[2, l], state[3, l]
        north[0, l], north[1, l] = a * a + b * b - c * c - d * d, 2.0 * (b * c - a * d)
        north[2, l] = 2.0 * (b * d + a * c)
        east[0, l], east[1, l] = 2.0 * (b * c + a * d), a * a - b * b + c * c - d * d
        east[2, l] = 2.0 * (c * d - a * b)
        down[0, l], down[1, l] = 2.0 * (b * d - a * c), 2.0 * (c * d + a * b)
        down[2, l] = a * a - b * b - c * c + d * d
    joint = w_joint
    for s in range(surfaces.shape[0]):
        for k in range(surfaces[s, LINKS]):
            row = base + 9 * (surfaces[s, LINK0] + k + 1)
            for axis in range(0, 9, 3):
                own = scratch[row + axis : row + axis + 3]
                if k == 0:
                    vector_through_hinge(lanes, hinges[s], scratch[base + axis : base + axis + 3], own)
                else:
                    before = scratch[row - 9 + axis : row - 6 + axis]
                    vector_through_gimbal(lanes, scratch[joint : joint + JOINT_ROWS], before, own)
            if k > 0:
                joint += JOINT_ROWS


@kernel
def gravity_of_links(lanes, surfaces, hinges, scratch, links, coordinates):
    """Fill in gravity in the axes of all links, which their apparent mass needs."""
    w_gravity = gravity_rows_of_scratch(links)
    _, _, _, w_joint, _ = joint_rows_of_scratch(links, coordinates)
    joint = w_joint
    for s in range(surfaces.shape[0]):
        for k in range(surfaces[s, LINKS]):
            row = w_gravity + 3 * (surfaces[s, LINK0] + k)
            own = scratch[row : row + 3]
            if k == 0:
                vector_through_hinge(lanes, hinges[s], scratch[S_GRAVITY : S_GRAVITY + 3], own)
            else:
                vector_through_gimbal(lanes, scratch[joint : joint + JOINT_ROWS], scratch[row - 3 : row], own)
                joint += JOINT_ROWS


@kernel
def articulate(lanes, surfaces, shared, hinges, constants, scratch, links, coordinates):
    """Articulated-body pass over the twists, wrenches and joint forces in the scratch block."""
    w_twist, w_wrench, w_bias, w_acceleration, _ = link_rows_of_scratch(links)
    w_tau, w_added, w_joint_acceleration, w_joint, _ = joint_rows_of_scratch(links, coordinates)
    base_inertia = scratch[S_BASE_INERTIA : S_BASE_INERTIA + 21]
    base_force = scratch[S_BASE_FORCE : S_BASE_FORCE + 6]
    base_acceleration = scratch[S_BASE_ACCELERATION : S_BASE_ACCELERATION + 6]
    inertia = scratch[S_INERTIA : S_INERTIA + 21]
    carried = scratch[S_CARRIED : S_CARRIED + 6]
    start_base(lanes, constants, scratch[S_TWIST : S_TWIST + 6], shared, base_inertia, base_force)

    # tips -> root: articulated inertia and bias force
    last_joint = coordinates // 3
    for s in range(surfaces.shape[0] - 1, -1, -1):
        clear(lanes, scratch[S_INERTIA : S_CARRIED + 6])
        for k in range(surfaces[s, LINKS] - 1, -1, -1):
            link = surfaces[s, LINK0] + k
            rows = constants[LINKS_C + LINK_ROWS * link : LINKS_C + LINK_ROWS * link + LINK_ROWS]
            add_link(
                lanes,
                rows,
                scratch[w_twist + 6 * link : w_twist + 6 * link + 6],
                scratch[w_wrench + 6 * link : w_wrench + 6 * link + 6],
                inertia,
                carried,
            )
            if shared[APPARENT] != 0.0:
                row = gravity_rows_of_scratch(links) + 3 * link
                add_apparent(lanes, rows, scratch[row : row + 3], inertia, carried)
            if surfaces[s, LUMPED]:
                twist = scratch[w_twist + 6 * link : w_twist + 6 * link + 6]
                add_lump(lanes, rows, twist, inertia, carried)
            if k == 0:
                add_bias(lanes, inertia, scratch[w_bias + 6 * link : w_bias + 6 * link + 6], carried)
                carry_through_hinge(lanes, hinges[s], inertia, carried)
                if surfaces[s, PAIRED]:
                    accumulate_pair(lanes, inertia, carried, base_inertia, base_force)
                else:
                    accumulate(lanes, inertia, carried, base_inertia, base_force)
            else:
                last_joint -= 1
                c = 3 * last_joint
                joint = scratch[w_joint + JOINT_ROWS * last_joint : w_joint + JOINT_ROWS * (last_joint + 1)]
                add_bias(lanes, inertia, joint[11:17], carried)
                eliminate_gimbal(
                    lanes,
                    scratch[w_tau + c : w_tau + c + 3],
                    scratch[w_added + c : w_added + c + 3],
                    joint,
                    inertia,
                    carried,
                )
                carry_through_gimbal(lanes, rows, joint, inertia, carried)
    solve_base(lanes, base_inertia, base_force, base_acceleration)

    # root -> tips: accelerations
    joint_number = 0
    for s in range(surfaces.shape[0]):
        for k in range(surfaces[s, LINKS]):
            link = surfaces[s, LINK0] + k
            own = scratch[w_acceleration + 6 * link : w_acceleration + 6 * link + 6]
            if k == 0:
                bias = scratch[w_bias + 6 * link : w_bias + 6 * link + 6]
                hinge_acceleration(lanes, base_acceleration, hinges[s], bias, own)
            else:
                c = 3 * joint_number
                gimbal_acceleration(
                    lanes,
                    scratch[w_acceleration + 6 * link - 6 : w_acceleration + 6 * link],
                    constants[LINKS_C + LINK_ROWS * link : LINKS_C + LINK_ROWS * link + LINK_ROWS],
                    scratch[w_joint + JOINT_ROWS * joint_number : w_joint + JOINT_ROWS * (joint_number + 1)],
                    own,
                    scratch[w_joint_acceleration + c : w_joint_acceleration + c + 3],
                )
                joint_number += 1


@kernel
def base_rates(lanes, state, scratch, rates):
    """Rates of attitude, body velocities and position from the spatial acceleration in the scratch block."""
    if not_in_lanes(state, lanes) or not_in_lanes(scratch, lanes) or not_in_lanes(rates, lanes):
        return
    for l in range(len(lanes)):
        a, b, c, d = state[0, l], state[1, l], state[2, l], state[3, l]
        p, q, r = state[4, l], state[5, l], state[6, l]
        u, v, w = state[7, l], state[8, l], state[9, l]
        rates[0, l] = -0.5 * (b * p + c * q + d * r)
        rates[1, l] = 0.5 * (a * p + c * r - d * q)
        rates[2, l] = 0.5 * (a * q + d * p - b * r)
        rates[3, l] = 0.5 * (a * r + b * q - c * p)
        rates[4, l], rates[5, l], rates[6, l] = scratch[6, l], scratch[7, l], scratch[8, l]
        # the pass ran in axes that move with the wind: v' = a + g - omega x wind, Galileo's shift
        wx, wy, wz = scratch[S_WIND, l], scratch[S_WIND + 1, l], scratch[S_WIND + 2, l]
        rates[7, l] = scratch[9, l] + scratch[S_GRAVITY, l] - (q * wz - r * wy)
        rates[8, l] = scratch[10, l] + scratch[S_GRAVITY + 1, l] - (r * wx - p * wz)
        rates[9, l] = scratch[11, l] + scratch[S_GRAVITY + 2, l] - (p * wy - q * wx)
        rates[10, l] = (
            (a * a + b * b - c * c - d * d) * u + 2.0 * (b * c - a * d) * v + 2.0 * (b * d + a * c) * w
        )
        rates[11, l] = (
            2.0 * (b * c + a * d) * u + (a * a - b * b + c * c - d * d) * v + 2.0 * (c * d - a * b) * w
        )
        rates[12, l] = (
            2.0 * (b * d - a * c) * u + 2.0 * (c * d + a * b) * v + (a * a - b * b - c * c + d * d) * w
        )
