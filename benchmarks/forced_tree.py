"""The flight that MuJoCo is compared on: the tree of an aircraft without air, wings swung by their hinges.

Fuselage pushed and turned by a constant wrench in its own axes that sets in at once, wings forced by their
inertia, swept by a constant acceleration and stopped by another, so that both programs are given the same
motion exactly, with steps of any length that divides the halves. No gravity: it moves all bodies alike.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from benchmarks.setting import Array, Bench
from morphcore.frames import quaternion_from_euler
from morphcore.models.equivalent import ChainModel, ParameterBatch, chain_model, lane_constants
from morphcore.simulate.batch import fly_batch, initial_state
from morphcore.simulate.plan import FlightPlan, flight_plan
from morphcore.simulate.schedule import HingeMotion
from morphcore.simulate.time_grid import TimeGrid
from morphdata.lattice import Lattice

TREE_LINKS = 4
DURATION_S = 2.0
OUTPUT_S = 0.1  # attitudes are compared at these times; a step divides them
SWEEPS_RAD = (0.6, 0.4)  # right and left wing, reached at the end
# eight g: the wings' own inertia then bends them as hard as the air does in straight flight
FORCE_B = np.array([300.0, -50.0, -80_000.0])  # N
MOMENT_B = np.array([30.0, -200.0, 60.0])  # N m
START_EULER = (0.1, 0.05, -0.2)
START_RATES_B = np.array([0.3, -0.2, 0.2])  # rad/s
START_VELOCITY_B = np.array([40.0, 5.0, 3.0])
# the model has a lattice always; here in no air, so it may be coarser than a document allows
AIRLESS = Lattice.model_construct(chordwise=1, spanwise=1)


@dataclass(frozen=True)
class Swung:
    """A hinge that accelerates evenly for the first half of the flight and decelerates in the second."""

    angle_rad: float

    @property
    def acceleration(self) -> float:
        """In the first half, rad/s^2."""
        return 4.0 * self.angle_rad / DURATION_S**2

    def motion(self, time_s: ArrayLike) -> HingeMotion:
        """The motion."""
        t = np.asarray(time_s, dtype=np.float64)
        a, half, left = self.acceleration, 0.5 * DURATION_S, DURATION_S - t
        first = t < half
        return HingeMotion(
            np.where(first, 0.5 * a * t**2, self.angle_rad - 0.5 * a * left**2),
            np.where(first, a * t, a * left),
            np.where(first, a, -a),
        )


def airless_model(bench: Bench, links: int = TREE_LINKS) -> ChainModel:
    """The reference aircraft's chain in a vacuum."""
    flight = replace(bench.flight, air_density_kg_m3=0.0, gravity_m_s2=0.0)
    return chain_model(bench.aircraft, flight, links, AIRLESS)


def schedules(model: ChainModel) -> list[Swung]:
    """One for each hinge."""
    right, left = SWEEPS_RAD
    return [Swung(left if hinge.drive.endswith("left") else right) for hinge in model.aircraft.hinges]


def plan_in_steps(model: ChainModel, step_s: float) -> FlightPlan:
    """The flight in steps that divide the output times."""
    steps = round(DURATION_S / step_s)
    return flight_plan(model, schedules(model), TimeGrid(0.0, step_s, steps, None))


def start(model: ChainModel, particles: int) -> Array:
    """State rows (p, state_rows), all alike."""
    return np.repeat(
        initial_state(
            quaternion=quaternion_from_euler(*START_EULER)[None],
            omega_B=START_RATES_B[None],
            velocity_B=START_VELOCITY_B[None],
            q_joint=np.zeros((1, model.coordinates)),
            lag_motion=np.zeros((1, model.links, 3)),
        ),
        particles,
        axis=0,
    )


def fly_in_lanes(
    model: ChainModel, batch: ParameterBatch, plan: FlightPlan, state: Array, *, record_rows: int = 4
) -> Array:
    """First rows of the state of all models, (steps + 1, rows, p)."""
    constants = lane_constants(model, batch, plan.grid.step_s)
    constants.set_thrust(*(np.tile(each, (batch.particles, 1)) for each in (FORCE_B, MOMENT_B)))
    chunks = fly_batch(model, plan, constants, state, record_rows=record_rows)
    return np.concatenate([chunk.rows for chunk in chunks])


def at_output_times(rows: Array) -> Array:
    """Quaternions (k, 4, ...) at the output times of a flight recorded in each step."""
    every = round(OUTPUT_S * (rows.shape[0] - 1) / DURATION_S)
    return rows[::every, :4]


def attitude_error(one: Array, other: Array) -> float:
    """Largest angle between attitudes, quaternions (k, 4, ...), rad."""
    # of the difference, not of the scalar product, whose arc cosine has only half the digits
    nearer = np.minimum(np.linalg.norm(one - other, axis=1), np.linalg.norm(one + other, axis=1))
    return float(4.0 * np.arcsin(np.minimum(1.0, 0.5 * nearer)).max())
