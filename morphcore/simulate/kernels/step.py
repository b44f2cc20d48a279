"""One time step of a block: a two-stage W-method, implicit in joint stiffness, exact in the lag.

The method is ROS2 of Verwer, Spee, Blom & Hundsdorfer (1999, SIAM J. Sci. Comput. 20, equation 2.1):

    (I - gamma h A) k1 = F(t, u)
    (I - gamma h A) k2 = F(t + h, u + h k1) - 2 k1
    u' = u + h (3/2 k1 + 1/2 k2)

which is of second order for *any* matrix A, and L-stable with gamma = 1 - 1/sqrt(2) where A is exact. Here A
holds the diagonal joint stiffness K and damping C with the mass matrix of the stage: then the implicit
equations are the articulated-body pass with gamma h C + (gamma h)^2 K added to the joint-space diagonal.
(Taking the stage's own mass matrix instead of the first one's changes the step by O(h^3), so the order stays
two.) For the second stage the unknown is y = k2 + 2 k1, which turns M k1 into the diagonal product 2 (gamma h
C + (gamma h)^2 K) k1.

The lag states are linear filters of the links' motion, some faster than a step. They are stepped exactly for
a motion that changes linearly over the step (Cox & Matthews 2002, J. Comput. Phys. 176, the quadrature of
ETD2), whatever the lag time, zero included. Each stage closes the current step's filter with its own motion,
so that force and motion belong to the same instant: a state left over from the predicted end of the step
before would cost ten times the error.
"""

from __future__ import annotations

import math

from morphcore.jit import inlined, kernel
from morphcore.lanes import not_in_lanes
from morphcore.models.kernels.chain import accelerations, base_rates, clear
from morphcore.models.kernels.layout import (
    JOINTS,
    LINKS_C,
    S_FREE,
    constant_rows,
    joint_rows_of_scratch,
    state_rows,
)
from morphcore.multibody.kernels.articulated import LINK_ROWS

GAMMA = 1.0 - 1.0 / math.sqrt(2.0)


# Joint rows are taken three at a time, a gimbal's: a lane loop as short as one row's arithmetic is unrolled by
# the compiler before it could become vector instructions. Rows that need no lanes are taken as one long vector.


@inlined
def spring(k, c, q, v, g):
    """Force -k (q + g v) - c v of a joint and the diagonal g c + g^2 k that the implicit step adds."""
    return -k * (q + g * v) - c * v, g * (c + g * k)


@kernel
def joint_forces(lanes, stiffness, damping, q, v, step, tau, added):
    """First stage: tau = -K (q + gamma h v) - C v and the added diagonal gamma h C + (gamma h)^2 K."""
    if (
        not_in_lanes(stiffness, lanes)
        or not_in_lanes(damping, lanes)
        or not_in_lanes(q, lanes)
        or not_in_lanes(v, lanes)
    ):
        return
    if not_in_lanes(tau, lanes) or not_in_lanes(added, lanes):
        return
    g = GAMMA * step
    for i in range(0, q.shape[0], 3):
        k, c, p, w = stiffness[i : i + 3], damping[i : i + 3], q[i : i + 3], v[i : i + 3]
        t, a = tau[i : i + 3], added[i : i + 3]
        for l in range(len(lanes)):
            t[0, l], a[0, l] = spring(k[0, l], c[0, l], p[0, l], w[0, l], g)
            t[1, l], a[1, l] = spring(k[1, l], c[1, l], p[1, l], w[1, l], g)
            t[2, l], a[2, l] = spring(k[2, l], c[2, l], p[2, l], w[2, l], g)


@inlined
def second_spring(k, c, q, v, rate, acceleration, g):
    """What ``spring`` gives for the second stage's y = k2 + 2 k1 (see the module's head)."""
    added = g * (c + g * k)
    return -k * (q + g * (v - 2.0 * rate)) - c * v + 2.0 * added * acceleration, added


