"""One flight of a rigid or an equivalent model, in chunks."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from morphcore.frames import euler_from_quaternion, rotation_from_quaternion
from morphcore.models.equivalent import ChainModel, ParameterBatch, lane_constants
from morphcore.models.kernels.layout import JOINTS, OMEGA, POSITION, VELOCITY
from morphcore.models.kinematics import tip_positions, whole_joints
from morphcore.multibody.kernels.hinge import HINGE_ROWS
from morphcore.simulate.batch import fly_batch
from morphcore.simulate.plan import FlightPlan, TimeGrid, flight_plan
from morphcore.simulate.record import FlightRecord, require_sound
from morphcore.simulate.schedule import Schedule
from morphcore.simulate.trim import StartMode, trim, trimmed_state
from morphcore.stopping import Stop

Array = NDArray[np.float64]

LARGEST_JOINT_ANGLE_RAD = 0.5 * np.pi  # there flap and edgewise axis of a gimbal turn about the same axis


def chain_flight(
    model: ChainModel,
    batch: ParameterBatch,
    schedules: Sequence[Schedule],
    grid: TimeGrid,
    at: NDArray[np.int64],
    *,
    start: StartMode,
    air_velocity_N: Callable[[Array], Array] | None,
    stop: Stop | None,
) -> Iterator[tuple[float, FlightRecord | None]]:
    """Fly one parameter set; gives the fraction flown after every chunk, with the record at the end.

    Parameters
    ----------
    at : (k,) rows of the grid to report. Others as in `flight.simulate`.
    """
    plan = flight_plan(model, schedules, grid, air_velocity_N=air_velocity_N, may_halve=model.is_even(batch))
    flown = plan.flown(model)
    found = trim(flown, batch, plan, start=start).require()
    constants = lane_constants(flown, batch, grid.step_s)
    constants.set_thrust(found.force_B, found.moment_B)
    state = trimmed_state(flown, batch, plan, found)
    rows, chunks = JOINTS + flown.coordinates, []
    for chunk in fly_batch(flown, plan, constants, state, record_rows=rows, stop=stop):
        chunks.append(chunk.rows[..., 0])
        yield chunk.first / grid.steps, None
    history = np.concatenate(chunks)
    turned = np.abs(history[:, JOINTS:]).max(axis=1, initial=0.0)
    require_sound(
        history,
        history[:, VELOCITY:POSITION],
        model.flight,
        grid.times_s,
        turned < LARGEST_JOINT_ANGLE_RAD,
    )
    history = history[at]
    quaternion = history[:, :OMEGA]
    velocity_N = np.einsum("kij,kj->ki", rotation_from_quaternion(quaternion), history[:, VELOCITY:POSITION])
    angles, tips_z = plan.angles[at], _tips_z(flown, batch, plan, history[:, JOINTS:], at)
    if plan.halved and model.mirror is not None:  # the other half did the same
        angles, tips_z = model.mirror.spread_hinges(angles), model.mirror.spread(tips_z)
        found = replace(found, q_joint=whole_joints(model, found.q_joint))
    record = FlightRecord(
        euler=euler_from_quaternion(quaternion),
        omega_B=history[:, OMEGA:VELOCITY],
        velocity_N=velocity_N,
        position_N=history[:, POSITION:JOINTS],
        angles=angles,
        tips_z=tips_z,
        trim=found,
    )
    yield 1.0, record


def _tips_z(
    model: ChainModel, batch: ParameterBatch, plan: FlightPlan, q_joint: Array, at: NDArray[np.int64]
) -> Array:
    """Tips below their roots along z of B, (k, s), m."""
    surfaces = len(model.aircraft.surfaces)
    level = np.zeros((surfaces, HINGE_ROWS))
    level[:, :9] = np.eye(3).ravel()
    # in wing axes all times are one batch; the hinges turn them afterwards
    tips_W = tip_positions(model, batch.select(np.zeros(at.size, dtype=np.int64)), level, q_joint)
    down_W = plan.hinges[at][:, :, 6:9]  # third row of R_BW
    return np.asarray(np.einsum("ksi,ksi->ks", down_W, tips_W))
