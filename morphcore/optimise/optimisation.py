"""The optimisation of a morph as an iterator of steps, each with the complete state.

The searches come first: with the equivalent model for every duration that the goal requires, then with the
rigid model for the chosen duration. Then the flexible model flies the constant-rate schedule and both optima.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace

from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.models.equivalent import ParameterBatch
from morphcore.optimise.case import MorphCase
from morphcore.optimise.compared import compared_schedules
from morphcore.optimise.feasible import require_schedules, rounded_up
from morphcore.optimise.goals import Found, Task, durations, next_task, warm_starts
from morphcore.optimise.problem import MorphProblem
from morphcore.optimise.result import ScheduleResult, schedule_result
from morphcore.optimise.search import found_by, schedule_search
from morphcore.optimise.settings import ScheduleSettings
from morphcore.optimise.state import OptimisationState, effort, shown_cost
from morphcore.optimise.torque_limit import Trials
from morphcore.optimise.verification import Verified, verification
from morphcore.search.checkpoint import pack, unpack
from morphcore.search.run import Clock, Search, SearchState
from morphcore.search.step import Step
from morphcore.simulate.time_grid import STEP_S
from morphcore.simulate.trim import StartMode
from morphcore.stopping import Deadline, Stop, say
from morphcore.threads import one_blas_thread
from morphdata.faults import refuse
from morphdata.lattice import DEFAULT_LATTICE, Lattice
from morphdata.optimize import Limits, Morph, Verify, VerifyingModel, Weights, goal_faults

VERSION = "optimise 2"  # version of the checkpoint; other versions are not read
# multiples of the duration that are tried when the torque limit is too tight
LONGER = (1.1, 1.2, 1.35, 1.5, 1.75, 2.0, 2.5, 3.0, 4.0)


class ScheduleOptimisation(MorphCase):
    """Search for the morph that disturbs the attitude least, within the drive's limits.

    Parameters
    ----------
    model : one parameter set of the equivalent model. verify : whether to fly the result in the flexible
    model.
    flexible : the flexible model. lattice, start, step_s : settings of the flights of the rigid and the
    equivalent model. A step of None selects the longest with which both fly the constant-rate morph to the
    tolerance of `choose_step`.

    Raises
    ------
    InvalidInput : no schedule satisfies the limits, or a setting is invalid.
    """

    def __init__(  # noqa: PLR0913 - an optimisation has that many independent inputs
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
        super().__init__(
            aircraft,
            flight,
            model,
            morph=morph,
            limits=limits or Limits(),
            lattice=lattice,
            start=start,
            step_s=step_s,
        )
        self.weights, self.search, self.verify = weights or Weights(), search or ScheduleSettings(), verify
        self.flexible = flexible or VerifyingModel()
        self._clock = clock
        refuse(goal_faults(morph, limits or Limits()))
        with one_blas_thread():
            longest = self.space(morph.duration_s)
            require_schedules(longest)
            self.durations = durations(morph, longest.quickest[0])
        self.effort = effort(morph, self.durations.size, self.search, flexible=verify == "flexible")
        self._searches: dict[Task, Search[Trials]] = {}

    # the iterator

    def steps(self, checkpoint: bytes | None = None, stop: Stop | None = None) -> Iterator[Step]:
        """Run the optimisation step by step.

        Parameters
        ----------
        checkpoint : of an earlier step; None starts from the beginning. Apart from times, the result is
        bit-identical.
        stop : called several times a second; True raises Interrupted.
        """
        state = OptimisationState() if checkpoint is None else self.state(checkpoint)
        while state.phase != "done":
            begin, before = self._clock(), state
            # a search step yields one state; a flight of the flexible model reports its progress in many
            # steps
            advance = self._searched if state.phase == "search" else self._verified
            for after, step in advance(before, stop):
                used = self._clock() - begin
                state = replace(after, wall_s=before.wall_s + used)
                if before.phase == "search":
                    state = replace(state, search_s=before.search_s + used)
                yield replace(step, checkpoint=pack(state, VERSION))

    def result(self, checkpoint: bytes) -> ScheduleResult:
        """Return the schedule at any step, with flights of all compared schedules in both simple models.

        Raises
        ------
        NotFlyable : the equivalent model cannot fly the best schedule to its end.
        """
        say("evaluating the result")
        with one_blas_thread():
            found = schedule_result(self, self.search, self.weights, self.state(checkpoint))
        if found.lost:
            raise self.not_flyable()
        return found

    def best_so_far(self, checkpoint: bytes) -> ScheduleResult:
        """Return the result without torques, quickly, because a caller is waiting for a cancelled run.

        If the best schedule cannot be flown, the result holds no schedule but a warning.
        """
        with one_blas_thread():
            return schedule_result(self, self.search, self.weights, self.state(checkpoint), judged=False)

    def state(self, checkpoint: bytes) -> OptimisationState:
        """Return the state in a checkpoint; its flights keep the time step with which it was started.

        Raises
        ------
        UnreadableCheckpoint : the bytes are damaged or of another version.
        """
        state = unpack(checkpoint, VERSION, OptimisationState)
        self._step_s = state.step_s if self._step_s is None else self._step_s
        return state

    # one step each

    def _prepared(self, state: OptimisationState, stop: Stop | None) -> OptimisationState:
        """The state with its time step, chosen within the time of the searches, and with the next search."""
        budget_s = self.search.max_seconds
        deadline = Deadline(None if budget_s is None else budget_s - state.search_s, stop)
        if self._step_s is None:
            self._step_s = deadline.before_it(self._chosen_step, STEP_S)
        say("flying the first schedules")
        return self._begun(replace(state, step_s=self._step_s))

    def _searched(
        self, state: OptimisationState, stop: Stop | None
    ) -> Iterator[tuple[OptimisationState, Step]]:
        """One step of the current search, and the transition when it is over."""
        with one_blas_thread():
            if state.task is None:
                state = self._prepared(state, stop)
            task, search = state.task, state.search
            assert task is not None and search is not None  # noqa: S101, PT018 - the phase says so
            moved = self._search(task, state.found).advance(search, stop)
            state = self._recorded(state, task, moved)
            phase = state.history[-1]["phase"]
            message = f"{task.model} model, {task.duration_s:.4g} s: J = {shown_cost(moved) or 0.0:.4g} rad^2"
            if moved.over:
                state = self._ended(state, task, moved, stop)
        yield state, self._step(state, phase, message)

    def _recorded(self, state: OptimisationState, task: Task, search: SearchState) -> OptimisationState:
        """The state after a step of its search, with the step appended to the overall history."""
        before = 0 if state.search is None else state.search.flights
        flights = state.flights + search.flights - before
        rows = tuple(
            {
                "generation": state.generation + 1,
                "phase": row["phase"],
                "particles": search.flights - before,
                "model": task.model,
                "duration_s": task.duration_s,
                "flights": flights,
                "best_cost": search.best_cost if search.feasible else None,
            }
            for row in search.history
        )
        return replace(
            state,
            search=replace(search, history=()),
            generation=state.generation + len(rows),
            flights=flights,
            history=(*state.history, *rows),
        )

    def _begun(self, state: OptimisationState) -> OptimisationState:
        """The state with the next search, or with the next phase if no search is left."""
        task = next_task(self.morph, self.durations, state.found)
        if task is None:
            return replace(
                state, phase="verify" if self.verify == "flexible" else "done", task=None, search=None
            )
        return replace(state, task=task, search=SearchState(self._budget(state)))

    def _ended(
        self, state: OptimisationState, task: Task, search: SearchState, stop: Stop | None
    ) -> OptimisationState:
        """The state after a search, with its result and what comes next."""
        space = self.space(task.duration_s)
        found = found_by(task, space, search).varied(space, self.flights(task.model))
        if not found.feasible and found.model == "equivalent" and found.duration_s == self.durations[-1]:
            raise self.not_flyable() if found.diverged else self._too_much_torque(found, stop)
        flown = state.flights + int(found.feasible)
        return self._begun(replace(state, found=(*state.found, found), task=None, search=None, flights=flown))

    def _verified(
        self, state: OptimisationState, stop: Stop | None
    ) -> Iterator[tuple[OptimisationState, Step]]:
        """Fly the next schedule in the flexible model and report progress."""
        compared = compared_schedules(self, state)
        waiting = {name: schedule for name, schedule in compared.items() if schedule is not None}
        name = list(waiting)[len(state.verified)]
        message = f"flexible model: {name.replace('_', ' ')}"
        for reached in verification(self, self.flexible, name, waiting[name], self._clock, stop):
            if isinstance(reached, Verified):
                done = (*state.verified, reached)
                state = replace(state, verified=done, phase="done" if len(done) == len(waiting) else "verify")
                yield (
                    state,
                    self._step(state, "verify", f"{message} {'failed' if reached.failure else 'flown'}"),
                )
            else:
                yield state, self._step(state, "verify", message, flown=reached)

    # pieces

    def _search(self, task: Task, found: tuple[Found, ...]) -> Search[Trials]:
        """The search of a task, warm-started from the results of earlier searches."""
        if task not in self._searches:
            space = self.space(task.duration_s)
            # the rigid model's search starts as freely as the equivalent model's first one
            warm = warm_starts(space, found if task.model == "equivalent" else ())
            problem = MorphProblem(space, self.flights(task.model), self.weights, warm)
            self._searches[task] = schedule_search(problem, self.search, self._clock)
        return self._searches[task]

    def _budget(self, state: OptimisationState) -> float | None:
        """The next search's share of the remaining time."""
        if self.search.max_seconds is None:
            return None
        waiting = max(self.effort.searches - len(state.found), 1)
        return max(self.search.max_seconds - state.search_s, 0.0) / waiting

    def _too_much_torque(self, found: Found, stop: Stop | None) -> InvalidInput:
        """The error that states which duration the hinges' motors could manage."""
        maximum = self.limits.max_hinge_torque_nm
        minimum = found.torque
        for factor in LONGER:
            duration = factor * found.duration_s
            search = self._search(Task("equivalent", duration), ())
            state = SearchState()
            while not (state.over or state.feasible):
                state = search.advance(state, stop)
            if state.feasible:
                time_s = rounded_up(duration)
                hint = (
                    f"raise duration_s to about {time_s:g}, or the limit to {rounded_up(minimum):g} or more"
                )
                break
        else:
            hint = (
                f"raise the limit to {rounded_up(minimum):g} or more; the air loads alone require much of it"
            )
        turns = self.morph.unit == "rad"
        name, unit = ("max_hinge_torque_nm", "N m") if turns else ("max_drive_force_n", "N")
        return InvalidInput(
            f"the hinges bear {minimum:.4g} {unit} at least in a morph of {found.duration_s:g} s, more than "
            f"{name} = {maximum:g}",
            pointer=f"/limits/{name}",
            hint=hint,
        )

    def _step(self, state: OptimisationState, phase: str, message: str, *, flown: float = 0.0) -> Step:
        searched = 0.0
        if state.task is not None and state.search is not None:
            searched = self._search(state.task, state.found).fraction(state.search)
        return Step(
            phase=phase,
            generation=state.generation,
            fraction=self.effort.fraction(state, searched=searched, flown=flown),
            best_cost=state.best_cost,
            flights=state.flights,
            message=f"{message} after {state.flights} flights",
            checkpoint=b"",
        )
