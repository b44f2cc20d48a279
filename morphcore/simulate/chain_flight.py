"""One flight of a rigid or an equivalent model, in chunks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.environment import MovingAir
from morphcore.aero.stall import StallRecord, stalls
from morphcore.frames import euler_from_quaternion, rotation_from_quaternion
from morphcore.models.equivalent import ChainModel, LaneConstants, ParameterBatch, lane_constants
from morphcore.models.kernels.layout import JOINTS, OMEGA, POSITION, VELOCITY
from morphcore.models.kinematics import tip_bending, whole_joints
from morphcore.simulate.batch import fly_batch
from morphcore.simulate.chain_outputs import point_forces, surface_loads, tips_twist, tips_z
from morphcore.simulate.control_motion import control_angles, of_every_part
from morphcore.simulate.plan import FlightPlan, flight_plan, start_at
from morphcore.simulate.record import FlightRecord, Loads, Outputs, air_at_reference, require_sound
from morphcore.simulate.schedule import Schedule
from morphcore.simulate.section_lift import require_attached, stall_of_flight
from morphcore.simulate.shape import chain_shape, of_both_halves
from morphcore.simulate.time_grid import TimeGrid
from morphcore.simulate.torque import chain_loads, closing_half_a_step
from morphcore.simulate.trim import StartMode, trim, trimmed_state
from morphcore.simulate.wake import trimmed_schedules
from morphcore.stopping import Stop

Array = NDArray[np.float64]

NOTHING_MORE = Outputs()
LARGEST_JOINT_ANGLE_RAD = 0.5 * np.pi  # at this torsion the flap and edgewise axes of a gimbal coincide


def chain_flight(
    model: ChainModel,
    batch: ParameterBatch,
    schedules: Sequence[Schedule],
    grid: TimeGrid,
    at: NDArray[np.int64],
    *,
    outputs: Outputs = NOTHING_MORE,
    start: StartMode,
    air: MovingAir | None,
    stop: Stop | None,
) -> Iterator[tuple[float, FlightRecord | None]]:
    """Fly one parameter set; yield the fraction flown after every chunk, and the record with the last.

    Parameters
    ----------
    at : (k,) rows of the grid to report. outputs : what to record besides. Others as in `flight.simulate`.
    """
    times, schedules = grid.halves_s, of_every_part(model.aircraft, schedules)
    begin = start_at(model, np.array([each.motion(times[:1]).angle[0] for each in schedules]), start)
    schedules = trimmed_schedules(model, schedules, times, begin)
    plan = flight_plan(
        model,
        schedules,
        grid,
        air=air,
        may_halve=model.is_even(batch),
        wake_alpha=begin.alpha,
        shape=begin.shape,
    )
    flown = plan.flown(model)
    found = require_attached(flown, batch, plan, trim(flown, batch, plan, start=start), start)
    constants = lane_constants(flown, batch, grid.step_s)
    constants.set_thrust(*found.acting_B)
    state = trimmed_state(flown, batch, plan, found)
    rows, chunks, states = JOINTS + flown.coordinates, [], []
    with_loads = bool(outputs.parts & {"loads", "surfaces"})
    whole = with_loads or stalls(flown.aircraft.surfaces)
    wanted = flown.state_rows if whole else rows
    for chunk in fly_batch(flown, plan, constants, state, record_rows=wanted, stop=stop):
        chunks.append(chunk.rows[:, :rows, 0].copy())  # copied: a view would keep the whole states alive
        if whole:  # only the reported rows of the states are kept
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
    angles, hinges, q_joint = plan.angles[at], plan.hinges[at], history[:, JOINTS:]
    below = tips_z(flown, batch, hinges, q_joint[None])[0]
    bending = tip_bending(flown, batch.select(np.zeros(at.size, dtype=np.int64)), q_joint, plan.shape)
    twist = tips_twist(flown, batch, q_joint[None])[0] if "twist" in outputs.parts else None
    reported = np.concatenate(states) if states else np.zeros((0, wanted))
    loads, points = _loads(flown, batch, plan, constants, reported, at, outputs)
    stall = _stall(flown, plan, constants, reported, at) if states else None
    chosen = outputs.shape_rows
    shape = chain_shape(flown, batch, hinges[chosen], q_joint[chosen]) if chosen.size else None
    if plan.halved and model.mirror is not None:  # the other half moved alike
        spread = model.mirror.spread
        angles, below = model.mirror.spread_hinges(angles), spread(below)
        bending = spread(bending)
        twist = None if twist is None else spread(twist)
        loads = None if loads is None else _of_both_halves(loads, model)
        names = [surface.name for surface in model.aircraft.surfaces]
        shape = None if shape is None else of_both_halves(shape, model.mirror, names)
        found = replace(found, q_joint=whole_joints(model, found.q_joint))
    if shape is not None:
        R_NB = rotation_from_quaternion(quaternion[chosen])
        shape = shape.moved(grid.times_s[at][chosen], history[chosen, POSITION:JOINTS], R_NB)
    angles = np.concatenate([angles, control_angles(model.aircraft, schedules, grid.times_s[at])], axis=1)
    record = FlightRecord(
        euler=euler_from_quaternion(quaternion),
        omega_B=history[:, OMEGA:VELOCITY],
        velocity_N=velocity_N,
        position_N=history[:, POSITION:JOINTS],
        wind_N=air_at_reference(model.flight, air, grid.times_s[at]),
        angles=angles,
        tips_z=below,
        trim=found,
        tips_twist=twist,
        loads=loads,
        bending=bending,
        shape=shape,
        point_force=points,
        points=outputs.points,
        stall=stall,
    )
    yield 1.0, record


def _loads(
    model: ChainModel,
    batch: ParameterBatch,
    plan: FlightPlan,
    constants: LaneConstants,
    states: Array,
    at: NDArray[np.int64],
    outputs: Outputs,
) -> tuple[Loads | None, dict[str, Array]]:
    """Accelerations and loads of whole states (k, state_rows) at the rows ``at`` of the grid, and points.

    None and nothing where no loads were requested.
    """
    of_surfaces = "surfaces" in outputs.parts
    if not (of_surfaces or "loads" in outputs.parts):
        return None, {}
    found = chain_loads(model, plan.instants(at), constants, states, every_body=of_surfaces)
    if not of_surfaces:
        return Loads(found.twist_rate_B, found.torque), {}
    q_joint = states[:, JOINTS : JOINTS + model.coordinates]
    surfaces = surface_loads(model, batch, plan.hinges[at], q_joint, found)
    points = point_forces(model, batch, outputs.points, found)
    return Loads(found.twist_rate_B, found.torque, surfaces), points


def _of_both_halves(loads: Loads, model: ChainModel) -> Loads:
    """The whole aircraft's loads from those of one half, when both move alike."""
    mirror = model.mirror
    if mirror is None:
        return loads
    torque, surfaces = loads.hinge_torque, loads.surfaces
    return replace(
        loads,
        hinge_torque=None if torque is None else mirror.spread_hinges(torque),
        surfaces=None if surfaces is None else surfaces.of_both_halves(mirror),
    )


def _stall(
    model: ChainModel, plan: FlightPlan, constants: LaneConstants, states: Array, at: NDArray[np.int64]
) -> StallRecord | None:
    """How near sections came to their limits, in whole states (k, state_rows) at the rows ``at``."""
    rows = closing_half_a_step(model, constants.rows[0])
    return stall_of_flight(model, plan.instants(at), constants, rows, states)
