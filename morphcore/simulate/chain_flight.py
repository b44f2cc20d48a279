"""One flight of a rigid or an equivalent model, in chunks."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from morphcore.frames import euler_from_quaternion, rotation_from_quaternion
from morphcore.models.equivalent import ChainModel, LaneConstants, ParameterBatch, lane_constants
from morphcore.models.kernels.layout import JOINTS, OMEGA, POSITION, VELOCITY
from morphcore.models.kinematics import link_poses, tip_bending, tip_positions, whole_joints
from morphcore.multibody.kernels.hinge import HINGE_ROWS
from morphcore.simulate.batch import fly_batch
from morphcore.simulate.control_motion import control_angles, of_every_part
from morphcore.simulate.plan import FlightPlan, flight_plan, start_at
from morphcore.simulate.record import FlightRecord, Loads, Part, require_sound
from morphcore.simulate.schedule import Schedule
from morphcore.simulate.time_grid import TimeGrid
from morphcore.simulate.torque import torques_and_rates
from morphcore.simulate.trim import StartMode, trim, trimmed_state
from morphcore.simulate.wake import trimmed_schedules
from morphcore.stopping import Stop

Array = NDArray[np.float64]

LARGEST_JOINT_ANGLE_RAD = 0.5 * np.pi  # at this torsion the flap and edgewise axes of a gimbal coincide


def chain_flight(
    model: ChainModel,
    batch: ParameterBatch,
    schedules: Sequence[Schedule],
    grid: TimeGrid,
    at: NDArray[np.int64],
    *,
    parts: frozenset[Part] = frozenset(),
    start: StartMode,
    air_velocity_N: Callable[[Array], Array] | None,
    stop: Stop | None,
) -> Iterator[tuple[float, FlightRecord | None]]:
    """Fly one parameter set; yield the fraction flown after every chunk, and the record with the last.

    Parameters
    ----------
    at : (k,) rows of the grid to report. parts : parts of the record to fill in. Others as in
    `flight.simulate`.
    """
    times, schedules = grid.halves_s, of_every_part(model.aircraft, schedules)
    begin = start_at(model, np.array([each.motion(times[:1]).angle[0] for each in schedules]), start)
    schedules = trimmed_schedules(model, schedules, times, begin)
    plan = flight_plan(
        model,
        schedules,
        grid,
        air_velocity_N=air_velocity_N,
        may_halve=model.is_even(batch),
        wake_alpha=begin.alpha,
        shape=begin.shape,
    )
    flown = plan.flown(model)
    found = trim(flown, batch, plan, start=start).require()
    constants = lane_constants(flown, batch, grid.step_s)
    constants.set_thrust(*found.acting_B)
    state = trimmed_state(flown, batch, plan, found)
    rows, chunks, states = JOINTS + flown.coordinates, [], []
    wanted = flown.state_rows if "loads" in parts else rows
    for chunk in fly_batch(flown, plan, constants, state, record_rows=wanted, stop=stop):
        chunks.append(chunk.rows[:, :rows, 0].copy())  # copied: a view would keep the whole states alive
        if "loads" in parts:  # only the reported rows of the states are kept
            inside = (at >= chunk.first) & (at < chunk.first + chunk.rows.shape[0])
            states.append(chunk.rows[at[inside] - chunk.first, :, 0])
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
    bending = tip_bending(flown, _repeated(batch, at.size), history[:, JOINTS:], plan.shape)
    tips_twist = _tips_twist(flown, batch, history[:, JOINTS:]) if "twist" in parts else None
    loads = _loads(flown, plan, constants, np.concatenate(states), at) if states else None
    if plan.halved and model.mirror is not None:  # the other half moved alike
        spread = model.mirror.spread
        angles, tips_z = model.mirror.spread_hinges(angles), spread(tips_z)
        bending = spread(bending)
        tips_twist = None if tips_twist is None else spread(tips_twist)
        if loads is not None and loads.hinge_torque is not None:
            loads = replace(loads, hinge_torque=model.mirror.spread_hinges(loads.hinge_torque))
        found = replace(found, q_joint=whole_joints(model, found.q_joint))
    angles = np.concatenate([angles, control_angles(model.aircraft, schedules, grid.times_s[at])], axis=1)
    record = FlightRecord(
        euler=euler_from_quaternion(quaternion),
        omega_B=history[:, OMEGA:VELOCITY],
        velocity_N=velocity_N,
        position_N=history[:, POSITION:JOINTS],
        wind_N=plan.wind_N[at],
        angles=angles,
        tips_z=tips_z,
        trim=found,
        tips_twist=tips_twist,
        loads=loads,
        bending=bending,
    )
    yield 1.0, record


def _tips_z(
    model: ChainModel, batch: ParameterBatch, plan: FlightPlan, q_joint: Array, at: NDArray[np.int64]
) -> Array:
    """Tips below their roots along z of B, (k, s), m."""
    # in wing axes all times form one batch; the hinges' rotation is applied afterwards
    tips_W = tip_positions(model, _repeated(batch, at.size), _level_hinges(model), q_joint)
    down_W = plan.hinges[at][:, :, 6:9]  # third row of R_BW
    return np.asarray(np.einsum("ksi,ksi->ks", down_W, tips_W))


def _tips_twist(model: ChainModel, batch: ParameterBatch, q_joint: Array) -> Array:
    """Twist (k, s), rad, of tips relative to their roots: torsion of Rx(flap) Ry(torsion) Rz(edgewise)."""
    R_WL, _ = link_poses(model, _repeated(batch, q_joint.shape[0]), _level_hinges(model), q_joint)
    last = model.surfaces[:, 0] + model.surfaces[:, 1] - 1
    return np.arcsin(np.clip(R_WL[:, last, 0, 2], -1.0, 1.0))


def _level_hinges(model: ChainModel) -> Array:
    """Hinges (s, HINGE_ROWS) at rest in the reference position, so that surfaces stay in wing axes."""
    level = np.zeros((len(model.aircraft.surfaces), HINGE_ROWS))
    level[:, :9] = np.eye(3).ravel()
    return level


def _repeated(batch: ParameterBatch, times: int) -> ParameterBatch:
    """One parameter set repeated for a number of times."""
    return batch.select(np.zeros(times, dtype=np.int64))


def _loads(
    model: ChainModel, plan: FlightPlan, constants: LaneConstants, states: Array, at: NDArray[np.int64]
) -> Loads:
    """Accelerations and torques of whole states (k, state_rows) at the rows ``at`` of the grid."""
    torque, rates = torques_and_rates(model, plan.instants(at), constants, states)
    return Loads(velocity_rate_B=rates, hinge_torque=torque)
