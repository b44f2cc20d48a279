"""Covariance matrix adaptation (CMA-ES, Hansen & Ostermeier 2001) by the package cma, resumable to the bit.

The strategy's own state is spread over many objects. Ours is what it was told: the costs of all generations.
Asked and told the same again it goes through the same states, which takes about a millisecond a generation
and no flights. Its normal numbers come from a generator of its own, and numpy's global one is put back after
each call.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from morphcore.geometry.fields import WholeNumbers

Array = NDArray[np.float64]

FEWEST = 4  # models of a generation: with fewer there is nothing to weigh
FIRST_SPREAD = 0.1  # standard deviation of the first generation, in the unit cube


@cache
def strategies() -> Any:
    """The package; loaded for the first strategy, for it brings matplotlib along."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it warns of packages for plots that it misses
        import cma
    return cma


@dataclass(frozen=True)
class EvolutionSettings(WholeNumbers):
    """``particles`` models a generation; the search ends before ``generations`` where it has converged."""

    particles: int = 32
    generations: int = 200


@dataclass(frozen=True)
class EvolutionState:
    """What the strategy was told: costs (g, p) of g generations of p models."""

    told: Array

    @property
    def generation(self) -> int:
        """Generations flown."""
        return int(self.told.shape[0])


def first_evolution(settings: EvolutionSettings) -> EvolutionState:
    """Nothing told yet."""
    return EvolutionState(np.empty((0, settings.particles)))


class Evolution:
    """A strategy in the unit cube around a first mean (d,).

    Parameters
    ----------
    settings, mean, seed : what the sequence of generations depends on, beside their costs.
    """

    def __init__(self, settings: EvolutionSettings, mean: Array, seed: int) -> None:
        self._settings = settings
        self._mean, self._seed = mean, seed
        self._told = np.empty((0, settings.particles))
        self._asked: Array | None = None
        self._strategy = self._begun()

    def points(self, state: EvolutionState) -> Array:
        """(p, d) the generation that follows a state."""
        self._go_to(state)
        if self._asked is None:
            with _own_numbers():
                self._asked = np.array(self._strategy.ask())
        return self._asked

    def moved(self, state: EvolutionState, cost: Array) -> EvolutionState:
        """The state after the costs (p,) of a state's generation."""
        after = EvolutionState(np.concatenate([state.told, cost[None]]))
        self._go_to(after)
        return after

    def converged(self, state: EvolutionState) -> bool:
        """Whether the strategy sees no use in going on."""
        self._go_to(state)
        with _own_numbers():
            return bool(self._strategy.stop())

    def _begun(self) -> Any:
        numbers = np.random.default_rng(self._seed)
        options = {
            "bounds": [0.0, 1.0],
            "maxstd": np.inf,  # the package's own limit raises where the spread reaches it
            "popsize": self._settings.particles,
            "randn": lambda *shape: numbers.standard_normal(shape),
            "seed": np.nan,  # the package must not seed numpy's global generator
            "tolfun": 1e-12,  # rad^2: costs differ by less only for the arithmetic
            "verbose": -9,
            "verb_log": 0,  # no files
            "signals_filename": None,  # and none read
        }
        with _own_numbers():
            return strategies().CMAEvolutionStrategy(self._mean, FIRST_SPREAD, options)

    def _go_to(self, state: EvolutionState) -> None:
        """Tell what is not told yet; begin anew where something else was told."""
        known = self._told.shape[0]
        if known > state.generation or not np.array_equal(self._told, state.told[:known]):
            self._told, self._asked = state.told[:0], None
            self._strategy = self._begun()
        for cost in state.told[self._told.shape[0] :]:
            with _own_numbers():
                asked = self._strategy.ask() if self._asked is None else list(self._asked)
                self._strategy.tell(asked, cost.tolist())
            self._asked = None
            self._told = np.concatenate([self._told, cost[None]])


@contextmanager
def _own_numbers() -> Iterator[None]:
    """Numpy's global generator is in a known state inside and unchanged outside; no warnings come out."""
    others = np.random.get_state(legacy=True)  # noqa: NPY002 - parts of the package know no other
    np.random.seed(0)  # noqa: NPY002
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        np.random.set_state(others)  # noqa: NPY002
