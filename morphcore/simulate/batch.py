"""Flights of many parameter sets over one plan, in chunks that each take well under a second."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.stall import lift_limits, strip_half_areas
from morphcore.lanes import lane_type
from morphcore.models.equivalent import ChainModel, LaneConstants, from_lanes, to_lanes
from morphcore.models.kernels.layout import JOINTS, state_rows
from morphcore.simulate.kernels.batch import fly, rates_of_blocks
from morphcore.simulate.kernels.step import SLOPES
from morphcore.stopping import Stop, check_stop
from morphcore.threads import in_threads, thread_count

if TYPE_CHECKING:
    from morphcore.simulate.plan import FlightPlan

Array = NDArray[np.float64]

CHUNK_BLOCK_STEPS = 6_000  # block steps per chunk and thread: about a fifth of a second
LONGEST_CHUNK = 64  # steps: bounds the memory of the interpolated operators
BLOCKS_PER_GROUP = 8  # their states stay in the second-level cache while the operator of a step is shared


@dataclass(frozen=True)
class Chunk:
    """States after some steps of all flights.

    first : index of the first recorded grid time. rows : (k, r, p) the first r rows of the state.
    """

    first: int
    rows: Array


def shared_numbers(model: ChainModel, *, limited: bool = True) -> Array:
    """Density, gravity, the fuselage's spatial inertia (21), whether there is apparent mass; for kernels.

    If sections stall and ``limited``, also the limits of all strips (`aero.kernels.stall.limit_lift`).
    """
    fuselage = model.aircraft.fuselage
    x, y, z = fuselage.centre_of_mass_B
    m = fuselage.mass_kg
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    inertia = fuselage.inertia_B + m * cross @ cross.T
    upper = np.triu_indices(3)
    lattices = model.lattice.lattices
    limits = lift_limits(model.aircraft.surfaces, lattices) if limited else np.zeros((0, 2))
    return np.concatenate(
        [
            [model.flight.air_density_kg_m3, model.flight.gravity_m_s2],
            inertia[upper],
            (m * cross).ravel(),
            (m * np.eye(3))[upper],
            [float(model.flight.apparent_mass)],
            (limits * strip_half_areas(lattices)[: limits.shape[0], None]).ravel(),
        ]
    )


def initial_state(
    *,
    quaternion: Array,
    omega_B: Array,
    velocity_B: Array,
    q_joint: Array,
    lag_motion: Array,
    position_N: Array | None = None,
) -> Array:
    """State rows (p, state_rows) with resting joints.

    quaternion (p, 4), omega_B, velocity_B, position_N (p, 3), q_joint (p, coordinates); ``lag_motion`` (p,
    links, 3): the motion (v_z, omega_x, omega_y) of each link that the circulation has settled to.
    """
    particles = quaternion.shape[0]
    lag = lag_motion.reshape(particles, -1)
    position = np.zeros((particles, 3)) if position_N is None else position_N
    return np.concatenate(
        [quaternion, omega_B, velocity_B, position, q_joint, np.zeros_like(q_joint), lag, lag, lag], axis=1
    )


def fly_batch(
    model: ChainModel,
    plan: FlightPlan,
    constants: LaneConstants,
    state: Array,
    *,
    record_rows: int = JOINTS,
    stop: Stop | None = None,
) -> Iterator[Chunk]:
    """Fly all parameter sets through a plan.

    Parameters
    ----------
    state : (p, state_rows) at the grid's start. record_rows : how many rows of the state to report.
    stop : called before every chunk; True raises Interrupted.

    Yields
    ------
    Chunks in chronological order, the initial state first (as a chunk of one row).
    """
    particles = state.shape[0]
    blocks = to_lanes(state)
    count, _, width = blocks.shape
    threads = thread_count()
    bounds = _groups(count, threads)
    groups = bounds.size - 1
    rows, columns = model.lattice.operator_shape
    mechanical = state_rows(model.links, model.coordinates)[2]
    slopes = np.zeros((count, SLOPES, mechanical, width))
    middle = np.zeros((groups, model.state_rows, width))
    scratch = np.zeros((groups, model.scratch_rows, width))
    inputs, outputs = np.zeros((groups, columns, width)), np.zeros((groups, rows, width))
    shared, mean_accelerations = shared_numbers(model), plan.mean_accelerations
    yield Chunk(0, state[None, :, :record_rows].transpose(0, 2, 1))
    length = int(np.clip(CHUNK_BLOCK_STEPS * threads // count, 1, LONGEST_CHUNK))
    for first in range(0, plan.grid.steps, length):
        check_stop(stop)
        last = min(first + length, plan.grid.steps)
        operators, strips = plan.middle.table.between(first, last)
        hinges, air = plan.middle.hinges[first:last], plan.middle.air(first, last)
        accelerations = mean_accelerations[first:last]
        record = np.empty((last - first, record_rows, count, width))
        common = (
            model.surfaces, constants.ranges, shared, strips, hinges, accelerations, operators, air,
            constants.rows, plan.grid.step_s, first, blocks, slopes,
        )  # fmt: skip
        own = (middle, scratch, inputs, outputs)
        in_threads(partial(_fly_group, bounds, common, own, record), groups)
        yield Chunk(first + 1, record.reshape(last - first, record_rows, -1)[..., :particles])


def _fly_group(
    bounds: NDArray[np.int64], common: tuple[Any, ...], own: tuple[Array, ...], record: Array, group: int
) -> None:
    fly(
        lane_type(record.shape[-1]),
        bounds[group],
        bounds[group + 1],
        *common,
        *(array[group] for array in own),
        record,
    )


def _groups(blocks: int, threads: int) -> NDArray[np.int64]:
    """First blocks of the groups, and the end: whole rounds of the threads that fit into the cache."""
    rounds = -(-blocks // (BLOCKS_PER_GROUP * threads))
    groups = min(blocks, threads * rounds)
    return np.arange(groups + 1) * blocks // groups


def state_rates(
    model: ChainModel, plan: FlightPlan, row: int, constants: LaneConstants, state: Array
) -> Array:
    """Time derivative (p, state_rows) of the states (p, state_rows) at one grid time of a plan."""
    blocks = to_lanes(state)
    count, _, width = blocks.shape
    rows, columns = model.lattice.operator_shape
    operators, strips = plan.table.between(row, row + 1)
    rates = np.zeros_like(blocks)  # stays zero for the lag states
    bounds = _groups(count, thread_count())
    common = (
        model.surfaces, constants.ranges, shared_numbers(model), strips, plan.hinges[row : row + 1],
        plan.surface_accelerations[row], operators, plan.wind_N[row : row + 1], constants.rows,
        np.zeros((model.state_rows, width)), blocks,
    )  # fmt: skip

    def group_rates(group: int) -> None:
        scratch = np.zeros((model.scratch_rows, width))
        inputs, outputs = np.zeros((columns, width)), np.zeros((rows, width))
        rates_of_blocks(
            lane_type(width), bounds[group], bounds[group + 1], *common, scratch, inputs, outputs, rates
        )

    in_threads(group_rates, bounds.size - 1)
    return from_lanes(rates, state.shape[0])