@kernel
def second_joint_forces(lanes, stiffness, damping, q, v, angle_rate, acceleration, step, tau, added):
    """Second stage: tau for y = k2 + 2 k1 (see the module's head), from k1's angle rate and acceleration."""
    if (
        not_in_lanes(stiffness, lanes)
        or not_in_lanes(damping, lanes)
        or not_in_lanes(q, lanes)
        or not_in_lanes(v, lanes)
    ):
        return
    if (
        not_in_lanes(angle_rate, lanes)
        or not_in_lanes(acceleration, lanes)
        or not_in_lanes(tau, lanes)
        or not_in_lanes(added, lanes)
    ):
        return
    g = GAMMA * step
    for i in range(0, q.shape[0], 3):
        k, c, p, w = stiffness[i : i + 3], damping[i : i + 3], q[i : i + 3], v[i : i + 3]
        r, b = angle_rate[i : i + 3], acceleration[i : i + 3]
        t, a = tau[i : i + 3], added[i : i + 3]
        for l in range(len(lanes)):
            t[0, l], a[0, l] = second_spring(k[0, l], c[0, l], p[0, l], w[0, l], r[0, l], b[0, l], g)
            t[1, l], a[1, l] = second_spring(k[1, l], c[1, l], p[1, l], w[1, l], r[1, l], b[1, l], g)
            t[2, l], a[2, l] = second_spring(k[2, l], c[2, l], p[2, l], w[2, l], r[2, l], b[2, l], g)


@kernel
def joint_rates(lanes, v, acceleration, step, first, second, angle_rate, velocity_rate):  # noqa: ARG001
    """Rates of a stage's joint angles and velocities, less twice k1's (``first``, ``second``)."""
    g = GAMMA * step
    speeds, own = v.reshape(-1), acceleration.reshape(-1)
    angle1, speed1 = first.reshape(-1), second.reshape(-1)
    angle2, speed2 = angle_rate.reshape(-1), velocity_rate.reshape(-1)
    for i in range(speeds.size):
        rate = own[i] - 2.0 * speed1[i]
        speed2[i] = rate
        angle2[i] = speeds[i] - 2.0 * angle1[i] + g * rate


@kernel
def lag_advance(lanes, link, twist, slow, fast, previous):
    """Carry a link's lag states over a step that begins at the given twist (rows as in ``lagged_motion``)."""
    if (
        not_in_lanes(link, lanes)
        or not_in_lanes(twist, lanes)
        or not_in_lanes(slow, lanes)
        or not_in_lanes(fast, lanes)
    ):
        return
    if not_in_lanes(previous, lanes):
        return
    for i in range(3):
        source = twist[(5, 0, 1)[i]]
        for l in range(len(lanes)):
            motion = source[l]
            change = motion - previous[i, l]
            slow[i, l] = motion + link[10, l] * (slow[i, l] + link[11, l] * change - motion)
            fast[i, l] = motion + link[12, l] * (fast[i, l] + link[13, l] * change - motion)
            previous[i, l] = motion


@kernel
def advance(state, first, step, out):
    """out = state + h k1."""
    before, rate, after = state.reshape(-1), first.reshape(-1), out.reshape(-1)
    for i in range(before.size):
        after[i] = before[i] + step * rate[i]


@kernel
def copy(rows, out):
    """out = rows."""
    source, target = rows.reshape(-1), out.reshape(-1)
    for i in range(source.size):
        target[i] = source[i]


@kernel
def finish(lanes, state, first, second, step):
    """state += h (3/2 k1 + 1/2 k2), with the attitude quaternion made unit again."""
    if not_in_lanes(state, lanes):
        return
    after, rate1, rate2 = state.reshape(-1), first.reshape(-1), second.reshape(-1)
    for i in range(after.size):
        after[i] += step * (1.5 * rate1[i] + 0.5 * rate2[i])
    for l in range(len(lanes)):
        a, b, c, d = state[0, l], state[1, l], state[2, l], state[3, l]
        scale = 1.0 / math.sqrt(a * a + b * b + c * c + d * d)
        state[0, l], state[1, l], state[2, l], state[3, l] = a * scale, b * scale, c * scale, d * scale


@kernel
def stage(
    lanes,
    surfaces, ranges, shared, strips, hinges, hinge_accelerations, operator, wind, constants, state, first,
    step, rates, scratch, inputs, outputs,
):  # fmt: skip
    """Rates k of one stage of the W-method; ``first`` is zero in stage 1 and k1 in stage 2."""
    links = ranges.shape[0]
    coordinates = 3 * (links - surfaces.shape[0])
    _, _, w_joint_acceleration, _, _ = joint_rows_of_scratch(links, coordinates)
    s_q, s_v, s_slow, _, _, _ = state_rows(links, coordinates)
    accelerations(
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
    )
    base_rates(lanes, state, scratch, rates)
    for i in range(JOINTS):
        k1, k2 = first[i], rates[i]
        for l in range(len(lanes)):
            k2[l] -= 2.0 * k1[l]
    joint_rates(
        lanes, state[s_v:s_slow], scratch[w_joint_acceleration : w_joint_acceleration + coordinates], step,
        first[s_q:s_v], first[s_v:s_slow], rates[s_q:s_v], rates[s_v:s_slow],
    )  # fmt: skip


