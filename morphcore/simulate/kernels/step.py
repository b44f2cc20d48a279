"""One time step of a block: a W-method of one stage, implicit in joint stiffness, exact in the lag.

The stage lies in the middle of the step; what it starts from is carried there by the slopes of the two steps
before (h: the step, k: slopes in the middles of steps, A: a matrix that stands for the stiff part):

    U = u + h (7/8 k1 - 3/8 k2),            k1, k2: of the last step and of the one before
    k = F(t + h/2, U) + h A (9 k - 15 k1 + 6 k2) / 16
    u' = u + h k

7/8 and -3/8 integrate the line through k1 and k2 over half a step, so U is right to O(h^3). The weights on
A sum to nothing and so leave k right to O(h^2) for *any* A; with the midpoint rule the step is of second
order. It belongs to the W-methods that remember the slopes of former steps (Podhaisky, Schmitt & Weiner
2002, Appl. Numer. Math. 42, the two-step W-methods).

Where A is exact, it acts on u + h/2 k1 + GAMMA h (k - k1). At infinite stiffness both roots of that recursion
are -1/3 with GAMMA = 9/16, the least there is: fast joints die out; and an oscillation of whatever frequency
does not grow (tests/simulate/test_step.py).

A holds the diagonal joint stiffness K and damping C with the mass matrix of the stage, A = [[0, I], [-M^-1 K,
-M^-1 C]]: then the implicit equations are the articulated-body pass with g C + g^2 K, g = GAMMA h, added to
the joint-space diagonal.

At the start there are no slopes yet. A stage of linearly implicit Euler stands for both: its error, of first
order, enters the slopes of two steps, and the flight stays of second order.

The lag states are linear filters of the links' motion, some faster than a step. They are stepped exactly,
from stage to stage, for a motion that changes linearly between (Cox & Matthews 2002, J. Comput. Phys. 176,
the quadrature of ETD2), whatever the lag time, zero included. Each stage closes its filter with its own
motion, so that force and motion belong to one instant. In the state, which belongs to the end of a step, they
are carried on by half a step for a motion that stays as in the last stage, ``previous``.
"""

from __future__ import annotations

import math

from morphcore.jit import kernel
from morphcore.lanes import not_in_lanes
from morphcore.models.kernels.chain import accelerations, base_rates, clear
from morphcore.models.kernels.layout import (
    LINKS_C,
    S_FREE,
    constant_rows,
    joint_rows_of_scratch,
    state_rows,
)
from morphcore.multibody.kernels.articulated import LINK_ROWS

GAMMA = 9.0 / 16.0
LAST, BEFORE = 7.0 / 8.0, -3.0 / 8.0  # the predictor's weights of the slopes k1 and k2
SLOPES = 3  # slots of a block's memory: step n writes its slope to slot n modulo 3


@kernel
def predict(lanes, state, last, before, step, out):
    """out = u + h (7/8 k1 - 3/8 k2)."""
    if not_in_lanes(state, lanes) or not_in_lanes(last, lanes) or not_in_lanes(before, lanes):
        return
    if not_in_lanes(out, lanes):
        return
    for i in range(state.shape[0]):
        for l in range(len(lanes)):
            out[i, l] = state[i, l] + step * (LAST * last[i, l] + BEFORE * before[i, l])


@kernel
def joint_forces(lanes, stiffness, damping, q, v, last, before, last_rate, before_rate, step, tau, added):
    """Joint forces and added diagonal of a stage at predicted angles and rates q, v.

    With g = GAMMA h and w = - h (15 k1 - 6 k2) / 16, of angles (``last``, ``before``) and of rates, the
    implicit equations are (M + g C + g^2 K) a = f - K (q + w_q + g (v + w_v)) - C (v + w_v).
    """
    if (
        not_in_lanes(stiffness, lanes)
        or not_in_lanes(damping, lanes)
        or not_in_lanes(q, lanes)
        or not_in_lanes(v, lanes)
    ):
        return
    if (
        not_in_lanes(last, lanes)
        or not_in_lanes(before, lanes)
        or not_in_lanes(last_rate, lanes)
        or not_in_lanes(before_rate, lanes)
    ):
        return
    if not_in_lanes(tau, lanes) or not_in_lanes(added, lanes):
        return
    g = GAMMA * step
    for i in range(q.shape[0]):
        for l in range(len(lanes)):
            k, c = stiffness[i, l], damping[i, l]
            angle = q[i, l] - step * ((GAMMA - BEFORE) * last[i, l] + BEFORE * before[i, l])
            rate = v[i, l] - step * ((GAMMA - BEFORE) * last_rate[i, l] + BEFORE * before_rate[i, l])
            added[i, l] = g * (c + g * k)
            tau[i, l] = -k * (angle + g * rate) - c * rate


