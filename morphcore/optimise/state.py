"""The complete state of an optimisation, and its progress."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

from morphcore.optimise.goals import Found, Task, planned
from morphcore.optimise.search import LimitedState
from morphcore.optimise.settings import ScheduleSettings
from morphcore.optimise.verification import Verified
from morphcore.search.checkpoint import stored
from morphcore.search.run import UNFINISHED, SearchState
from morphdata.optimize import Morph

# reference seconds for parts of the work: only their ratios matter, for the fraction
SEARCH_COST_S = 3.5
PARTICLE_COST_S = 0.015
FLEXIBLE_COST_S = 1.5  # per second of flight
FLEXIBLE_FLIGHTS = 3


@stored
@dataclass(frozen=True)
class OptimisationState:
    """An optimisation between two steps.

    phase : what comes next. task, search : the current search. found : finished searches. verified : finished
    flights of the flexible model. history : one row for each step of a search. search_s : wall time of the
    searches, s; wall_s : of everything. step_s : time step of the flights, once it is chosen.
    """

    phase: Literal["search", "verify", "done"] = "search"
    task: Task | None = None
    search: SearchState | None = None
    found: tuple[Found, ...] = ()
    verified: tuple[Verified, ...] = ()
    generation: int = 0
    flights: int = 0
    search_s: float = 0.0
    wall_s: float = 0.0
    history: tuple[dict[str, Any], ...] = field(default=(), repr=False)
    step_s: float | None = None

    @property
    def best_cost(self) -> float:
        """J of the latest search with the equivalent model, rad^2."""
        if self.search is not None and self.task is not None and self.task.model == "equivalent":
            cost = shown_cost(self.search)
            if cost is not None:
                return cost
        return next((f.cost for f in reversed(self.found) if f.model == "equivalent" and f.feasible), 0.0)


@dataclass(frozen=True)
class Effort:
    """Costs of the parts of the work, s, and their numbers."""

    searches: int
    search_s: float
    flexible_s: float

    def fraction(self, state: OptimisationState, *, searched: float, flown: float) -> float:
        """Share of the whole work that is done, 0..1.

        searched : fraction of the current search. flown : fraction of the current flexible flight.
        """
        if state.phase == "done":
            return 1.0
        if state.phase == "search":
            done = self.search_s * min(len(state.found) + searched, self.searches)
        else:
            done = self.search_s * self.searches + self.flexible_s * (len(state.verified) + flown)
        return min(done / (self.search_s * self.searches + self.flexible_s * FLEXIBLE_FLIGHTS), UNFINISHED)


def effort(morph: Morph, choices: int, search: ScheduleSettings, *, flexible: bool) -> Effort:
    """Return the effort that a goal takes with a given number of candidate durations."""
    swarm = search.swarm
    return Effort(
        searches=planned(morph, choices),
        search_s=PARTICLE_COST_S * swarm.particles * swarm.generations
        if search.method == "pso"
        else SEARCH_COST_S,
        flexible_s=FLEXIBLE_COST_S * (morph.duration_s + morph.settle_s) if flexible else 0.0,
    )


def shown_cost(search: SearchState) -> float | None:
    """Return the minimum J of a search, rad^2; until a schedule satisfies the torque limit, the eased one's.

    None before the first flight.
    """
    if search.feasible:
        return search.best_cost
    inner = search.solver
    return inner.easing.cost if isinstance(inner, LimitedState) and inner.easing is not None else None