@kernel
def step_block(
    lanes,
    surfaces, ranges, shared, strips, hinges, hinge_accelerations, operators, wind, constants, state, step,
    first, second, middle, scratch, inputs, outputs,
):  # fmt: skip
    """Advance a block by one step; ``strips``, ``hinges``, ``operators``, ``wind`` at its begin and end.

    ``hinge_accelerations`` (s,) is the change of the hinges' rates over the step, divided by its length:
    where a schedule's acceleration jumps, the momentum that the wings exchange with the fuselage is then
    still exact.
    """
    links = ranges.shape[0]
    coordinates = 3 * (links - surfaces.shape[0])
    w_tau, w_added, _, _, _ = joint_rows_of_scratch(links, coordinates)
    s_q, s_v, s_slow, s_fast, s_previous, _ = state_rows(links, coordinates)
    c_stiffness, c_damping, _ = constant_rows(links, coordinates)
    stiffness = constants[c_stiffness : c_stiffness + coordinates]
    damping = constants[c_damping : c_damping + coordinates]
    tau, added = scratch[w_tau : w_tau + coordinates], scratch[w_added : w_added + coordinates]

    joint_forces(lanes, stiffness, damping, state[s_q:s_v], state[s_v:s_slow], step, tau, added)
    clear(lanes, second)
    stage(
        lanes,
        surfaces, ranges, shared, strips[0], hinges[0], hinge_accelerations, operators[0], wind[0], constants,
        state, second, step, first, scratch, inputs, outputs,
    )  # fmt: skip
    advance(state[:s_slow], first[:s_slow], step, middle[:s_slow])
    for link in range(links):
        slow, fast, previous = s_slow + 3 * link, s_fast + 3 * link, s_previous + 3 * link
        lag_advance(
            lanes, constants[LINKS_C + LINK_ROWS * link : LINKS_C + LINK_ROWS * (link + 1)],
            scratch[S_FREE + 6 * link : S_FREE + 6 * link + 6],
            state[slow : slow + 3], state[fast : fast + 3], state[previous : previous + 3],
        )  # fmt: skip
    copy(state[s_slow:], middle[s_slow:])
    second_joint_forces(
        lanes,
        stiffness,
        damping,
        middle[s_q:s_v],
        middle[s_v:s_slow],
        first[s_q:s_v],
        first[s_v:s_slow],
        step,
        tau,
        added,
    )
    stage(
        lanes,
        surfaces, ranges, shared, strips[1], hinges[1], hinge_accelerations, operators[1], wind[1], constants,
        middle, first, step, second, scratch, inputs, outputs,
    )  # fmt: skip
    finish(lanes, state[:s_slow], first[:s_slow], second[:s_slow], step)


@kernel
def instant_rates(
    lanes,
    surfaces, ranges, shared, strips, hinges, hinge_accelerations, operator, wind, constants, state, zero,
    scratch, inputs, outputs, rates,
):  # fmt: skip
    """Time derivative of a block's state, a stage of a step of no length; ``zero``: rows of zeros.

    The lag states' rows are not touched.
    """
    links = ranges.shape[0]
    coordinates = 3 * (links - surfaces.shape[0])
    w_tau, w_added, _, _, _ = joint_rows_of_scratch(links, coordinates)
    s_q, s_v, s_slow, _, _, _ = state_rows(links, coordinates)
    c_stiffness, c_damping, _ = constant_rows(links, coordinates)
    joint_forces(
        lanes,
        constants[c_stiffness : c_stiffness + coordinates],
        constants[c_damping : c_damping + coordinates],
        state[s_q:s_v], state[s_v:s_slow], 0.0,
        scratch[w_tau : w_tau + coordinates], scratch[w_added : w_added + coordinates],
    )  # fmt: skip
    stage(
        lanes,
        surfaces, ranges, shared, strips, hinges, hinge_accelerations, operator, wind, constants, state, zero,
        0.0, rates, scratch, inputs, outputs,
    )  # fmt: skip
