"""Covariance matrix adaptation (CMA-ES, Hansen & Ostermeier 2001) by the package cma, resumable to the bit.

The strategy's own state is spread over many objects. Ours is what it received: the costs of all generations.
Given the same costs again it passes through the same states, which takes about a millisecond per generation
and no flights. Its normal deviates come from a generator of its own, and numpy's global generator is restored
after each call.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from morphcore.geometry.fields import WholeNumbers
from morphcore.search.checkpoint import stored
from morphcore.search.solver import Batch, Outcome, Problem, Solver

Array = NDArray[np.float64]

FIRST_SPREAD = 0.1  # standard deviation of the first generation, in the unit cube


@cache
def strategies() -> Any:
    """Import the package only when the first strategy is made, since it imports matplotlib."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it warns about missing plotting packages
        import cma
    return cma


@dataclass(frozen=True)
class EvolutionSettings(WholeNumbers):
    """``particles`` models per generation; the search ends before ``generations`` if it has converged."""

    particles: int = 32
    generations: int = 200


@stored
@dataclass(frozen=True)
class EvolutionState:
    """The first mean (d,) in the unit cube, and the costs (g, p) of g generations of p models."""

    mean: Array
    costs: Array

    @property
    def generation(self) -> int:
        """Generations flown."""
        return int(self.costs.shape[0])


class EvolutionStrategy(Solver[EvolutionState, Outcome]):
    """A strategy in a problem's box, around the best guess.

    Parameters
    ----------
    problem : provides the box.
    settings : EvolutionSettings
    seed : int
    """

    name = "evolution"

    def __init__(self, problem: Problem[Any], settings: EvolutionSettings, seed: int) -> None:
        self._box = problem.box
        self._settings, self._seed = settings, seed
        # the package's strategy as last used: the costs it received, and the generation it proposes
        self._strategy: Any = None
        self._seen = EvolutionState(np.empty(0), np.empty((0, 0)))
        self._candidates: Array | None = None

    def init(self, known: Outcome) -> EvolutionState:
        """Start around the first point."""
        return EvolutionState(self._box.to_unit(known.points[0]), np.empty((0, self._settings.particles)))

    def ask(self, state: EvolutionState) -> Batch:
        """Return the next generation."""
        self._go_to(state)
        if self._candidates is None:
            with _own_numbers():
                self._candidates = np.array(self._strategy.ask())
        return Batch(self._box.from_unit(self._candidates))

    def tell(self, state: EvolutionState, outcome: Outcome) -> EvolutionState:
        """Add the costs of a generation."""
        return replace(state, costs=np.concatenate([state.costs, outcome.cost[None]]))

    def done(self, state: EvolutionState) -> bool:
        """Return whether all generations have been flown, or the strategy has stopped by its own criteria."""
        if state.generation >= self._settings.generations:
            return True
        self._go_to(state)
        with _own_numbers():
            return bool(self._strategy.stop())

    def share(self, state: EvolutionState) -> float:
        """Return the share of the generations that have been flown."""
        return state.generation / self._settings.generations

    def remarks(self, outcome: Outcome) -> dict[str, float]:
        """Return the mean cost of a generation."""
        return {"mean_cost": float(outcome.cost.mean())}

    def _go_to(self, state: EvolutionState) -> None:
        """Pass the strategy the costs that it has not received yet; restart it if it received others."""
        known = self._seen.generation
        if (
            self._strategy is None
            or known > state.generation
            or not np.array_equal(self._seen.mean, state.mean)
            or not np.array_equal(self._seen.costs, state.costs[:known])
        ):
            self._seen, self._candidates = replace(state, costs=state.costs[:0]), None
            self._strategy = self._begun(state.mean)
        for cost in state.costs[self._seen.generation :]:
            with _own_numbers():
                requested = self._strategy.ask() if self._candidates is None else list(self._candidates)
                self._strategy.tell(requested, cost.tolist())
            self._candidates = None
        self._seen = state

    def _begun(self, mean: Array) -> Any:
        numbers = np.random.default_rng(self._seed)
        options = {
            "bounds": [0.0, 1.0],
            "maxstd": np.inf,  # the package's own limit raises where the spread reaches it
            "popsize": self._settings.particles,
            "randn": lambda *shape: numbers.standard_normal(shape),
            "seed": np.nan,  # the package must not seed numpy's global generator
            "tolfun": 1e-12,  # rad^2: smaller differences of cost are round-off
            "verbose": -9,
            "verb_log": 0,  # no files
            "signals_filename": None,  # and none read
        }
        with _own_numbers():
            return strategies().CMAEvolutionStrategy(mean, FIRST_SPREAD, options)


@contextmanager
def _own_numbers() -> Iterator[None]:
    """Put numpy's global generator into a known state inside, restore it after, and suppress warnings."""
    others = np.random.get_state(legacy=True)  # noqa: NPY002 - parts of the package know no other
    np.random.seed(0)  # noqa: NPY002
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        np.random.set_state(others)  # noqa: NPY002
