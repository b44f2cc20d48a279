"""Lift of the sections of a chain, without the limits at which they stall; and trims that these forbid."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.kernels.gust_loads import GUST_COLUMNS, UNIFORM
from morphcore.aero.kernels.loads import CHORD_X, CHORD_Y, OUTPUTS
from morphcore.aero.stall import StallRecord, stall_record, stalls, strip_half_areas
from morphcore.errors import TrimNotFound
from morphcore.lanes import TOGETHER, lane_type
from morphcore.models.equivalent import ChainModel, LaneConstants, ParameterBatch, lane_constants
from morphcore.models.kernels.layout import axis_rows_of_scratch, constant_rows, link_rows_of_scratch
from morphcore.simulate.batch import shared_numbers
from morphcore.simulate.kernels.batch import rates_of_blocks
from morphcore.simulate.steady import described
from morphcore.simulate.trim import MAX_ITERATIONS, StartMode, Trim, trim, trimmed_state
from morphcore.simulate.trim_limits import stalled

if TYPE_CHECKING:  # a plan is made for a trim (see wake.py)
    from morphcore.simulate.plan import FlightPlan

Array = NDArray[np.float64]


def section_lifts(
    model: ChainModel, plan: FlightPlan, constants: LaneConstants, rows: Array, states: Array
) -> Array:
    """Lift coefficient (t, j) of every strip, from its circulation and speed, if no section stalled.

    Parameters
    ----------
    plan : with a row for each state. constants : of one flight; ``rows`` (rows, width) those to use (see
    `torque.closing_half_a_step`). states : (t, state_rows).
    """
    operator_rows, columns = model.lattice.operator_shape
    width = TOGETHER  # of the kernel that trims have compiled already
    rates, zero = np.zeros((1, model.state_rows, width)), np.zeros((model.state_rows, width))
    scratch = np.zeros((model.scratch_rows, width))
    inputs, outputs = np.zeros((columns, width)), np.zeros((operator_rows, width))
    shared, accelerations = shared_numbers(model, limited=False), plan.surface_accelerations
    overlap = rows[constant_rows(model.links, model.coordinates)[-1] :, 0]
    spread = np.repeat(rows[None, :, :1], width, axis=2)
    half_areas = strip_half_areas(model.lattice.lattices)
    out = np.empty((states.shape[0], model.lattice.strips))
    for n, state in enumerate(states):
        operators, strips = plan.table.between(n, n + 1)
        air = plan.air(n, n + 1)
        block = np.ascontiguousarray(np.broadcast_to(state[None, :, None], (1, state.size, width)))
        rates_of_blocks(
            lane_type(width), 0, 1, model.surfaces, constants.ranges[:1], shared, strips,
            plan.hinges[n : n + 1], accelerations[n], operators, air, spread, zero, block, scratch,
            inputs, outputs, rates,
        )  # fmt: skip
        circulation = outputs[: OUTPUTS * model.lattice.strips : OUTPUTS, 0]
        out[n] = circulation / (half_areas * _speeds(model, scratch[:, 0], overlap, strips[0], air[0]))
    return out


def _speeds(model: ChainModel, scratch: Array, overlap: Array, strips: Array, air: Array) -> Array:
    """Speed (j,) of each strip in the plane of its section relative to the air, as `kernels.stall` has it."""
    links, twist0 = model.links, link_rows_of_scratch(model.links)[0]
    axes0 = axis_rows_of_scratch(links, model.coordinates)[0] + 9
    twists = scratch[twist0 : twist0 + 6 * links].reshape(links, 6)
    axes = scratch[axes0 : axes0 + 9 * links].reshape(links, 3, 3)  # link, axis of N, axis of the link
    speeds = np.empty(model.lattice.strips)
    for link0, count, strip0, spanwise, pair0 in model.surfaces[:, :5]:
        own, mine = slice(strip0, strip0 + spanwise), slice(link0, link0 + count)
        part = overlap[2 * pair0 : 2 * (pair0 + spanwise * count)].reshape(spanwise, count, 2)
        weight, y, twist = part[..., 0], part[..., 1], twists[mine]
        velocity = np.stack(
            [
                twist[:, 3] - twist[:, 2] * y,
                np.broadcast_to(twist[:, 4], y.shape),
                twist[:, 5] + twist[:, 0] * y,
            ],
            axis=-1,
        )
        if air.size > UNIFORM:
            gust_N = air[UNIFORM:].reshape(-1, GUST_COLUMNS)[own, :3]
            velocity -= np.einsum("jn,knx->jkx", gust_N, axes[mine])
        mean = np.einsum("jk,jkx->jx", weight, velocity)
        along = strips[own, CHORD_X] * mean[:, 0] + strips[own, CHORD_Y] * mean[:, 1]
        speeds[own] = np.hypot(along, mean[:, 2])
    return speeds


def stall_of_flight(
    model: ChainModel, plan: FlightPlan, constants: LaneConstants, rows: Array, states: Array
) -> StallRecord | None:
    """How near the sections came to their limits at each of some states; None if none has any."""
    surfaces, lattices = model.aircraft.surfaces, model.lattice.lattices
    if not stalls(surfaces):
        return None
    lift = section_lifts(model, plan, constants, rows, states)
    return stall_record(lift, surfaces, lattices)


def require_attached(
    model: ChainModel, batch: ParameterBatch, plan: FlightPlan, found: Trim, start: StartMode
) -> Trim:
    """Return a trim of one parameter set if it was found and no section stalls in it.

    Where sections stall, level flight may not exist at all. Then it is sought without their limits, to state
    the lift coefficient that it would need.

    Raises
    ------
    TrimNotFound : there is no trim, or it needs sections that stall.
    """
    if start == "given" or not stalls(model.aircraft.surfaces):
        return found.require(model.flight)
    reached, flown = found, model
    if not found.converged.all():
        free = tuple(replace(surface, cl_max=None, cl_min=None) for surface in model.aircraft.surfaces)
        flown = replace(model, aircraft=replace(model.aircraft, surfaces=free))
        reached = trim(flown, batch, plan, start=start)
        if not reached.converged.all():
            return found.require(model.flight)
    held = replace(plan.at_rest(), gusts=None)
    constants = lane_constants(flown, batch, plan.grid.step_s)
    states = trimmed_state(flown, batch, held, reached)
    lift = section_lifts(flown, held, constants, constants.rows[0], states)
    record = stall_record(lift, model.aircraft.surfaces, model.lattice.lattices)
    if record.ratio[0] <= 1.0:
        return found.require(model.flight)
    limit = stalled(*record.worst(0), model.flight.airspeed_m_s)
    raise TrimNotFound(
        residual=0.0,
        iterations=MAX_ITERATIONS,
        limit=limit.found,
        hint=limit.hint,
        flight=described(model.flight),
    )
