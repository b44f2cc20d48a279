"""Problems in closed form, and searches of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from morphcore.search.checkpoint import pack, unpack
from morphcore.search.run import Search, SearchState
from morphcore.search.solver import Batch, Box, Outcome, Solver
from morphcore.stopping import Deadline, Interrupted, Stop

Array = NDArray[np.float64]
VERSION = "test"


class Formula:
    """A sum of squares in a box.

    Parameters
    ----------
    residuals : points (p, d) -> (p, m).
    lower, upper : (d,)
    known : (k, d) evaluated first.
    """

    flights_each = 1

    def __init__(self, residuals: Callable[[Array], Array], lower: Array, upper: Array, known: Array) -> None:
        self.residuals, self.known = residuals, np.atleast_2d(known)
        self.box = Box(lower, upper)
        self.evaluated: list[Array] = []

    def arranged(self, points: Array) -> Array:
        """The points as they are."""
        return points

    def prepare(self, deadline: Deadline) -> str:  # noqa: ARG002 - takes no time
        """A plain value."""
        return "prepared"

    def first(self) -> Batch:
        """What is known."""
        return Batch(self.known)

    def evaluate(self, batch: Batch, stop: Stop | None) -> Outcome:
        """Evaluate the formula; a stop is checked first."""
        if stop is not None and stop():
            raise Interrupted
        self.evaluated.append(batch.points)
        found = self.residuals(batch.points)
        cost = np.einsum("pm,pm->p", found, found)
        return Outcome(batch.points, cost, found if batch.residuals else None, cost.size)

    @property
    def seen(self) -> Array:
        """All points evaluated, (n, d)."""
        return np.concatenate(self.evaluated)


def unit_cube(residuals: Callable[[Array], Array], guess: Array) -> Formula:
    """A problem in the unit cube around a guess (d,) or several (k, d)."""
    d = np.atleast_2d(guess).shape[1]
    return Formula(residuals, np.zeros(d), np.ones(d), guess)


def bowl(points: Array) -> Array:
    """Residuals of a quadratic bowl with its bottom at 0.3."""
    return points - 0.3


def ellipsoid(points: Array) -> Array:
    """Residuals of a stretched bowl; its least point is in the unit cube but for the last coordinate."""
    centre = np.full(points.shape[1], 0.8)
    centre[-1] = 1.2
    return np.asarray((points - centre) * 10 ** np.linspace(0, 1.5, points.shape[1]))


def searched(problem: Any, solver: Solver[Any, Any], state: SearchState | None = None) -> list[SearchState]:
    """All states of a search, from its beginning or from a state on."""
    search, states = Search(problem, solver), []
    state = state or SearchState()
    while not state.over:
        state = search.advance(state)
        states.append(state)
    return states


def through_bytes(state: SearchState) -> SearchState:
    """The state as another process would read it."""
    return unpack(pack(state, VERSION), VERSION, SearchState)


def content(state: SearchState) -> bytes:
    """A state as bytes, without its wall time, which no two runs share."""
    return pack(replace(state, wall_s=0.0), VERSION)
