"""Identification as an iterator of steps: one generation of the search each, with its complete state."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from morphcore.errors import InvalidInput
from morphcore.evolution import Evolution, EvolutionState, first_evolution
from morphcore.frames import wrap_angle
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.identify.cost import SampleCase, costs, longest_step, residuals, sample_cases
from morphcore.identify.generation import GenerationTask
from morphcore.identify.parameters import SearchSpace, search_space
from morphcore.identify.polish import first_polish, next_polish
from morphcore.identify.result import IdentifyResult, identify_result
from morphcore.identify.settings import SearchSettings
from morphcore.identify.sought import corrections_told
from morphcore.identify.state import Phase, SearchState, decode, encode
from morphcore.models.equivalent import ChainModel, chain_model
from morphcore.simulate.compilation import compile_flights
from morphcore.simulate.plan import STEP_S
from morphcore.simulate.trajectory import Trajectory, require_flight
from morphcore.steps import Step
from morphcore.stopping import Deadline, Interrupted, Stop, say
from morphcore.swarm import SwarmState, first_swarm, next_swarm
from morphcore.threads import one_blas_thread
from morphdata.faults import refuse
from morphdata.identify import EquivalentModel, samples_faults

Array = NDArray[np.float64]
Clock = Callable[[], float]

SCREEN_SPREAD = 0.5  # standard deviation of the candidates around the physical guess, in search coordinates
# A weak prior on the polish: being off the physical guess by one unit costs as much as one error of this
# size. It settles the directions that the samples cannot see and is far below what they can.
PRIOR_RAD = 3e-5
# hopeless starts are dropped as the polish goes on: iterations -> starts kept (as a share of the first field)
NARROWING = ((3, 1.0), (6, 0.5))
# phases in which a generation of costs is asked for and told
ASKED: tuple[Phase, ...] = ("swarm", "evolution")
FOLLOWING: dict[str, Phase] = {
    "pso": "swarm",
    "cma": "evolution",
    "hybrid": "polish",
    "least_squares": "polish",
}
# "hybrid" looks elsewhere where the descent from the physical guess leaves errors above 1 % of the motion
# (rms, so squared here): it may have ended in a wrong valley. Where it does not, a screen and three times the
# flights lowered J by five per cent at most (docs/performance_search.md).
GOOD_FIT = 1e-4


class Identification:
    """The search for the parameters of an equivalent model from sample flights.

    Raises
    ------
    InvalidInput : no sample to train on, two samples of one name, or a setting that makes no sense.
    """

    def __init__(
        self,
        aircraft: Aircraft,
        flight: Flight,
        samples: Sequence[Trajectory],
        model: EquivalentModel | None = None,
        search: SearchSettings | None = None,
        *,
        clock: Clock = time.perf_counter,
    ) -> None:
        self.settings = model or EquivalentModel()
        self.search = search or SearchSettings()
        self.samples = tuple(samples)
        self._clock = clock
        self._step_s = self.settings.step_s
        refuse(samples_faults(samples))
        for number, sample in enumerate(samples):
            require_flight(sample, f"/samples/{number}")
        if self.settings.start == "given" and flight.start is None:
            raise InvalidInput(
                "the flight has no start", pointer="/flight/start", hint="add it, or choose start = trim"
            )
        self.model = self.chain(aircraft, flight, self.settings.links_per_wing)
        sought: Sequence[str] | None = self.settings.aero_coefficients
        if sought is None:
            training = [sample for sample in samples if sample.role == "train"]
            sought = corrections_told(self.model.parameters, training)
        self.space: SearchSpace = search_space(
            self.model,
            separate_wings=self.settings.separate_wings,
            aero_coefficients=sought,
            bounds=None if self.settings.bounds is None else self.settings.bounds.given(),
        )
        warm_start = self.search.warm_start
        # (k, d) what is known before the search: the model to begin from, and always the physical guess
        self.known: Array = np.stack(
            [*([] if warm_start is None else [self.space.encode(warm_start)]), self.space.guess]
        )

    def chain(self, aircraft: Aircraft, flight: Flight, links: int) -> ChainModel:
        """A chain model with the lattice that the settings ask for."""
        return chain_model(aircraft, flight, links, self.settings.lattice)

    @property
    def step_s(self) -> float:
        """The time step of all flights, s: the one asked for, or chosen from the samples to fit."""
        return self._chosen_step()

    def _chosen_step(self, stop: Stop | None = None) -> float:
        """Choose the step if none is given: from the inputs alone, so that a resumed search has the same."""
        if self._step_s is None:
            with one_blas_thread():
                self._step_s = longest_step(
                    self.model,
                    self.space.decode(self.space.guess),
                    [sample for sample in self.samples if sample.role == "train"],
                    self.settings.start,
                    stop,
                    separate_wings=self.settings.separate_wings,
                )
        return self._step_s

    @cached_property
    def cases(self) -> tuple[SampleCase, ...]:
        """All samples with their plans."""
        return sample_cases(
            self.model,
            self.samples,
            self.step_s,
            separate_wings=self.settings.separate_wings,
        )

    @cached_property
    def training(self) -> tuple[SampleCase, ...]:
        """The samples to fit."""
        return tuple(case for case in self.cases if case.sample.role == "train")

    def steps(self, checkpoint: bytes | None = None, stop: Stop | None = None) -> Iterator[Step]:
        """Search, one step after the other.

        Parameters
        ----------
        checkpoint : of an earlier step; None starts anew.
        stop : asked between chunks of well under a second; True raises Interrupted.
        """
        state = self._state(checkpoint) if checkpoint is not None else None
        while state is None or state.phase != "done":
            begin = self._clock()
            with one_blas_thread():
                state = self._first(stop) if state is None else self._within_time(state, stop)
            state = self._timed(state, self._clock() - begin)
            yield self._step(state)

    def result(self, checkpoint: bytes) -> IdentifyResult:
        """The identified model at any step, with its fit, uncertainty and cost.

        Raises
        ------
        NotFlyable : the best model does not fly the samples that it was fitted to.
        """
        return self.judged(checkpoint).require_flown()

    def judged(self, checkpoint: bytes) -> IdentifyResult:
        """The same whether its model flies or not; one that does not has no model in its document."""
        say("judging what was found")
        with one_blas_thread():
            return identify_result(self, self._state(checkpoint))

    def best_so_far(self, checkpoint: bytes) -> IdentifyResult:
        """Give the result without uncertainty and timing, fast: someone waits for a cancelled search.

        Where nothing has flown yet it holds no model, and a warning says so.
        """
        with one_blas_thread():
            return identify_result(self, self._state(checkpoint), judged=False)

    # a generation asked for and told, so that others may fly it

    def generation_task(self, checkpoint: bytes) -> GenerationTask | None:
        """What the step after a checkpoint flies; None where that step is no generation of costs."""
        state = decode(checkpoint)
        return self._task(state) if state.phase in ASKED else None

    def task_costs(self, points: Array, stop: Stop | None = None) -> Array:
        """Costs (p,) of search points (p, d), rad^2: of any part of a task, whoever flies the rest."""
        with one_blas_thread():
            return self._costs(points, stop)

    def told(self, checkpoint: bytes, cost: Array, *, wall_s: float = 0.0) -> Step:
        """The step after a checkpoint, given the costs (p,) of its task: the step that ``steps`` gives.

        ``wall_s`` : what the flights took, s.

        Raises
        ------
        ValueError : there is no such task, or it has another number of points.
        """
        state = self._state(checkpoint)
        if state.phase not in ASKED or cost.shape != self._task(state).points.shape[:1]:
            raise ValueError(f"costs {cost.shape} do not answer the task after {state.phase}")
        with one_blas_thread():
            return self._step(self._timed(self._moved(state, cost), wall_s))

    def _state(self, checkpoint: bytes) -> SearchState:
        """The state in a checkpoint, whose flights are flown in the steps that it was begun with."""
        state = decode(checkpoint)
        self._step_s = state.step_s if self._step_s is None else self._step_s
        return state

    # one step each

    def _first(self, stop: Stop | None) -> SearchState:
        """Choose the step, in the search's time, and fly what is known, which always is flown."""
        compile_flights()
        deadline = Deadline(self.search.max_seconds, stop)
        try:
            self._chosen_step(deadline)
        except Interrupted:
            if not deadline.passed:
                raise
            self._step_s = STEP_S
        say("flying the first guess")
        return self._baseline(stop)

    def _within_time(self, state: SearchState, stop: Stop | None) -> SearchState:
        """The next state; where the time is up before it is reached, the search ends with this one."""
        budget_s = self.search.max_seconds
        deadline = Deadline(None if budget_s is None else budget_s - state.wall_s, stop)
        try:
            return self._advance(state, deadline)
        except Interrupted:
            if not deadline.passed:
                raise
            return replace(state, phase="done")

    def _baseline(self, stop: Stop | None) -> SearchState:
        """Fly what is known before: from here on there is a best so far."""
        cost = self._costs(self.known, stop)
        phase = FOLLOWING[self.search.method] if self.space.dimension else "done"
        best = int(np.argmin(cost))
        state = SearchState(
            phase,
            self.known[best],
            float(cost[best]),
            flights=cost.size * len(self.training),
            polish=first_polish(self.known, cost) if phase == "polish" else None,
            step_s=self._step_s,
        )
        return _recorded(state, "baseline", 0)

    def _advance(self, state: SearchState, stop: Stop | None) -> SearchState:
        step = {"screen": self._screen, "polish": self._polish}.get(state.phase, self._generation)
        return step(state, stop)

    @cached_property
    def _good(self) -> float:
        """J with which a descent has ended well, rad^2: a share of the motion in the samples."""
        return GOOD_FIT * sum(
            float(np.sum((case.weight * wrap_angle(case.sample.euler - case.sample.euler[0])) ** 2))
            for case in self.training
        )

    def _screen(self, state: SearchState, stop: Stop | None) -> SearchState:
        """Fly candidates around what is known and choose the polish's starts among them."""
        spread = SCREEN_SPREAD * _even_normals(self.search.screen, self.space.dimension, self.search.seed)
        points = np.clip(self.known[0] + spread, self.space.lower, self.space.upper)
        cost = self._costs(points, stop)
        chosen = np.argsort(cost, kind="stable")[: self.search.starts]
        better = cost[chosen[0]] < state.best_cost
        found = replace(
            state,
            phase="polish",
            best=points[chosen[0]] if better else state.best,
            best_cost=float(cost[chosen[0]]) if better else state.best_cost,
            generation=state.generation + 1,
            flights=state.flights + cost.size * len(self.training),
            polish=first_polish(points[chosen], cost[chosen]),
            screened=True,
        )
        return _recorded(found, "screen", cost.size)

    def _polish(self, state: SearchState, stop: Stop | None) -> SearchState:
        """One Levenberg-Marquardt iteration of all starts still in the field."""
        before = state.polish or first_polish(state.best[None, :], np.array([state.best_cost]))
        share = next((share for limit, share in NARROWING if before.iteration < limit), 0.0)
        keep = max(1, round(share * before.cost.size))
        flown = 0

        def errors(points: Array) -> Array:
            nonlocal flown
            flown += points.shape[0]
            prior = PRIOR_RAD * (points - self.space.guess)
            return np.concatenate([self._residuals(points, stop), prior], axis=1)

        after = next_polish(before, self.space.lower, self.space.upper, errors, keep)
        if after is before:  # none of the starts kept moves any more
            return replace(state, phase=self._after_descent(state))
        point = after.point[after.best]
        cost = float(after.cost[after.best] - PRIOR_RAD**2 * np.sum((point - self.space.guess) ** 2))
        better = cost < state.best_cost
        over = after.iteration >= self.search.iterations or not np.any(after.active)
        moved = replace(
            state,
            best=point if better else state.best,
            best_cost=cost if better else state.best_cost,
            generation=state.generation + 1,
            flights=state.flights + flown * len(self.training),
            polish=after,
        )
        if over:
            moved = replace(moved, phase=self._after_descent(moved))
        return _recorded(moved, "polish", flown)

    def _after_descent(self, state: SearchState) -> Phase:
        looks = self.search.method == "hybrid" and not state.screened
        return "screen" if looks and state.best_cost > self._good else "done"

    def _generation(self, state: SearchState, stop: Stop | None) -> SearchState:
        """Fly one generation and move it."""
        return self._moved(state, self._costs(self._task(state).points, stop))

    def _swarm(self, state: SearchState) -> SwarmState:
        width = self.space.upper - self.space.lower
        known = (self.known - self.space.lower) / width
        return state.swarm or first_swarm(self.search.swarm, known, self.search.seed)

    @cached_property
    def _evolution(self) -> Evolution:
        width = self.space.upper - self.space.lower
        return Evolution(self.search.evolution, (self.known[0] - self.space.lower) / width, self.search.seed)

    def _evolved(self, state: SearchState) -> EvolutionState:
        return state.evolution or first_evolution(self.search.evolution)

    def _task(self, state: SearchState) -> GenerationTask:
        """The points of the next generation: of the swarm, or of the evolution strategy."""
        space = self.space
        if state.phase == "swarm":
            swarm = self._swarm(state)
            generation, unit = swarm.generation, swarm.position
        else:
            evolved = self._evolved(state)
            generation, unit = evolved.generation, self._evolution.points(evolved)
        return GenerationTask(generation, space.lower + (space.upper - space.lower) * unit)

    def _moved(self, state: SearchState, cost: Array) -> SearchState:
        """Move the swarm or the evolution strategy, given the costs of its present points."""
        points = self._task(state).points
        least = int(np.argmin(cost))
        better = cost[least] < state.best_cost
        found = replace(
            state,
            best=points[least] if better else state.best,
            best_cost=min(float(cost[least]), state.best_cost),
            generation=state.generation + 1,
            flights=state.flights + cost.size * len(self.training),
        )
        if state.phase == "swarm":
            moved = next_swarm(self._swarm(state), self.search.swarm, cost)
            over = moved.generation >= self.search.swarm.generations
            found = replace(found, swarm=moved)
        else:
            evolved = self._evolution.moved(self._evolved(state), cost)
            over = evolved.generation >= self.search.evolution.generations
            over = over or self._evolution.converged(evolved)
            found = replace(found, evolution=evolved)
        row = _recorded(found, state.phase, cost.size, mean_cost=float(cost.mean()))
        return replace(row, phase="done") if over else row

    def _timed(self, state: SearchState, elapsed_s: float) -> SearchState:
        """Count the time of a step; when the search has used up its own, that step is the last."""
        state = replace(state, wall_s=state.wall_s + elapsed_s)
        over = self.search.max_seconds is not None and state.wall_s >= self.search.max_seconds
        return replace(state, phase="done") if over else state

    # flights

    def _costs(self, points: Array, stop: Stop | None) -> Array:
        return costs(self.model, self.space.decode(points), self.training, self.settings.start, stop)

    def _residuals(self, points: Array, stop: Stop | None) -> Array:
        return residuals(self.model, self.space.decode(points), self.training, self.settings.start, stop)

    # reports

    def _step(self, state: SearchState) -> Step:
        last = state.history[-1]
        total = {
            "pso": self.search.swarm.generations,
            "cma": self.search.evolution.generations,
            "least_squares": 1 + self.search.iterations,
            "hybrid": 2 + 2 * self.search.iterations,
        }[self.search.method]
        fraction = 1.0 if state.phase == "done" else min(state.generation / total, 0.99)
        return Step(
            phase=str(last["phase"]),
            generation=state.generation,
            fraction=fraction,
            best_cost=state.best_cost,
            flights=state.flights,
            message=f"{last['phase']}: J = {state.best_cost:.3g} rad^2 after {state.flights} flights",
            checkpoint=encode(state),
        )


def _even_normals(count: int, d: int, seed: int) -> Array:
    """(count, d) normal numbers spread more evenly than independent draws: a scrambled Sobol sequence."""
    from scipy.stats import qmc  # as large as half of the library, and many searches need no screen

    draws = qmc.MultivariateNormalQMC(np.zeros(d), rng=np.random.default_rng(seed))
    return np.asarray(draws.random(1 << max(count - 1, 0).bit_length())[:count])


def _recorded(state: SearchState, phase: str, particles: int, **more: float) -> SearchState:
    row = {
        "generation": state.generation,
        "phase": phase,
        "particles": particles,
        "flights": state.flights,
        "best_cost": state.best_cost,
        **more,
    }
    return replace(state, history=(*state.history, row))
