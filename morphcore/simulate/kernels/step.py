"""One time step of a block: a W-method of one stage, implicit in joint stiffness, exact in the lag.

The stage lies in the middle of the step; the state is predicted there from the slopes of the two previous
steps (h: the step, k: slopes in the middles of steps, A: a matrix that approximates the stiff part):

    U = u + h (7/8 k1 - 3/8 k2),            k1, k2: of the last step and of the one before
    k = F(t + h/2, U) + h A (9 k - 15 k1 + 6 k2) / 16
    u' = u + h k

7/8 and -3/8 integrate the line through k1 and k2 over half a step, so U is right to O(h^3). The weights on A
sum to zero and so leave k right to O(h^2) for *any* A; with the midpoint rule the step is of second order. It
belongs to the W-methods that reuse the slopes of earlier steps (Podhaisky, Schmitt & Weiner 2002, Appl.
Numer. Math. 42, the two-step W-methods).

Where A is exact, it acts on u + h/2 k1 + GAMMA h (k - k1). At infinite stiffness both roots of that recursion
are -1/3 with GAMMA = 9/16, the smallest possible modulus: fast joints die out, and no oscillation grows,
whatever its frequency (tests/simulate/test_step.py).

A holds the diagonal joint stiffness K and damping C with the mass matrix of the stage, A = [[0, I], [-M^-1 K,
-M^-1 C]]: then the implicit equations are the articulated-body pass with g C + g^2 K, g = GAMMA h, added to
the joint-space diagonal.

At the start there are no slopes yet. A stage of linearly implicit Euler replaces both: its error, of first
order, enters the slopes of two steps only, and the flight stays of second order.

The lag states are linear filters of the links' motion, some faster than a step. They are stepped exactly,
from stage to stage, for a motion that changes linearly in between (Cox & Matthews 2002, J. Comput. Phys. 176,
the quadrature of ETD2), whatever the lag time, zero included. Each stage closes its filter with its own
motion, so that force and motion belong to the same instant. In the state, which belongs to the end of a step,
they are advanced by half a step for a motion that stays as in the last stage, ``previous``.
"""

from __future__ import annotations

import math

from morphcore.aero.kernels.loads import (
    L_FAST_DECAY,
    L_FAST_WEIGHT,
    L_SLOW_DECAY,
    L_SLOW_WEIGHT,
    sloped,
)
from morphcore.jit import inlined, kernel
from morphcore.lanes import not_in_lanes
from morphcore.models.kernels.chain import accelerations, base_rates, clear
from morphcore.models.kernels.layout import (
    LINKS_C,
    S_FREE,
    constant_rows,
    joint_rows_of_scratch,
    state_rows,
    visible_rows_of_scratch,
)
from morphcore.models.kernels.telescope import held_joints, telescopes
from morphcore.multibody.kernels.articulated import LINK_ROWS

GAMMA = 9.0 / 16.0
LAST, BEFORE = 7.0 / 8.0, -3.0 / 8.0  # the predictor's weights of the slopes k1 and k2
SLOPES = 3  # slots of a block's slope memory: step n writes to slot n modulo 3


# A lane loop as short as one row's arithmetic is unrolled by the compiler before it could become vector
# instructions. So rows are taken three at a time, or as one long vector.


@kernel
def predict(state, last, before, step, out):
    """out = u + h (7/8 k1 - 3/8 k2)."""
    begin, slope1, slope2, middle = state.reshape(-1), last.reshape(-1), before.reshape(-1), out.reshape(-1)
    for i in range(begin.size):
        middle[i] = begin[i] + step * (LAST * slope1[i] + BEFORE * slope2[i])


@inlined
def remembered(slope1, slope2, step):
    """The part w = -h (15 k1 - 6 k2) / 16 of the vector that A multiplies."""
    return -step * ((GAMMA - BEFORE) * slope1 + BEFORE * slope2)


@inlined
def spring(k, c, angle, rate, g):
    """Force -k (angle + g rate) - c rate, and the diagonal g c + g^2 k that the implicit step adds."""
    return -k * (angle + g * rate) - c * rate, g * (c + g * k)


