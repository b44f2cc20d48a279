"""The longest time step that meets a tolerance on given flights; each candidate and its half are flown."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from morphcore.aero.environment import MovingAir
from morphcore.frames import euler_from_quaternion, wrap_angle
from morphcore.models.equivalent import ChainModel, ParameterBatch, lane_constants, physical_guess
from morphcore.simulate.batch import fly_batch
from morphcore.simulate.plan import FlightPlan, flight_plan
from morphcore.simulate.schedule import Schedule
from morphcore.simulate.time_grid import TimeGrid, time_grid
from morphcore.simulate.trim import StartMode, Trim, trim, trimmed_state
from morphcore.stopping import Stop, check_stop, say

Array = NDArray[np.float64]

CANDIDATES_S = (0.01, 0.005, 0.0025)
TOLERANCE_RAD = (
    5e-5  # half of the requirement: parameter sets of a search are stiffer or softer than the guess
)
LOOKED_AT_S = 60.0  # longest part of a flight: an hour in the finest steps would not fit into memory
HALVED = 4.0 / 3.0  # error of a second-order step relative to the difference between a step and its half


@dataclass(frozen=True)
class StepChoice:
    """A chosen step.

    step_s : s. error_rad : estimated error of the attitude with it, rad; infinite if the flight diverged.
    holds : whether the error is within the tolerance (otherwise the step is the shortest candidate).
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
    air: MovingAir | None = None,
    may_halve: bool = False,
    candidates_s: Sequence[float] = CANDIDATES_S,
    tolerance_rad: float = TOLERANCE_RAD,
    stop: Stop | None = None,
) -> StepChoice:
    """Return the longest candidate step whose attitude error is within a tolerance on all flights.

    The error is 4/3 of the largest difference from the flight with half the step (Hairer, Norsett & Wanner
    1993, section II.4, order two). The choice is deterministic: nothing is timed.

    Parameters
    ----------
    flights : for each flight, the schedules of all hinges and the (k,) output times, s.
    batch : the parameter set to fly, only one; None: the physical guess.
    air : gust and turbulence of the flights.
    may_halve : as in ``flight_plan``; the parameter set must then be the same on both sides.
    candidates_s : in descending order, each half of the previous one.

    Raises
    ------
    TrimNotFound : the model has no trim. Interrupted : ``stop`` returned True.
    """
    batch = physical_guess(model) if batch is None else batch

    def plan(schedules: Sequence[Schedule], grid: TimeGrid) -> FlightPlan:
        check_stop(stop)
        return flight_plan(model, schedules, grid, air=air, may_halve=may_halve, start=start)

    tried = [
        _Tried(model, batch, schedules, np.asarray(times, dtype=np.float64), candidates_s, start, plan, stop)
        for schedules, times in flights
    ]
    error = np.inf
    for step_s in candidates_s:
        error = 0.0
        for number, flight in enumerate(tried, start=1):
            say(f"choosing the time step: {1e3 * step_s:g} ms, flight {number} of {len(tried)}")
            error = max(error, flight.error(step_s))
            if not error <= tolerance_rad:
                break  # one flight that needs a shorter step is enough
        if error <= tolerance_rad:
            return StepChoice(step_s, error, holds=True)
    return StepChoice(float(candidates_s[-1]), error, holds=False)


def busiest_part(schedules: Sequence[Schedule], times_s: ArrayLike, longest_s: float = LOOKED_AT_S) -> Array:
    """The output times that `choose_step` should use: for a long flight, those around its fastest morph.

    Parameters
    ----------
    schedules : of the hinges. times_s : (k,), evenly spaced. longest_s : longest duration of the part, s.
    """
    times = np.asarray(times_s, dtype=np.float64)
    rows = max(int(longest_s / (times[1] - times[0]) + 1e-9), 2)
    if times.size <= rows + 1:
        return times
    rates = [np.abs(schedule.motion(times).rate) for schedule in schedules]
    fastest = int(np.max(rates, axis=0).argmax()) if rates else 0
    first = min(max(fastest - rows // 2, 0), times.size - rows - 1)
    return times[first : first + rows + 1]


@dataclass
class _Tried:
    """One flight with several steps, whose lattice is tabulated once and whose trim is found once."""

    model: ChainModel
    batch: ParameterBatch
    schedules: Sequence[Schedule]
    times_s: Array
    candidates_s: Sequence[float]
    start: StartMode
    plan: Callable[[Sequence[Schedule], TimeGrid], FlightPlan]
    stop: Stop | None
    known: dict[int, Array] = field(default_factory=dict)

    def error(self, step_s: float) -> float:
        """Estimated error of the attitude with a step, rad."""
        grid = time_grid(self.times_s, step_s)
        return HALVED * _difference(self._attitudes(grid), self._attitudes(grid.halved()))

    @cached_property
    def finest(self) -> FlightPlan:
        grid = time_grid(self.times_s, self.candidates_s[0])
        return self.plan(self.schedules, grid.halved(len(self.candidates_s)))

    @cached_property
    def trimmed(self) -> Trim:
        return trim(self.finest.flown(self.model), self.batch, self.finest, start=self.start).require(
            self.model.flight
        )

    def _attitudes(self, grid: TimeGrid) -> Array:
        """Euler angles (steps + 1, 3) at the grid times."""
        if grid.steps not in self.known:
            halvings, rest = divmod(self.finest.grid.steps, grid.steps)
            # no candidate divides the spacing of the rows evenly: the grids are not halves of each other
            nested = rest == 0 and halvings.bit_count() == 1
            plan = self.finest.coarser(grid) if nested else self.plan(self.schedules, grid)
            self.known[grid.steps] = _attitudes(self.model, self.batch, plan, self.trimmed, self.stop)
        return self.known[grid.steps]


def _attitudes(
    model: ChainModel, batch: ParameterBatch, plan: FlightPlan, found: Trim, stop: Stop | None
) -> Array:
    """Euler angles (steps + 1, 3) at the grid times."""
    flown = plan.flown(model)
    constants = lane_constants(flown, batch, plan.grid.step_s)
    constants.set_thrust(*found.acting_B)
    state = trimmed_state(flown, batch, plan, found)
    chunks = [
        chunk.rows[..., 0] for chunk in fly_batch(flown, plan, constants, state, record_rows=4, stop=stop)
    ]
    return euler_from_quaternion(np.concatenate(chunks))


def _difference(coarse: Array, fine: Array) -> float:
    """Largest difference of attitudes at the coarse grid's times, rad; infinite if a flight diverged."""
    every = (fine.shape[0] - 1) // (coarse.shape[0] - 1)
    apart = np.abs(wrap_angle(coarse - fine[::every]))
    return float(apart.max()) if np.all(np.isfinite(apart)) else np.inf