@kernel
def joint_slopes(lanes, v, acceleration, last_rate, before_rate, step, angle_slope, rate_slope):
    """Slopes of a stage's joint angles, v + w_v + g a, and of its joint rates, a."""
    if (
        not_in_lanes(v, lanes)
        or not_in_lanes(acceleration, lanes)
        or not_in_lanes(last_rate, lanes)
        or not_in_lanes(before_rate, lanes)
    ):
        return
    if not_in_lanes(angle_slope, lanes) or not_in_lanes(rate_slope, lanes):
        return
    g = GAMMA * step
    for i in range(v.shape[0]):
        for l in range(len(lanes)):
            a = acceleration[i, l]
            rate = v[i, l] - step * ((GAMMA - BEFORE) * last_rate[i, l] + BEFORE * before_rate[i, l])
            rate_slope[i, l] = a
            angle_slope[i, l] = rate + g * a


@kernel
def lag_to_stage(lanes, link, slow, fast, previous, stage_slow, stage_fast):
    """Carry a link's lag states over the half step up to a stage, for a motion that stays.

    The link's constants hold the decay of a whole step.
    """
    if not_in_lanes(link, lanes) or not_in_lanes(slow, lanes) or not_in_lanes(fast, lanes):
        return
    if not_in_lanes(previous, lanes) or not_in_lanes(stage_slow, lanes) or not_in_lanes(stage_fast, lanes):
        return
    for i in range(3):
        for l in range(len(lanes)):
            motion = previous[i, l]
            stage_slow[i, l] = motion + math.sqrt(link[10, l]) * (slow[i, l] - motion)
            stage_fast[i, l] = motion + math.sqrt(link[12, l]) * (fast[i, l] - motion)


@kernel
def lag_from_stage(lanes, link, twist, stage_slow, stage_fast, slow, fast, previous):
    """Close a link's filters with a stage's twist (rows as in ``lagged_motion``), half a step on."""
    if (
        not_in_lanes(link, lanes)
        or not_in_lanes(twist, lanes)
        or not_in_lanes(stage_slow, lanes)
        or not_in_lanes(stage_fast, lanes)
    ):
        return
    if not_in_lanes(slow, lanes) or not_in_lanes(fast, lanes) or not_in_lanes(previous, lanes):
        return
    for i in range(3):
        source = twist[(5, 0, 1)[i]]
        for l in range(len(lanes)):
            motion = source[l]
            change = motion - previous[i, l]
            slow_end = stage_slow[i, l] + link[11, l] * change
            fast_end = stage_fast[i, l] + link[13, l] * change
            slow[i, l] = motion + math.sqrt(link[10, l]) * (slow_end - motion)
            fast[i, l] = motion + math.sqrt(link[12, l]) * (fast_end - motion)
            previous[i, l] = motion


@kernel
def copy(lanes, source, out):
    """out = source."""
    if not_in_lanes(source, lanes) or not_in_lanes(out, lanes):
        return
    for i in range(source.shape[0]):
        for l in range(len(lanes)):
            out[i, l] = source[i, l]


@kernel
def finish(lanes, state, slope, step):
    """state += h k, with the attitude quaternion made unit again."""
    if not_in_lanes(state, lanes) or not_in_lanes(slope, lanes):
        return
    for i in range(state.shape[0]):
        for l in range(len(lanes)):
            state[i, l] += step * slope[i, l]
    for l in range(len(lanes)):
        a, b, c, d = state[0, l], state[1, l], state[2, l], state[3, l]
        scale = 1.0 / math.sqrt(a * a + b * b + c * c + d * d)
        state[0, l], state[1, l], state[2, l], state[3, l] = a * scale, b * scale, c * scale, d * scale


@kernel
def stage(
    lanes,
    surfaces, ranges, shared, strips, hinges, hinge_accelerations, operator, wind, constants, middle, last,
    before, step, slope, scratch, inputs, outputs,
):  # fmt: skip
    """Slope k (the mechanical rows of a state) at a predicted state ``middle``, of slopes k1 and k2."""
    links = ranges.shape[0]
    coordinates = 3 * (links - surfaces.shape[0])
    w_tau, w_added, w_joint_acceleration, _, _ = joint_rows_of_scratch(links, coordinates)
    s_q, s_v, s_slow, _, _, _ = state_rows(links, coordinates)
    c_stiffness, c_damping, _ = constant_rows(links, coordinates)
    joint_forces(
        lanes,
        constants[c_stiffness : c_stiffness + coordinates],
        constants[c_damping : c_damping + coordinates],
        middle[s_q:s_v], middle[s_v:s_slow],
        last[s_q:s_v], before[s_q:s_v], last[s_v:s_slow], before[s_v:s_slow], step,
        scratch[w_tau : w_tau + coordinates], scratch[w_added : w_added + coordinates],
    )  # fmt: skip
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
        middle,
        scratch,
        inputs,
        outputs,
    )
    base_rates(lanes, middle, scratch, slope)
    joint_slopes(
        lanes, middle[s_v:s_slow], scratch[w_joint_acceleration : w_joint_acceleration + coordinates],
        last[s_v:s_slow], before[s_v:s_slow], step, slope[s_q:s_v], slope[s_v:s_slow],
    )  # fmt: skip


