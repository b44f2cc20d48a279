"""Motion of one parameter set of a chain through the air along a plan, the basis of its warnings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.stall import stalls
from morphcore.frames import euler_from_quaternion, rotation_from_quaternion
from morphcore.models.equivalent import ChainModel, LaneConstants
from morphcore.models.kernels.layout import OMEGA, POSITION, VELOCITY
from morphcore.simulate.batch import fly_batch
from morphcore.simulate.plan import FlightPlan
from morphcore.simulate.section_lift import stall_of_flight
from morphcore.simulate.torque import closing_half_a_step
from morphcore.validity import AirMotion, air_motion

Array = NDArray[np.float64]


def chain_motion(model: ChainModel, plan: FlightPlan, constants: LaneConstants, state: Array) -> AirMotion:
    """Motion through the air of the first particle of ``state``, while its flight stays finite.

    ``model`` is the model that the plan flies (`FlightPlan.flown`), as in `fly_batch`.
    """
    stalling = stalls(model.aircraft.surfaces)
    recorded = model.state_rows if stalling else POSITION
    chunks = fly_batch(model, plan, constants, state, record_rows=recorded)
    rows = np.concatenate([chunk.rows[..., 0] for chunk in chunks])
    sound = np.all(np.isfinite(rows), axis=1)
    count = rows.shape[0] if np.all(sound) else max(int(np.argmin(sound)), 1)
    quaternion, velocity_B = rows[:count, :OMEGA], rows[:count, VELOCITY:POSITION]
    velocity_N = np.einsum("kij,kj->ki", rotation_from_quaternion(quaternion), velocity_B)
    motion = air_motion(
        model.aircraft,
        plan.grid.times_s[:count],
        euler_from_quaternion(quaternion),
        velocity_N,
        plan.wind_N[:count],
        plan.angles[:count],
    )
    if not stalling:
        return motion
    held = closing_half_a_step(model, constants.rows[0])
    instants = plan.instants(np.arange(count))
    return replace(motion, stall=stall_of_flight(model, instants, constants, held, rows[:count]))
