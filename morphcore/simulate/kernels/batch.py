"""Blocks of lanes over time."""

from __future__ import annotations

from morphcore.jit import entry_kernel
from morphcore.simulate.kernels.step import instant_rates, step_block


@entry_kernel
def fly(
    lanes,
    first, last, surfaces, ranges, shared, strips, hinges, hinge_accelerations, operators, wind, constants,
    step, number, state, slopes, middle, scratch, inputs, outputs, record,
):  # fmt: skip
    """Fly the blocks first..last - 1 over some steps.

    Time is the outer loop: the operator of a step is read once for all these blocks.

    Parameters (b blocks, t steps, s surfaces, n links, j strips)
    ----------
    surfaces : (s, 7); ranges : (b, n, 2); shared : (23,). In the middles of the steps: strips : (t, j, 3);
    hinges : (t, s, HINGE_ROWS); hinge_accelerations : (t, s, 6); operators : (t, rows, columns); wind : (t,
    3). constants : (b, rows, width). step : s. number : steps made before. state : (b, rows, width), advanced
    in place. slopes : (b, SLOPES, mechanical rows, width), the blocks' memory. middle : (rows, width);
    scratch, inputs, outputs : (rows, width), provided by the caller. record : (t, r, b, width): the first r
    rows of the state after each step.
    """
    for n in range(record.shape[0]):
        for b in range(first, last):
            step_block(
                lanes, surfaces, ranges[b], shared, strips[n], hinges[n], hinge_accelerations[n],
                operators[n], wind[n], constants[b], state[b], step, number + n, slopes[b], middle, scratch,
                inputs, outputs,
            )  # fmt: skip
            for r in range(record.shape[1]):
                for l in range(len(lanes)):
                    record[n, r, b, l] = state[b, r, l]


@entry_kernel
def rates_of_blocks(
    lanes,
    first, last, surfaces, ranges, shared, strips, hinges, hinge_accelerations, operators, wind, constants,
    zero, state, scratch, inputs, outputs, rates,
):  # fmt: skip
    """Time derivative of some blocks' states at one instant, springs and dampers included (trim, tests)."""
    for b in range(first, last):
        instant_rates(
            lanes,
            surfaces, ranges[b], shared, strips[0], hinges[0], hinge_accelerations, operators[0], wind[0],
            constants[b], state[b], zero, scratch, inputs, outputs, rates[b],
        )  # fmt: skip
