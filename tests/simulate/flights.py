"""Flights to test the simulator with: the sample flights of the examples, and free ones from given states."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from morphcore.frames import euler_from_quaternion
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.models.equivalent import (
    ChainModel,
    ParameterBatch,
    chain_model,
    lane_constants,
    physical_guess,
)
from morphcore.simulate.batch import fly_batch
from morphcore.simulate.flight import Simulation, flight_steps
from morphcore.simulate.plan import FlightPlan, flight_plan
from morphcore.simulate.schedule import ConstantRate, Hold, Schedule, Tabulated
from morphcore.simulate.time_grid import TimeGrid, time_grid
from morphcore.simulate.trajectory import Trajectory, load_trajectory
from morphcore.simulate.trim import StartMode, Trim, trim, trimmed_state
from tests.models.chains import EXAMPLES, example_aircraft, example_flight

Array = NDArray[np.float64]

SAMPLES = ("train_rate_0.2", "train_rate_0.5", "train_rate_0.8", "train_asymmetric")


@dataclass(frozen=True)
class Flown:
    """All states (k, p, rows) at the grid times, and the start."""

    states: Array
    trim: Trim | None

    @property
    def euler(self) -> Array:
        """Roll, pitch, yaw (k, p, 3) in rad."""
        return euler_from_quaternion(self.states[..., :4])


@cache
def example_model(links: int) -> ChainModel:
    """The equivalent model of the examples' aircraft and flight condition."""
    return chain_model(example_aircraft(), example_flight(), links)


@cache
def sample(name: str) -> Trajectory:
    """A sample flight of the examples."""
    return load_trajectory(EXAMPLES / f"{name}.csv")


def sample_schedules(name: str) -> list[Schedule]:
    """The hinge motions of a sample, right and left."""
    flown = sample(name)
    return [Tabulated(flown.time_s, flown.sweep_right), Tabulated(flown.time_s, flown.sweep_left)]


def sample_plan(model: ChainModel, name: str, step_s: float) -> FlightPlan:
    """A plan for the example aircraft along a sample's sweeps that hits its rows."""
    return flight_plan(model, sample_schedules(name), time_grid(sample(name).time_s, step_s))


def fly_trimmed(
    model: ChainModel, plan: FlightPlan, batch: ParameterBatch | None = None, *, start: StartMode = "trim"
) -> Flown:
    """Trim and fly."""
    batch = physical_guess(model) if batch is None else batch
    found = trim(model, batch, plan, start=start).require()
    state = trimmed_state(model, batch, plan, found)
    flown = fly_free(model, plan, batch, state, force_B=found.force_B, moment_B=found.moment_B)
    return Flown(flown.states, found)


def fly_free(
    model: ChainModel,
    plan: FlightPlan,
    batch: ParameterBatch,
    state: Array,
    *,
    force_B: Array | None = None,
    moment_B: Array | None = None,
) -> Flown:
    """Fly from given states (p, rows) under constant forces and moments (p, 3) in B, N and N m."""
    constants = lane_constants(model, batch, plan.grid.step_s)
    none = np.zeros((batch.particles, 3))
    constants.set_thrust(none if force_B is None else force_B, none if moment_B is None else moment_B)
    chunks = [c.rows for c in fly_batch(model, plan, constants, state, record_rows=model.state_rows)]
    return Flown(np.concatenate(chunks).transpose(0, 2, 1), None)


def steps(duration_s: float, step_s: float) -> TimeGrid:
    """A grid of equal steps from zero."""
    return TimeGrid(0.0, step_s, round(duration_s / step_s), None)


def plan_of(model: ChainModel, schedules: Sequence[Schedule], duration_s: float, step_s: float) -> FlightPlan:
    """A plan of equal steps from zero."""
    return flight_plan(model, schedules, steps(duration_s, step_s))


def fly(aircraft: Aircraft, flight: Flight, schedules: Any, **options: Any) -> Simulation:
    """`simulate` for a resolved aircraft and flight, which a test may change beyond a document's limits.

    A list of schedules is of the drives in the aircraft's order.
    """
    if isinstance(schedules, list):
        schedules = dict(zip(aircraft.drives, schedules, strict=True))
    steps = flight_steps(aircraft, flight, schedules, **options)
    return next(step.simulation for step in steps if step.simulation is not None)


def assert_mirrored(aircraft: Aircraft, flight: Flight, kind: str) -> None:
    """A morph of the other side, of an aircraft with two drives, gives the mirrored flight to 1e-9 rad."""
    model: Any = physical_guess(chain_model(aircraft, flight, 3)) if kind == "equivalent" else kind
    morph, still = ConstantRate(0.0, 0.3, 0.6), Hold()
    one, other = (
        fly(aircraft, flight, sides, model=model, duration_s=0.4, output_step_s=0.02).trajectory
        for sides in ([morph, still], [still, morph])
    )
    assert np.abs(one.phi).max() > 1e-3
    for name, sign in (("phi", 1.0), ("theta", -1.0), ("psi", 1.0)):
        assert np.abs(getattr(one, name) + sign * getattr(other, name)).max() < 1e-9, name
