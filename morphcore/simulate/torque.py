"""Torque of the hinge motors, loads of the surfaces and acceleration of the fuselage along a flown flight."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.kernels.loads import L_FAST_DECAY, L_SLOW_DECAY, TELESCOPES
from morphcore.lanes import lane_type
from morphcore.models.equivalent import ChainModel, LaneConstants
from morphcore.models.kernels.layout import LINKS_C
from morphcore.models.telescope import mouth_forces
from morphcore.multibody.hinges import hinge_screws
from morphcore.multibody.kernels.articulated import LINK_ROWS
from morphcore.simulate.batch import shared_numbers
from morphcore.simulate.kernels.torque import torques
from morphcore.simulate.plan import FlightPlan

Array = NDArray[np.float64]

LAG_DECAYS = (L_SLOW_DECAY, L_FAST_DECAY)  # each before its weight
CHUNK = 64  # instants at a time: bounds the memory of the interpolated operators


@dataclass(frozen=True)
class ChainLoads:
    """Loads of a chain at t instants (s surfaces, h hinges, l links, strips of all surfaces).

    torque : (t, h) of the hinge motors, N m along the positive angles. twist_rate_B : (t, 6) time derivative
    of the components of omega_B and v_B by the equations of motion, rad/s^2 and m/s^2. root_W : (t, s, 6)
    moment and force on each surface at the root of its elastic axis, in W, N m and N. air_L, twist_L,
    acceleration_L : (t, l, 6) force vector of the air on each link, its twist relative to the air, and its
    spatial acceleration relative to free fall, in its own axes at its origin. sections : (t, strips, 3)
    circulation times width, m^3/s, velocity along the chord and normal to it, m/s. The last four are empty
    unless requested.
    """

    torque: Array
    twist_rate_B: Array
    root_W: Array
    air_L: Array
    twist_L: Array
    acceleration_L: Array
    sections: Array


def hinge_torques(model: ChainModel, plan: FlightPlan, constants: LaneConstants, states: Array) -> Array:
    """Torque of the hinge motors at every grid time, (steps + 1, h), N m along the positive angles.

    Of a prismatic hinge it is the force of its drive along the extension, N.

    Inverse dynamics of the wings with their own accelerations and air loads at that instant; the hinges'
    accelerations are the schedule's (at its ends those of the morph, not of the adjacent rest). Columns are
    those of ``plan.angles``: hinges of the model that the plan flies.

    Parameters
    ----------
    constants : of the flown parameter set, thrust included. states : (steps + 1, state_rows) all rows of its
    state at the grid times.
    """
    return chain_loads(model, plan, constants, states).torque


def chain_loads(
    model: ChainModel, plan: FlightPlan, constants: LaneConstants, states: Array, *, every_body: bool = False
) -> ChainLoads:
    """Inverse dynamics of states (t, state_rows), as in `hinge_torques`.

    Parameters
    ----------
    plan : a plan whose `FlightPlan.table`, `hinges`, `accelerations` and `air` have a row for each state.
    every_body : whether the motion of the links and their air loads are reported, too.
    """
    rows, columns = model.lattice.operator_shape
    surfaces, hinges_of = model.aircraft.surfaces, model.aircraft.hinge_columns
    count = states.shape[0]
    out, twist_rates = np.empty((count, len(model.aircraft.hinges))), np.empty((count, 6))
    roots = np.empty((count, len(surfaces), 6))
    reported = count if every_body else 0
    bodies, sections = np.empty((reported, model.links, 18)), np.empty((reported, model.lattice.strips, 3))
    first_hinges = np.array([0, *(own.stop for own in hinges_of)], dtype=np.int64)
    accelerations = plan.surface_accelerations
    width = constants.rows.shape[-1]
    zero, block, rates = np.zeros((3, model.state_rows, width))
    scratch = np.zeros((model.scratch_rows, width))
    laid = closing_half_a_step(model, constants.rows[0])
    inputs, outputs = np.zeros((columns, width)), np.zeros((rows, width))
    shared = shared_numbers(model)
    for first in range(0, count, CHUNK):
        part = slice(first, min(first + CHUNK, count))
        operators, strips = plan.table.between(part.start, part.stop)
        screws = np.concatenate(
            [
                hinge_screws(surface.hinges, surface.root_arms_B, plan.angles[part, own], surface.rest_R_BW)
                for surface, own in zip(surfaces, hinges_of, strict=True)
            ],
            axis=1,
        )
        torques(
            lane_type(width),
            model.surfaces, constants.ranges[0], shared, strips, plan.hinges[part], accelerations[part],
            first_hinges, screws, operators, plan.air(part.start, part.stop), laid, states[part], zero, block,
            scratch, inputs, outputs, rates, out[part], twist_rates[part], roots[part], bodies[part],
            sections[part],
        )  # fmt: skip
    if model.surfaces[:, TELESCOPES].any():
        out += mouth_forces(model, constants.rows[0], plan.angles, states)
    air, twist, acceleration = np.split(bodies, 3, axis=2)
    return ChainLoads(out, twist_rates, roots, air, twist, acceleration, sections)


def closing_half_a_step(model: ChainModel, rows: Array) -> Array:
    """A block's constants (rows, width) with the lag weights changed to those of half the step.

    The lag states of a state stem from the stage in the middle of the step before (see kernels/step.py). With
    the decay e of half a step and the weight w = 1 - (1 - e^2) T / h of a whole one, that of a half is
    1 - 2 (1 - w) / (1 + e).
    """
    halved = rows.copy()
    for link in range(model.links):
        for decay in (LINKS_C + LINK_ROWS * link + column for column in LAG_DECAYS):
            halved[decay + 1] = 1.0 - 2.0 * (1.0 - rows[decay + 1]) / (1.0 + rows[decay])
    return halved
