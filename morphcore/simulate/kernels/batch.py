"""Blocks of lanes over time and threads: the one file with ``prange``."""

from __future__ import annotations

import numba

from morphcore.jit import parallel_kernel
from morphcore.lanes import LANES
from morphcore.simulate.kernels.step import instant_rates, step_block


@parallel_kernel
def fly(
    surfaces, ranges, shared, strips, hinges, hinge_accelerations, operators, wind, constants, step, state,
    work, scratch, inputs, outputs, record,
):  # fmt: skip
    """Fly all blocks over some steps; blocks are dealt to groups, and groups to threads.

    Within a group, time is the outer loop: the operator of a step is read once for all blocks of the group.

    Parameters (b blocks, g groups, t steps, s surfaces, n links, j strips)
    ----------
    surfaces : (s, 5); ranges : (b, n, 2); shared : (23,);
    strips : (t + 1, j, 3); hinges : (t + 1, s, HINGE_ROWS); hinge_accelerations : (t, s); operators : (t + 1,
    rows, columns); wind : (t + 1, 3).
    constants : (b, rows, LANES). step : s. state : (b, rows, LANES), advanced in place.
    work : (g, 3, rows, LANES); scratch : (g, rows, LANES); inputs : (g, columns, LANES); outputs : (g, rows,
    LANES).
    record : (t, r, b, LANES): the first r rows of the state after each step.
    """
    groups = scratch.shape[0]
    blocks = state.shape[0]
    per_group = (blocks + groups - 1) // groups
    for g in numba.prange(groups):
        for n in range(record.shape[0]):
            for b in range(g * per_group, min((g + 1) * per_group, blocks)):
                step_block(
                    surfaces, ranges[b], shared, strips[n : n + 2], hinges[n : n + 2],
                    hinge_accelerations[n], operators[n : n + 2], wind[n : n + 2], constants[b], state[b],
                    step, work[g, 0], work[g, 1], work[g, 2], scratch[g], inputs[g], outputs[g],
                )  # fmt: skip
                for r in range(record.shape[1]):
                    for l in range(LANES):
                        record[n, r, b, l] = state[b, r, l]


@parallel_kernel
def rates_of_blocks(
    surfaces, ranges, shared, strips, hinges, hinge_accelerations, operators, wind, constants, first, state,
    scratch, inputs, outputs, rates,
):  # fmt: skip
    """Time derivative of every block's state at one instant, springs and dampers included (trim, tests)."""
    for b in numba.prange(state.shape[0]):
        instant_rates(
            surfaces, ranges[b], shared, strips[0], hinges[0], hinge_accelerations, operators[0], wind[0],
            constants[b], state[b], first, scratch[b], inputs[b], outputs[b], rates[b],
        )  # fmt: skip