@kernel
def joint_forces(lanes, stiffness, damping, q, v, last, before, last_rate, before_rate, step, tau, added):
    """Joint forces and added diagonal of a stage at predicted angles and rates q, v.

    With g = GAMMA h and w of angles (``last``, ``before``) and of rates as in ``remembered``, the implicit
    equations are (M + g C + g^2 K) a = f - K (q + w_q + g (v + w_v)) - C (v + w_v).
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
    for i in range(0, q.shape[0], 3):
        k, c, t, a = stiffness[i : i + 3], damping[i : i + 3], tau[i : i + 3], added[i : i + 3]
        x, x1, x2 = q[i : i + 3], last[i : i + 3], before[i : i + 3]
        y, y1, y2 = v[i : i + 3], last_rate[i : i + 3], before_rate[i : i + 3]
        for l in range(len(lanes)):
            flap, torsion, edgewise = (
                x[0, l] + remembered(x1[0, l], x2[0, l], step),
                x[1, l] + remembered(x1[1, l], x2[1, l], step),
                x[2, l] + remembered(x1[2, l], x2[2, l], step),
            )
            flap_rate, torsion_rate, edgewise_rate = (
                y[0, l] + remembered(y1[0, l], y2[0, l], step),
                y[1, l] + remembered(y1[1, l], y2[1, l], step),
                y[2, l] + remembered(y1[2, l], y2[2, l], step),
            )
            t[0, l], a[0, l] = spring(k[0, l], c[0, l], flap, flap_rate, g)
            t[1, l], a[1, l] = spring(k[1, l], c[1, l], torsion, torsion_rate, g)
            t[2, l], a[2, l] = spring(k[2, l], c[2, l], edgewise, edgewise_rate, g)


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
    for i in range(0, v.shape[0], 3):
        y, y1, y2 = v[i : i + 3], last_rate[i : i + 3], before_rate[i : i + 3]
        a, angle, rate = acceleration[i : i + 3], angle_slope[i : i + 3], rate_slope[i : i + 3]
        for l in range(len(lanes)):
            flap, torsion, edgewise = a[0, l], a[1, l], a[2, l]
            angle[0, l] = y[0, l] + remembered(y1[0, l], y2[0, l], step) + g * flap
            angle[1, l] = y[1, l] + remembered(y1[1, l], y2[1, l], step) + g * torsion
            angle[2, l] = y[2, l] + remembered(y1[2, l], y2[2, l], step) + g * edgewise
            rate[0, l], rate[1, l], rate[2, l] = flap, torsion, edgewise


@inlined
def carried(lag_state, motion, decay):
    """A lag state half a step later, for a constant motion."""
    return motion + decay * (lag_state - motion)


@kernel
def lag_to_stage(lanes, link, slow, fast, previous, stage_slow, stage_fast, stage_previous):
    """Carry a link's lag states over the half step up to a stage, for a constant motion."""
    if not_in_lanes(link, lanes) or not_in_lanes(slow, lanes) or not_in_lanes(fast, lanes):
        return
    if not_in_lanes(previous, lanes) or not_in_lanes(stage_slow, lanes) or not_in_lanes(stage_fast, lanes):
        return
    if not_in_lanes(stage_previous, lanes):
        return
    for l in range(len(lanes)):
        slow_decay, fast_decay = link[L_SLOW_DECAY, l], link[L_FAST_DECAY, l]
        z, x, y = previous[0, l], previous[1, l], previous[2, l]
        stage_previous[0, l], stage_previous[1, l], stage_previous[2, l] = z, x, y
        stage_slow[0, l] = carried(slow[0, l], z, slow_decay)
        stage_slow[1, l] = carried(slow[1, l], x, slow_decay)
        stage_slow[2, l] = carried(slow[2, l], y, slow_decay)
        stage_fast[0, l] = carried(fast[0, l], z, fast_decay)
        stage_fast[1, l] = carried(fast[1, l], x, fast_decay)
        stage_fast[2, l] = carried(fast[2, l], y, fast_decay)


