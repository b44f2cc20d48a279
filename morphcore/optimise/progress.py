"""How far an optimisation has come: what its user sees of a step."""

from __future__ import annotations

from dataclasses import dataclass

from morphcore.optimise.goals import planned
from morphcore.optimise.search import SearchState, search_share
from morphcore.optimise.settings import ScheduleSearch
from morphcore.optimise.state import OptimisationState
from morphdata.optimize import Morph

# seconds that parts of the work take on the machine it was written on: their ratios make the fraction
SEARCH_COST_S = 3.5
PARTICLE_COST_S = 0.015
FLEXIBLE_COST_S = 1.5  # for each second flown
FLEXIBLE_FLIGHTS = 3


@dataclass(frozen=True)
class Told:
    """The words of a step; ``share`` of a flight of the flexible model that is under way."""

    phase: str
    message: str
    share: float = 0.0


@dataclass(frozen=True)
class Effort:
    """What parts of the work cost, s, and how many there are."""

    searches: int
    search_s: float
    flexible_s: float

    def fraction(self, state: OptimisationState, settings: ScheduleSearch, flying: float) -> float:
        """Share of the whole work that is done, 0..1; ``flying``: of a flexible flight under way."""
        if state.phase == "done":
            return 1.0
        if state.phase == "search":
            running = 0.0 if state.search is None else search_share(state.search, settings)
            done = self.search_s * min(len(state.found) + running, self.searches)
        else:
            done = self.search_s * self.searches + self.flexible_s * (len(state.verified) + flying)
        return min(done / (self.search_s * self.searches + self.flexible_s * FLEXIBLE_FLIGHTS), 0.99)


def effort(morph: Morph, choices: int, search: ScheduleSearch, *, flexible: bool) -> Effort:
    """The effort that a goal takes with so many durations to choose from."""
    swarm = search.swarm
    return Effort(
        searches=planned(morph, choices),
        search_s=PARTICLE_COST_S * swarm.particles * swarm.generations
        if search.method == "pso"
        else SEARCH_COST_S,
        flexible_s=FLEXIBLE_COST_S * (morph.duration_s + morph.settle_s) if flexible else 0.0,
    )


def shown_cost(search: SearchState) -> float:
    """Least J of a search; before any schedule keeps the torque limit, that of the one that is eased."""
    return search.best_cost if search.feasible else search.anchor_cost


def best_cost(state: OptimisationState) -> float:
    """J of the equivalent model's search that ran last."""
    if state.search is not None and state.task is not None and state.task.model == "equivalent":
        return shown_cost(state.search)
    return next((f.cost for f in reversed(state.found) if f.model == "equivalent" and f.feasible), 0.0)
