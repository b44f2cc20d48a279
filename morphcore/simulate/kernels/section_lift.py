"""Lift coefficients of the sections of a chain along a flight."""

from __future__ import annotations

from morphcore.aero.kernels.loads import OUTPUTS, STRIP0, STRIPS
from morphcore.aero.kernels.stall import strip_speed
from morphcore.jit import entry_kernel
from morphcore.models.kernels.layout import (
    S_SUMS,
    axis_rows_of_scratch,
    constant_rows,
    link_rows_of_scratch,
)
from morphcore.simulate.kernels.step import instant_rates


@entry_kernel
def section_lifts(
    lanes,
    surfaces, ranges, shared, strips, hinges, hinge_accelerations, operators, air, constants, states, zero,
    block, scratch, inputs, outputs, rates, half_areas, out,
):  # fmt: skip
    """Circulation of every strip as a lift coefficient, at each of some instants of one flight.

    Without limits of the lift: ``shared`` must not have any. Parameters as in ``torques``. half_areas : (j,)
    of the strips, m^2. out : (t, j).
    """
    links = ranges.shape[0]
    coordinates = 3 * (links - surfaces.shape[0])
    w_twist, _, _, _, _ = link_rows_of_scratch(links)
    _, _, c_overlap = constant_rows(links, coordinates)
    axes = axis_rows_of_scratch(links, coordinates)[0] + 9
    sums = scratch[S_SUMS : S_SUMS + 6]
    for n in range(states.shape[0]):
        for i in range(states.shape[1]):
            for l in range(len(lanes)):
                block[i, l] = states[n, i]
        instant_rates(
            lanes,
            surfaces, ranges, shared, strips[n], hinges[n], hinge_accelerations[n], operators[n], air[n],
            constants, block, zero, scratch, inputs, outputs, rates,
        )  # fmt: skip
        for s in range(surfaces.shape[0]):
            for j in range(surfaces[s, STRIPS]):
                strip_speed(
                    lanes, surfaces[s], j, ranges, strips[n], constants[c_overlap:], air[n],
                    scratch[axes : axes + 9 * links], scratch[w_twist : w_twist + 6 * links], sums,
                )  # fmt: skip
                strip = surfaces[s, STRIP0] + j
                out[n, strip] = outputs[OUTPUTS * strip, 0] / (half_areas[strip] * sums[0, 0])