@kernel
def lag_from_stage(lanes, link, twist, stage_slow, stage_fast, slow, fast, previous):
    """Close a link's filters with a stage's twist (rows as in ``lagged_motion``), half a step later."""
    if (
        not_in_lanes(link, lanes)
        or not_in_lanes(twist, lanes)
        or not_in_lanes(stage_slow, lanes)
        or not_in_lanes(stage_fast, lanes)
    ):
        return
    if not_in_lanes(slow, lanes) or not_in_lanes(fast, lanes) or not_in_lanes(previous, lanes):
        return
    for l in range(len(lanes)):
        slow_decay, slow_weight = link[L_SLOW_DECAY, l], link[L_SLOW_WEIGHT, l]
        fast_decay, fast_weight = link[L_FAST_DECAY, l], link[L_FAST_WEIGHT, l]
        z, x, y = sloped(link, twist, l)
        dz, dx, dy = z - previous[0, l], x - previous[1, l], y - previous[2, l]
        slow[0, l] = carried(stage_slow[0, l] + slow_weight * dz, z, slow_decay)
        slow[1, l] = carried(stage_slow[1, l] + slow_weight * dx, x, slow_decay)
        slow[2, l] = carried(stage_slow[2, l] + slow_weight * dy, y, slow_decay)
        fast[0, l] = carried(stage_fast[0, l] + fast_weight * dz, z, fast_decay)
        fast[1, l] = carried(stage_fast[1, l] + fast_weight * dx, x, fast_decay)
        fast[2, l] = carried(stage_fast[2, l] + fast_weight * dy, y, fast_decay)
        previous[0, l], previous[1, l], previous[2, l] = z, x, y


@kernel
def copy(source, out):
    """out = source."""
    rows, target = source.reshape(-1), out.reshape(-1)
    for i in range(rows.size):
        target[i] = rows[i]


@kernel
def finish(lanes, state, slope, step):
    """state += h k, with the attitude quaternion renormalised."""
    if not_in_lanes(state, lanes):
        return
    rows, rates = state.reshape(-1), slope.reshape(-1)
    for i in range(rows.size):
        rows[i] += step * rates[i]
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
    stiffness = constants[c_stiffness : c_stiffness + coordinates]
    damping = constants[c_damping : c_damping + coordinates]
    if telescopes(surfaces):
        _, w_stiffness, w_damping, w_overlap = visible_rows_of_scratch(links, coordinates)
        held = scratch[w_stiffness:w_damping], scratch[w_damping:w_overlap]
        held_joints(lanes, surfaces, strips, constants[LINKS_C:], stiffness, damping, held[0], held[1])
        stiffness, damping = held[0], held[1]
    joint_forces(
        lanes, stiffness, damping,
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
    predict(state[:s_slow], last, before, step, middle[:s_slow])
    for link in range(links):
        slow, fast, previous = s_slow + 3 * link, s_fast + 3 * link, s_previous + 3 * link
        lag_to_stage(
            lanes, constants[LINKS_C + LINK_ROWS * link : LINKS_C + LINK_ROWS * (link + 1)],
            state[slow : slow + 3], state[fast : fast + 3], state[previous : previous + 3],
            middle[slow : slow + 3], middle[fast : fast + 3], middle[previous : previous + 3],
        )  # fmt: skip
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

    ``number``: number of steps flown so far. ``slopes`` (SLOPES, mechanical rows, width): the block's memory,
    filled here at the first step. ``hinge_accelerations`` (s, 6) hold the change of the hinges' rates over
    the step, divided by its length: where a schedule's acceleration jumps, the momentum that the wings
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
        copy(slope, last)
        copy(slope, before)
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
    """Time derivative of a block's state, as a stage of a step of zero length; ``zero``: rows of zeros.

    The rows of the lag states are left unchanged.
    """
    stage(
        lanes,
        surfaces, ranges, shared, strips, hinges, hinge_accelerations, operator, wind, constants, state, zero,
        zero, 0.0, rates, scratch, inputs, outputs,
    )  # fmt: skip
