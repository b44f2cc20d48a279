"""The optimisation of a morph as an iterator of steps, each with its complete state.

Searches come first: with the equivalent model for every duration that the goal asks for, then with the rigid
model for the one that was chosen. Then the flexible model flies the constant rate and both optima.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from morphcore.errors import FlightDiverged, InvalidInput, NotFlyable, TrimNotFound
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.geometry.obstacle import Obstacle, naming_obstacles
from morphcore.models.equivalent import ChainModel, ParameterBatch, chain_model, fitted, physical_guess
from morphcore.models.soft_joints import chain_obstacle, soft_joint
from morphcore.optimise.feasible import constant_rate, morph_space, require_schedules, rounded_up
from morphcore.optimise.flights import SAMPLE_S, MorphFlights, sample_times
from morphcore.optimise.goals import (
    Found,
    ModelName,
    Task,
    chosen,
    durations,
    next_task,
    warm_starts,
)
from morphcore.optimise.limits import MorphSpace
from morphcore.optimise.progress import Told, best_cost, effort, shown_cost
from morphcore.optimise.result import ScheduleResult, schedule_result
from morphcore.optimise.search import SearchRun, SearchState
from morphcore.optimise.settings import ScheduleSettings
from morphcore.optimise.state import OptimisationState, Verified, decode, encode
from morphcore.simulate.flight import flight_steps
from morphcore.simulate.plan import STEP_S, CommonPath, common_path
from morphcore.simulate.schedule import Schedule
from morphcore.simulate.step_choice import busiest_part, choose_step
from morphcore.simulate.trim import StartMode
from morphcore.steps import Step
from morphcore.stopping import Deadline, Interrupted, Stop, say
from morphcore.threads import one_blas_thread
from morphcore.validity import documents
from morphdata.faults import refuse
from morphdata.lattice import DEFAULT_LATTICE, Lattice
from morphdata.optimize import Limits, Morph, Verify, VerifyingModel, Weights, goal_faults

Array = NDArray[np.float64]
Clock = Callable[[], float]

SHOWN_SHARE = 0.02  # of a flexible flight: how often its progress is told
# longer durations that are tried where the torque limit is too tight
LONGER = (1.1, 1.2, 1.35, 1.5, 1.75, 2.0, 2.5, 3.0, 4.0)


class ScheduleOptimisation:
    """The search for the morph that disturbs the attitude least, within the drive's limits.

    Parameters
    ----------
    model : one parameter set of the equivalent model. verify : fly the result in the flexible model, or not.
    flexible : that model. lattice, start, step_s : how the rigid and the equivalent model fly. None as the
        longest step: the longest with which both fly the constant rate as exactly as `choose_step` demands.

    Raises
    ------
    InvalidInput : no schedule keeps the limits, or a setting makes no sense.
    """

    def __init__(  # noqa: PLR0913 - what is asked for has as many sides
        self,
        aircraft: Aircraft,
        flight: Flight,
        model: ParameterBatch,
        *,
        morph: Morph,
        limits: Limits | None = None,
        weights: Weights | None = None,
        search: ScheduleSettings | None = None,
        verify: Verify = "flexible",
        flexible: VerifyingModel | None = None,
        lattice: Lattice = DEFAULT_LATTICE,
        start: StartMode = "trim",
        step_s: float | None = None,
        clock: Clock = time.perf_counter,
    ) -> None:
        self.aircraft, self.flight, self.parameters = aircraft, flight, model
        self.morph, self.limits, self.weights = morph, limits or Limits(), weights or Weights()
        self.search, self.verify = search or ScheduleSettings(), verify
        self.flexible = flexible or VerifyingModel()
        self.lattice, self.start, self._step_s = lattice, start, step_s
        self._clock = clock
        if model.particles != 1:
            raise InvalidInput(
                f"{model.particles} parameter sets to optimise with",
                pointer="/model/parameters",
                hint="choose one with ParameterBatch.select",
            )
        if self.start == "given" and flight.start is None:
            raise InvalidInput(
                "the flight has no start", pointer="/flight/start", hint="add it, or choose start = trim"
            )
        refuse(goal_faults(morph, self.limits))
        with one_blas_thread():
            longest = self.space(morph.duration_s)
            require_schedules(longest)
            self.durations = durations(morph, longest.quickest[0])
        self.effort = effort(morph, self.durations.size, self.search, flexible=verify == "flexible")
        self._runs: dict[Task, SearchRun] = {}

    # what flies

    def space(self, duration_s: float) -> MorphSpace:
        """The unknowns and limits for one duration."""
        return morph_space(self.aircraft, self.morph, self.limits, duration_s)

    @cached_property
    def path(self) -> CommonPath:
        """The lattice over all angles that a schedule may reach; all models and durations share it."""
        space, morph = self.space(self.morph.duration_s), self.morph
        low, high = (0.0, 1.0) if self.limits.monotonic else (space.low, space.high)
        ends = sorted(morph.initial_rad + morph.change_rad * share for share in (low, high))
        return common_path(self.chain("rigid")[0], *ends, may_halve=self.is_even)

    @cached_property
    def is_even(self) -> bool:
        """Whether both sides have the same parameters, so that half the aircraft can stand for it."""
        model, batch = self.chain("equivalent")
        return model.is_even(batch)

    @property
    def step_s(self) -> float:
        """The longest step, s, of the rigid and the equivalent model: asked for, or chosen."""
        return self._chosen_step()

    def _chosen_step(self, stop: Stop | None = None) -> float:
        if self._step_s is None:
            self._step_s = self._found_step(stop)
        return self._step_s

    def _found_step(self, stop: Stop | None) -> float:
        constant = self.constant(self.morph.duration_s)
        flight = [constant] * len(self.aircraft.surfaces), busiest_part([constant], self.times_s)
        chains = [self.chain(name) for name in ("rigid", "equivalent")]
        steps_s = []
        for model, batch in chains:
            with naming_obstacles(partial(chain_obstacle, model, batch)):
                found = choose_step(
                    model, [flight], batch, start=self.start, may_halve=self.is_even, stop=stop
                )
            steps_s.append(found.step_s)
        return min(steps_s)

    def chain(self, name: ModelName) -> tuple[ChainModel, ParameterBatch]:
        """One of the models that are searched with, and its parameters."""
        if name == "equivalent":
            links = self.parameters.links
            model = chain_model(self.aircraft, self.flight, links, self.lattice)
            return model, fitted(model, self.parameters)
        rigid = chain_model(self.aircraft, self.flight, 1, self.lattice)
        return rigid, physical_guess(rigid)

    @property
    def times_s(self) -> Array:
        """Times of the rows that count: from the begin of the morph to the end of the longest one's window.

        Whatever its duration, every morph is judged over the same time, or a quick one would look calm
        because its window ends sooner.
        """
        return sample_times(self.morph.duration_s, self.morph.settle_s)

    def flights(self, name: ModelName) -> MorphFlights:
        """Flights over the window that morphs of all durations share."""
        model, batch = self.chain(name)
        return MorphFlights(
            model,
            batch,
            self.path,
            self.times_s,
            initial_rad=self.morph.initial_rad,
            start=self.start,
            step_s=self.step_s,
        )

    def constant(self, duration_s: float) -> Schedule:
        """The constant rate that the optimum is compared with."""
        return constant_rate(self.morph, self.limits, duration_s)

    def compared(self, state: OptimisationState) -> dict[str, Schedule | None]:
        """The schedules that are compared, in their order; None for what has not been found."""
        best = self.best(state)
        space = self.space(best.duration_s)
        rigid = next((item for item in state.found if item.model == "rigid"), None)
        return {
            "constant": self.constant(best.duration_s),
            "rigid_optimum": None if rigid is None or not rigid.feasible else space.schedule(rigid.point),
            "optimum": space.schedule(best.point),
        }

    def best(self, state: OptimisationState) -> Found:
        """The search whose schedule is the result, or its best so far."""
        found = state.found
        if state.task is not None and state.task.model == "equivalent" and state.search is not None:
            found = (*found, self._found(state, variation=False))
        return chosen(self.morph, found)

    # the iterator

    def steps(self, checkpoint: bytes | None = None, stop: Stop | None = None) -> Iterator[Step]:
        """Work, one step after the other.

        Parameters
        ----------
        checkpoint : of an earlier step; None starts anew. The result is the same to the bit, but for times.
        stop : asked several times a second; True raises Interrupted.
        """
        state = OptimisationState("search") if checkpoint is None else self._state(checkpoint)
        while state.phase != "done":
            begin, before = self._clock(), state
            # a step of a search is one state; a flight of the flexible model tells its progress in many
            advance = self._searched if state.phase == "search" else self._verified
            for after, told in advance(before, stop):
                used = self._clock() - begin
                state = replace(after, wall_s=before.wall_s + used)
                if before.phase == "search":
                    state = replace(state, search_s=before.search_s + used)
                yield self._step(state, told)

    def result(self, checkpoint: bytes) -> ScheduleResult:
        """The schedule at any step, flown in the rigid and the equivalent model beside the others.

        Raises
        ------
        NotFlyable : the equivalent model does not fly the best schedule to its end.
        """
        say("judging what was found")
        with one_blas_thread():
            found = schedule_result(self, self._state(checkpoint))
        if found.lost:
            raise self.not_flyable()
        return found

    def best_so_far(self, checkpoint: bytes) -> ScheduleResult:
        """Give the result without torques: someone waits for a cancelled run.

        Where the best does not fly it holds no schedule, and a warning says so.
        """
        with one_blas_thread():
            return schedule_result(self, self._state(checkpoint), judged=False)

    def _state(self, checkpoint: bytes) -> OptimisationState:
        """The state in a checkpoint, whose flights are flown in the steps that it was begun with."""
        state = decode(checkpoint)
        self._step_s = state.step_s if self._step_s is None else self._step_s
        return state

    # one step each

    def _prepared(self, state: OptimisationState, stop: Stop | None) -> OptimisationState:
        """The state with its step, chosen in the time of the searches, and with the search that comes."""
        budget_s = self.search.max_seconds
        deadline = Deadline(None if budget_s is None else budget_s - state.search_s, stop)
        try:
            self._chosen_step(deadline)
        except Interrupted:
            if not deadline.passed:
                raise
            self._step_s = STEP_S
        say("flying the first schedules")
        return self._begun(replace(state, step_s=self._step_s))

    def _advanced(
        self, task: Task, search: SearchState, stop: Stop | None
    ) -> tuple[SearchState, dict[str, Any]]:
        """The next state of a search; where its time is up before, and a schedule is known, it ends."""
        left_s = search.budget_s - search.wall_s if search.feasible and search.budget_s is not None else None
        deadline = Deadline(left_s, stop)
        try:
            return self._run(task).advance(search, deadline)
        except Interrupted:
            if not deadline.passed:
                raise
            return replace(search, phase="done"), {"phase": search.phase, "particles": 0}

    def _searched(
        self, state: OptimisationState, stop: Stop | None
    ) -> Iterator[tuple[OptimisationState, Told]]:
        """One step of the search that runs, with what follows when it is over."""
        with one_blas_thread():
            if state.task is None:
                state = self._prepared(state, stop)
            task, search = state.task, state.search
            assert task is not None and search is not None  # noqa: S101, PT018 - the phase says so
            begin = self._clock()
            moved, row = self._advanced(task, search, stop)
            moved = replace(moved, wall_s=search.wall_s + self._clock() - begin)
            if moved.feasible and moved.budget_s is not None and moved.wall_s >= moved.budget_s:
                moved = replace(moved, phase="done")
            state = replace(
                state,
                search=moved,
                generation=state.generation + 1,
                flights=state.flights + moved.flights - search.flights,
            )
            row = {
                "generation": state.generation,
                **row,
                "model": task.model,
                "duration_s": task.duration_s,
                "flights": state.flights,
                "best_cost": moved.best_cost if moved.feasible else None,
            }
            state = replace(state, history=(*state.history, row))
            told = Told(
                row["phase"],
                f"{task.model} model, {task.duration_s:.4g} s: J = {shown_cost(moved):.4g} rad^2",
            )
            if moved.phase == "done":
                state = self._ended(state, stop)
        yield state, told

    def _begun(self, state: OptimisationState) -> OptimisationState:
        """The state with the search that comes next; without any, with the phase that follows."""
        task = next_task(self.morph, self.durations, state.found)
        if task is None:
            return replace(
                state, phase="verify" if self.verify == "flexible" else "done", task=None, search=None
            )
        space = self.space(task.duration_s)
        # the rigid model's search is as free as the equivalent one's first
        warm = warm_starts(space, state.found if task.model == "equivalent" else ())
        return replace(state, task=task, search=self._run(task).begin(warm, self._budget(state)))

    def _ended(self, state: OptimisationState, stop: Stop | None) -> OptimisationState:
        """After a search: what it found, and what comes next."""
        found = self._found(state, variation=True)
        if not found.feasible and found.model == "equivalent" and found.duration_s == self.durations[-1]:
            raise self.not_flyable() if found.diverged else self._too_much_torque(found, stop)
        flown = state.flights + int(found.feasible)
        return self._begun(replace(state, found=(*state.found, found), task=None, search=None, flights=flown))

    def _verified(
        self, state: OptimisationState, stop: Stop | None
    ) -> Iterator[tuple[OptimisationState, Told]]:
        """The next schedule's flight in the flexible model, with its progress."""
        waiting = {name: schedule for name, schedule in self.compared(state).items() if schedule is not None}
        name = list(waiting)[len(state.verified)]
        begin, shown, flexible = self._clock(), 0.0, self.flexible
        end_s = float(self.times_s[-1])
        euler, failure = np.zeros((0, 3)), ""
        warnings: tuple[dict[str, Any], ...] = ()
        try:
            with one_blas_thread():
                for step in flight_steps(
                    self.aircraft,
                    self.flight,
                    dict.fromkeys(("left", "right"), waiting[name]),
                    model="flexible",
                    duration_s=end_s,
                    output_step_s=SAMPLE_S,
                    start=self.start,
                    lattice=flexible.lattice or self.lattice,
                    elements=flexible.elements,
                    stop=stop,
                ):
                    if step.simulation is not None:
                        euler = step.simulation.trajectory.euler
                        warnings = tuple(documents(step.simulation.warnings))
                    elif step.fraction >= shown + SHOWN_SHARE:
                        shown = step.fraction
                        yield state, Told("verify", f"flexible model: {name.replace('_', ' ')}", shown)
        except (FlightDiverged, TrimNotFound) as error:
            failure = str(error)
        done = (*state.verified, Verified(name, euler, self._clock() - begin, failure, warnings))
        over = len(done) == len(waiting)
        yield (
            replace(state, verified=done, phase="done" if over else "verify"),
            Told("verify", f"flexible model: {name.replace('_', ' ')} {'failed' if failure else 'flown'}"),
        )

    # pieces

    def _run(self, task: Task) -> SearchRun:
        if task not in self._runs:
            self._runs.clear()  # one at a time: each holds a window's constants
            flights = self.flights(task.model)
            self._runs[task] = SearchRun(self.space(task.duration_s), flights, self.search, self.weights)
        return self._runs[task]

    def _budget(self, state: OptimisationState) -> float | None:
        """The next search's part of the time that is left."""
        if self.search.max_seconds is None:
            return None
        waiting = max(self.effort.searches - len(state.found), 1)
        return max(self.search.max_seconds - state.search_s, 0.0) / waiting

    def _found(self, state: OptimisationState, *, variation: bool) -> Found:
        """What the search that runs has found; its unweighted variation takes a flight."""
        task, search = state.task, state.search
        assert task is not None and search is not None  # noqa: S101, PT018 - asked only while one runs
        varied, diverged = search.best_cost, False
        if variation and search.feasible:
            run = self._run(task)
            flown = run.flights.fly([run.space.schedule(search.best)], torque=False)
            varied, diverged = float(flown.variation[0]), bool(flown.diverged[0])
        return Found(
            model=task.model,
            duration_s=task.duration_s,
            point=search.best,
            cost=np.inf if diverged else search.best_cost,
            variation=np.inf if diverged else varied,
            diverged=diverged,
            torque=search.best_torque if search.feasible else search.anchor_torque,
            flights=search.flights,
            generations=search.generation,
        )

    def not_flyable(self) -> NotFlyable:
        """The error of a search in which no schedule flew to its end."""
        why = soft_joint(*self.chain("equivalent")) or Obstacle(
            "/model/parameters",
            "the model leaves its domain in every morph that was tried: check its stiffness and damping, or "
            "identify it anew",
        )
        return NotFlyable(
            "the equivalent model flies no morph to its end", pointer=why.pointer, hint=why.hint
        )

    def _too_much_torque(self, found: Found, stop: Stop | None) -> InvalidInput:
        """The error that says how long a morph takes that the hinges' motors can drive."""
        most = self.limits.max_hinge_torque_nm
        least = found.torque
        for factor in LONGER:
            duration = factor * found.duration_s
            run = SearchRun(self.space(duration), self.flights("equivalent"), self.search, self.weights)
            state = run.begin(np.zeros((0, run.space.dimension)))
            while state.phase in ("baseline", "ease"):
                state, _ = run.advance(state, stop)
            if state.feasible:
                time_s = rounded_up(duration)
                hint = f"raise duration_s to about {time_s:g}, or the limit to {rounded_up(least):g} or more"
                break
        else:
            hint = f"raise the limit to {rounded_up(least):g} or more; the air alone takes much of it"
        return InvalidInput(
            f"the hinges bear {least:.4g} N m at least in a morph of {found.duration_s:g} s, more than "
            f"max_hinge_torque_nm = {most:g}",
            pointer="/limits/max_hinge_torque_nm",
            hint=hint,
        )

    def _step(self, state: OptimisationState, told: Told) -> Step:
        return Step(
            phase=told.phase,
            generation=state.generation,
            fraction=self.effort.fraction(state, self.search, told.share),
            best_cost=best_cost(state),
            flights=state.flights,
            message=f"{told.message} after {state.flights} flights",
            checkpoint=encode(state),
        )
