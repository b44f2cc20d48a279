"""One stage alone, for time steppers that are written in Python (the study of steppers)."""

from __future__ import annotations

from morphcore.jit import entry_kernel
from morphcore.models.kernels.chain import accelerations, base_rates


@entry_kernel
def one_stage(
    lanes,
    surfaces, ranges, shared, strips, hinges, hinge_accelerations, operator, wind, constants, state, scratch,
    inputs, outputs, rates,
):  # fmt: skip
    """Accelerations of one block for the joint forces and the added diagonal in its scratch block.

    Arrays as in ``accelerations``; ``rates`` (13, width) takes the rates of the fuselage.
    """
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
