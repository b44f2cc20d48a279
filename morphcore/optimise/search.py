"""One search: the schedule of minimum variation for one model and one duration.

The centre of the limits and the results of neighbouring searches are flown first. If all of them exceed the
limit of the hinge torque, the torque is lowered until one does not. Then a method searches among the
schedules that satisfy all limits.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from morphcore.optimise.easing import EasingState, TorqueEasing
from morphcore.optimise.goals import Found, Task
from morphcore.optimise.limits import MorphSpace
from morphcore.optimise.problem import MorphProblem
from morphcore.optimise.screening import ScreenedDescent
from morphcore.optimise.settings import ScheduleSettings
from morphcore.optimise.torque_limit import Anchored, Trials
from morphcore.search.checkpoint import stored
from morphcore.search.methods import Factory, method
from morphcore.search.run import Clock, Search, SearchState
from morphcore.search.solver import Batch, Solver

Array = NDArray[np.float64]

METHODS: dict[str, Factory] = {"hybrid": ScreenedDescent}


@stored
@dataclass(frozen=True)
class LimitedState:
    """A search within the torque limit.

    Attributes
    ----------
    stage : what comes next: "waiting", further schedules to ease; "easing"; "starting", the method's first
        batch; "searching", its others.
    known : schedules flown first; once the method has started, those that satisfy the limit. All others are
    drawn back toward the first of these.
    easing, method : states of the solvers.
    """

    stage: Literal["waiting", "easing", "starting", "searching"]
    known: Trials
    easing: EasingState | None = None
    method: Any = None


class LimitedSearch(Solver[LimitedState, Trials]):
    """A method that searches among feasible schedules, after easing the torque if none is feasible yet.

    Parameters
    ----------
    problem : MorphProblem
    method : the search method.
    all_known : whether the method starts from all known schedules, or from the first only.
    """

    def __init__(self, problem: MorphProblem, method: Solver[Any, Trials], *, all_known: bool) -> None:
        self._problem, self._method, self._all_known = problem, method, all_known
        self._easing = TorqueEasing(problem.space)

    def init(self, known: Trials) -> LimitedState:
        """Start from the schedules that satisfy the limit; without any, find one first."""
        good = self._problem.limit.keeps(known.peak)
        if good.any():
            return self._started(known.select(good))
        return LimitedState("waiting", known.select(slice(None)))

    def ask(self, state: LimitedState) -> Batch:
        """Return the batch of the current solver, with candidates drawn back to the limits."""
        space = self._problem.space
        if state.stage == "waiting":
            return Batch(space.drawn_back(space.waiting()))
        if state.stage == "easing":
            return self._easing.ask(_easing(state))
        batch = self._method.ask(state.method)
        if batch.residuals or isinstance(batch, Anchored):
            return batch
        return self._problem.anchored(space.drawn_back(batch.points), state.known)

    def tell(self, state: LimitedState, outcome: Trials) -> LimitedState:
        """Update the current solver; start the search once a schedule satisfies the torque limit."""
        if state.stage in ("starting", "searching"):
            return replace(state, stage="searching", method=self._method.tell(state.method, outcome))
        if state.stage == "waiting":
            both = [state.known, outcome]
            easing = self._easing.init(
                Trials.known(
                    np.concatenate([trials.points for trials in both]),
                    np.concatenate([trials.cost for trials in both]),
                    np.concatenate([trials.peak for trials in both]),
                )
            )
        else:
            easing = self._easing.tell(_easing(state), outcome)
        eased = Trials.known(easing.point[None, :], np.array([easing.cost]), np.array([easing.peak]))
        if self._easing.between_steps(easing) and self._problem.limit.keeps(eased.peak).all():
            return self._started(eased)
        return replace(state, stage="easing", easing=easing)

    def done(self, state: LimitedState) -> bool:
        """Return whether the method is finished, or the torque cannot be lowered further."""
        if state.stage == "waiting":
            return False
        if state.stage == "easing":
            return self._easing.done(_easing(state))
        return self._method.done(state.method)

    def best(self, state: LimitedState, outcome: Trials) -> tuple[Array, float]:
        """Return the best schedule that satisfies all limits."""
        if state.stage == "searching":
            return self._method.best(state.method, outcome)
        if state.stage == "starting":
            return super().best(state, state.known)
        return self._problem.space.centre, np.inf

    def between_steps(self, state: LimitedState) -> bool:
        """Return whether a step of the current solver has ended."""
        if state.stage == "easing":
            return self._easing.between_steps(_easing(state))
        return state.stage == "starting" or (
            state.stage == "searching" and self._method.between_steps(state.method)
        )

    def phase(self, state: LimitedState) -> str:
        """Return the name of the current solver."""
        return self._easing.name if state.stage == "easing" else self._method.phase(state.method)

    def share(self, state: LimitedState) -> float:
        """Return the progress of the method."""
        return 0.0 if state.method is None else self._method.share(state.method)

    def _started(self, known: Trials) -> LimitedState:
        first = known if self._all_known else known.select(slice(0, 1))
        return LimitedState("starting", known, method=self._method.init(first))


def _easing(state: LimitedState) -> EasingState:
    if state.easing is None:
        raise ValueError(f"there is no easing while {state.stage}")
    return state.easing


def schedule_search(problem: MorphProblem, settings: ScheduleSettings, clock: Clock) -> Search[Trials]:
    """Return the search selected by the settings."""
    own = settings.method in METHODS
    solver = method(settings.method, problem, settings, METHODS)
    return Search(problem, LimitedSearch(problem, solver, all_known=own), clock)


def found_by(task: Task, space: MorphSpace, search: SearchState) -> Found:
    """Return the result of a task's search so far; its unweighted variation is not known yet."""
    if search.feasible:
        return Found(task.model, task.duration_s, search.best, search.best_cost, search.best_cost, 0.0)
    inner = search.solver
    if isinstance(inner, LimitedState) and inner.easing is not None:
        return Found(task.model, task.duration_s, inner.easing.point, np.inf, np.inf, inner.easing.peak)
    return Found(task.model, task.duration_s, space.centre, np.inf, np.inf, np.inf)
