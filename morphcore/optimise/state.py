"""The complete state of an optimisation, and how far it has come."""

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

# seconds that parts of the work take on the machine it was written on: their ratios make the fraction
SEARCH_COST_S = 3.5
PARTICLE_COST_S = 0.015
FLEXIBLE_COST_S = 1.5  # for each second flown
FLEXIBLE_FLIGHTS = 3


@stored
@dataclass(frozen=True)
class OptimisationState:
    """An optimisation between two steps.

    phase : what comes next. task, search : the search that runs. found : those that are done. verified :
    flights of the flexible model that are done. history : one row for each step of a search. search_s : wall
    time of the searches, s; wall_s : of everything. step_s : of the flights, once it is chosen.
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
        """J of the equivalent model's search that ran last, rad^2."""
        if self.search is not None and self.task is not None and self.task.model == "equivalent":
            cost = shown_cost(self.search)
            if cost is not None:
                return cost
        return next((f.cost for f in reversed(self.found) if f.model == "equivalent" and f.feasible), 0.0)


@dataclass(frozen=True)
class Effort:
    """What parts of the work cost, s, and how many there are."""

    searches: int
    search_s: float
    flexible_s: float

    def fraction(self, state: OptimisationState, *, searched: float, flown: float) -> float:
        """Share of the whole work that is done, 0..1.

        searched : of the search that runs. flown : of a flexible flight under way.
        """
        if state.phase == "done":
            return 1.0
        if state.phase == "search":
            done = self.search_s * min(len(state.found) + searched, self.searches)
        else:
            done = self.search_s * self.searches + self.flexible_s * (len(state.verified) + flown)
        return min(done / (self.search_s * self.searches + self.flexible_s * FLEXIBLE_FLIGHTS), UNFINISHED)


def effort(morph: Morph, choices: int, search: ScheduleSettings, *, flexible: bool) -> Effort:
    """The effort that a goal takes with so many durations to choose from."""
    swarm = search.swarm
    return Effort(
        searches=planned(morph, choices),
        search_s=PARTICLE_COST_S * swarm.particles * swarm.generations
        if search.method == "pso"
        else SEARCH_COST_S,
        flexible_s=FLEXIBLE_COST_S * (morph.duration_s + morph.settle_s) if flexible else 0.0,
    )


def shown_cost(search: SearchState) -> float | None:
    """Least J of a search, rad^2; while no schedule keeps the torque limit, of the one that is eased.

    None before anything was flown.
    """
    if search.feasible:
        return search.best_cost
    inner = search.solver
    return inner.easing.cost if isinstance(inner, LimitedState) and inner.easing is not None else None
