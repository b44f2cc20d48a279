"""The longest time step that holds a tolerance on given flights: a model is flown with each and its half."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from morphcore.frames import euler_from_quaternion, wrap_angle
from morphcore.models.equivalent import ChainModel, ParameterBatch, lane_constants, physical_guess
from morphcore.simulate.batch import fly_batch
from morphcore.simulate.plan import FlightPlan, flight_plan, time_grid
from morphcore.simulate.schedule import Schedule
from morphcore.simulate.trim import StartMode, Trim, trim, trimmed_state
from morphcore.stopping import Stop

Array = NDArray[np.float64]

CANDIDATES_S = (0.01, 0.005, 0.0025)
TOLERANCE_RAD = (
    5e-5  # half of what is asked: parameter sets of a search are stiffer and softer than the guess
)
HALVED = 4.0 / 3.0  # of the difference between a step and its half: the error of a step of second order


@dataclass(frozen=True)
class StepChoice:
    """A chosen step.

    step_s : s. error_rad : estimated error of the attitude with it, rad; infinite if the flight diverged.
    holds : whether that is within the tolerance (else the step is the shortest candidate).
    """

    step_s: float
    error_rad: float
    holds: bool


def choose_step(
    model: ChainModel,
    flights: Sequence[tuple[Sequence[Schedule], ArrayLike]],
    batch: ParameterBatch | None = None,
    *,
    start: StartMode = "trim",
    air_velocity_N: Callable[[Array], Array] | None = None,
    candidates_s: Sequence[float] = CANDIDATES_S,
    tolerance_rad: float = TOLERANCE_RAD,
    stop: Stop | None = None,
) -> StepChoice:
    """The longest candidate step whose attitude error is within a tolerance on all flights.

    The error is 4/3 of the largest difference to half the step (Hairer, Norsett & Wanner 1993, section II.4,
    order two). The same arguments give the same step: nothing is timed.

    Parameters
    ----------
    flights : the schedules of all surfaces and the (k,) output times, s, of each flight.
    batch : the one parameter set to fly; None: the physical guess.
    air_velocity_N : wind at some times; it must not depend on which times are asked for together.
    candidates_s : falling, each half of the one before.

    Raises
    ------
    TrimNotFound : the model has no trim. Interrupted : ``stop`` said so.
    """
    batch = physical_guess(model) if batch is None else batch

    def attitude(schedules: Sequence[Schedule], times_s: Array, step_s: float) -> Array:
        plan = flight_plan(model, schedules, time_grid(times_s, step_s), air_velocity_N=air_velocity_N)
        return _attitudes(model, batch, plan, trim(model, batch, plan, start=start).require(), stop)

    steps = [*candidates_s, 0.5 * candidates_s[-1]]
    flown: list[dict[float, Array]] = [{} for _ in flights]
    error = np.inf
    for step_s, half_s in pairwise(steps):
        error = 0.0
        for known, (schedules, times) in zip(flown, flights, strict=True):
            times_s = np.asarray(times, dtype=np.float64)
            for each in (step_s, half_s):
                if each not in known:
                    known[each] = attitude(schedules, times_s, each)
            error = max(error, HALVED * _difference(known[step_s], known[half_s]))
            if not error <= tolerance_rad:
                break  # one flight that asks for less is enough
        if error <= tolerance_rad:
            return StepChoice(step_s, error, holds=True)
    return StepChoice(float(candidates_s[-1]), error, holds=False)


def _attitudes(
    model: ChainModel, batch: ParameterBatch, plan: FlightPlan, found: Trim, stop: Stop | None
) -> Array:
    """Euler angles (steps + 1, 3) at the grid times."""
    constants = lane_constants(model, batch, plan.grid.step_s)
    constants.set_thrust(found.force_B, found.moment_B)
    state = trimmed_state(model, batch, plan, found)
    chunks = [
        chunk.rows[..., 0] for chunk in fly_batch(model, plan, constants, state, record_rows=4, stop=stop)
    ]
    return euler_from_quaternion(np.concatenate(chunks))


def _difference(coarse: Array, fine: Array) -> float:
    """Largest difference of attitudes at the coarse grid's times, rad; infinite where a flight diverged."""
    every = (fine.shape[0] - 1) // (coarse.shape[0] - 1)
    apart = np.abs(wrap_angle(coarse - fine[::every]))
    return float(apart.max()) if np.all(np.isfinite(apart)) else np.inf