@kernel
def middle_slope(
    lanes,
    surfaces, ranges, shared, strips, hinges, hinge_accelerations, operator, wind, constants, state, last,
    before, step, slope, middle, scratch, inputs, outputs,
):  # fmt: skip
    """Slope in the middle of the step that begins at ``state``; leaves the links' twists in the scratch."""
    links = ranges.shape[0]
    coordinates = 3 * (links - surfaces.shape[0])
    _, _, s_slow, s_fast, s_previous, _ = state_rows(links, coordinates)
    predict(lanes, state[:s_slow], last, before, step, middle[:s_slow])
    for link in range(links):
        slow, fast, previous = s_slow + 3 * link, s_fast + 3 * link, s_previous + 3 * link
        lag_to_stage(
            lanes, constants[LINKS_C + LINK_ROWS * link : LINKS_C + LINK_ROWS * (link + 1)],
            state[slow : slow + 3], state[fast : fast + 3], state[previous : previous + 3],
            middle[slow : slow + 3], middle[fast : fast + 3],
        )  # fmt: skip
    copy(lanes, state[s_previous:], middle[s_previous:])
    stage(
        lanes,
        surfaces, ranges, shared, strips, hinges, hinge_accelerations, operator, wind, constants, middle,
        last, before, step, slope, scratch, inputs, outputs,
    )  # fmt: skip


@kernel
def step_block(
    lanes,
    surfaces, ranges, shared, strips, hinges, hinge_accelerations, operator, wind, constants, state, step,
    number, slopes, middle, scratch, inputs, outputs,
):  # fmt: skip
    """Advance a block by one step; ``strips``, ``hinges``, ``operator``, ``wind`` in its middle.

    ``number``: how many steps the flight has made. ``slopes`` (SLOPES, mechanical rows, width): the block's
    memory, filled here at the first step. ``hinge_accelerations`` (s,) is the change of the hinges' rates
    over the step, divided by its length: where a schedule's acceleration jumps, the momentum that the wings
    exchange with the fuselage is then still exact.
    """
    links = ranges.shape[0]
    coordinates = 3 * (links - surfaces.shape[0])
    _, _, s_slow, s_fast, s_previous, _ = state_rows(links, coordinates)
    slope = slopes[number % SLOPES]
    last, before = slopes[(number + 2) % SLOPES], slopes[(number + 1) % SLOPES]
    if number == 0:
        clear(lanes, last)
        clear(lanes, before)
        middle_slope(
            lanes,
            surfaces, ranges, shared, strips, hinges, hinge_accelerations, operator, wind, constants, state,
            last, before, step, slope, middle, scratch, inputs, outputs,
        )  # fmt: skip
        copy(lanes, slope, last)
        copy(lanes, slope, before)
    middle_slope(
        lanes,
        surfaces, ranges, shared, strips, hinges, hinge_accelerations, operator, wind, constants, state, last,
        before, step, slope, middle, scratch, inputs, outputs,
    )  # fmt: skip
    for link in range(links):
        slow, fast, previous = s_slow + 3 * link, s_fast + 3 * link, s_previous + 3 * link
        lag_from_stage(
            lanes, constants[LINKS_C + LINK_ROWS * link : LINKS_C + LINK_ROWS * (link + 1)],
            scratch[S_FREE + 6 * link : S_FREE + 6 * link + 6],
            middle[slow : slow + 3], middle[fast : fast + 3],
            state[slow : slow + 3], state[fast : fast + 3], state[previous : previous + 3],
        )  # fmt: skip
    finish(lanes, state[:s_slow], slope, step)


@kernel
def instant_rates(
    lanes,
    surfaces, ranges, shared, strips, hinges, hinge_accelerations, operator, wind, constants, state, zero,
    scratch, inputs, outputs, rates,
):  # fmt: skip
    """Time derivative of a block's state, a stage of a step of no length; ``zero``: rows of zeros.

    The lag states' rows are not touched.
    """
    stage(
        lanes,
        surfaces, ranges, shared, strips, hinges, hinge_accelerations, operator, wind, constants, state, zero,
        zero, 0.0, rates, scratch, inputs, outputs,
    )  # fmt: skip
