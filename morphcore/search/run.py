"""The loop shared by all searches: ask, evaluate, tell, with time limit, stop and a state after each step."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, Generic

import numpy as np
from numpy.typing import NDArray

from morphcore.search.checkpoint import stored
from morphcore.search.solver import Batch, Problem, Result, Solver
from morphcore.stopping import Deadline, Stop
from morphcore.threads import one_blas_thread

Array = NDArray[np.float64]
Clock = Callable[[], float]

FIRST = "baseline"  # name in the history of a result of the step that evaluates the known points
UNFINISHED = 0.99  # largest fraction reported by an unfinished search


@stored
@dataclass(frozen=True)
class SearchState:
    """A search between two steps.

    Attributes
    ----------
    budget_s : time that the search may take, s; None for no limit.
    prepared : choices that the problem made before its first evaluation.
    solver : the method's own state; None before the first evaluation.
    best : (d,) the point of lowest cost so far; ``best_cost`` is infinite if there is none.
    generation : steps after the first. flights : number flown so far. wall_s : wall time, s.
    history : one row for each step.
    over : whether the search has ended, by itself or by its time limit.
    """

    budget_s: float | None = None
    prepared: Any = None
    solver: Any = field(default=None, repr=False)
    best: Array = field(default_factory=lambda: np.zeros(0))
    best_cost: float = np.inf
    generation: int = 0
    flights: int = 0
    wall_s: float = 0.0
    history: tuple[dict[str, Any], ...] = field(default=(), repr=False)
    over: bool = False

    @property
    def feasible(self) -> bool:
        """Whether any point satisfies all limits."""
        return bool(np.isfinite(self.best_cost))


class Search(Generic[Result]):
    """A solver applied to a problem.

    Parameters
    ----------
    problem, solver : the search problem and the method.
    clock : monotonic clock, s.
    """

    def __init__(
        self, problem: Problem[Result], solver: Solver[Any, Result], clock: Clock = time.perf_counter
    ) -> None:
        self.problem, self.solver = problem, solver
        self._clock = clock

    def advance(self, state: SearchState, stop: Stop | None = None) -> SearchState:
        """Return the state after the next step, or the unchanged state marked as over if time runs out first.

        The known points are always evaluated, so there is a result however short the time.

        Raises
        ------
        Interrupted : ``stop`` returned True.
        """
        begin = self._clock()
        left_s = None if state.budget_s is None else state.budget_s - state.wall_s
        deadline = Deadline(left_s, stop)
        with one_blas_thread():
            if state.solver is None:
                state = replace(state, prepared=self.problem.prepare(deadline))
            if state.feasible:
                ended = replace(state, over=True)
                moved = deadline.before_it(lambda limited: self._step(state, limited), ended)
            else:
                moved = self._step(state, stop)
        return self._timed(moved, self._clock() - begin)

    def task(self, state: SearchState) -> Batch | None:
        """Return the next step's batch if it needs costs only, so that it can be evaluated elsewhere."""
        if state.over or state.solver is None:
            return None
        batch = self.solver.ask(state.solver)
        return None if batch.residuals else batch

    def tell(self, state: SearchState, outcome: Result, wall_s: float) -> SearchState:
        """Return the state after the step of a `task` that was evaluated elsewhere, in ``wall_s`` seconds."""
        with one_blas_thread():
            return self._timed(self._step(state, None, outcome), wall_s)

    def fraction(self, state: SearchState) -> float:
        """Return the progress of a search, 0..1."""
        if state.over:
            return 1.0
        return 0.0 if state.solver is None else min(self.solver.share(state.solver), UNFINISHED)

    def _step(self, state: SearchState, stop: Stop | None, outcome: Result | None = None) -> SearchState:
        """Ask, evaluate and tell until a step ends. ``outcome`` : of the first batch, if already known."""
        solver, inner = self.solver, state.solver
        best, best_cost, evaluations = state.best, state.best_cost, 0
        while True:
            if outcome is None:
                batch = self.problem.first() if inner is None else solver.ask(inner)
                outcome = self.problem.evaluate(batch, stop)
            inner = solver.init(outcome) if inner is None else solver.tell(inner, outcome)
            evaluations += outcome.evaluations
            point, cost = solver.best(inner, outcome)
            if cost < best_cost or (np.isfinite(cost) and solver.replaces(inner)):
                best, best_cost = point, cost
            if solver.between_steps(inner):
                break
            outcome = None
        first = state.solver is None
        moved = replace(
            state,
            solver=inner,
            best=best,
            best_cost=best_cost,
            generation=0 if first else state.generation + 1,
            flights=state.flights + evaluations * self.problem.flights_each,
            over=self.problem.box.lower.size == 0 or solver.done(inner),
        )
        row = {
            "generation": moved.generation,
            "phase": FIRST if first else solver.phase(state.solver),
            "particles": 0 if first else evaluations,
            "flights": moved.flights,
            "best_cost": moved.best_cost,
            **({} if first else solver.remarks(outcome)),
        }
        return replace(moved, history=(*state.history, row))

    def _timed(self, state: SearchState, elapsed_s: float) -> SearchState:
        """Add the time of a step; if that exhausts the search's time, the step is the last."""
        wall_s = state.wall_s + elapsed_s
        up = state.feasible and state.budget_s is not None and wall_s >= state.budget_s
        return replace(state, wall_s=wall_s, over=state.over or up)
