"""Torque of the hinge motors along a flown flight."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from morphcore.lanes import lane_type
from morphcore.models.equivalent import ChainModel, LaneConstants
from morphcore.simulate.batch import shared_numbers
from morphcore.simulate.kernels.torque import torques
from morphcore.simulate.plan import FlightPlan

Array = NDArray[np.float64]

CHUNK = 64  # instants: bounds the memory of the interpolated operators


def hinge_torques(model: ChainModel, plan: FlightPlan, constants: LaneConstants, states: Array) -> Array:
    """Torque of the hinge motors at every grid time, (steps + 1, s), N m along the positive coordinates.

    Inverse dynamics of the wings with their own accelerations and air loads at that instant; the hinges'
    accelerations are the schedule's (at its ends those of the morph, not of the rest beside it). Zero for
    surfaces without a hinge.

    Parameters
    ----------
    constants : of the one parameter set that was flown, thrust included. states : (steps + 1, state_rows) all
        rows of its state at the grid times.
    """
    rows, columns = model.lattice.operator_shape
    out = np.empty((states.shape[0], len(model.aircraft.surfaces)))
    width = constants.rows.shape[-1]
    zero, block, rates = np.zeros((3, model.state_rows, width))
    scratch = np.zeros((model.scratch_rows, width))
    inputs, outputs = np.zeros((columns, width)), np.zeros((rows, width))
    shared = shared_numbers(model)
    for first in range(0, states.shape[0], CHUNK):
        part = slice(first, min(first + CHUNK, states.shape[0]))
        operators, strips = plan.table.between(part.start, part.stop)
        torques(
            lane_type(width),
            model.surfaces, constants.ranges[0], shared, strips, plan.hinges[part], plan.accelerations[part],
            operators, plan.wind_N[part], constants.rows[0], states[part], zero, block, scratch, inputs,
            outputs, rates, out[part],
        )  # fmt: skip
    return out
