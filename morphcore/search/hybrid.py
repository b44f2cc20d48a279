"""A descent from the known points and, if that ends in a poor fit, another one from screened candidates."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from morphcore.search.checkpoint import stored
from morphcore.search.least_squares import LeastSquares, LeastSquaresState
from morphcore.search.solver import Batch, Outcome, Solver

Array = NDArray[np.float64]

SCREENING = "screen"  # name of the candidate screening in the history of a result


@stored
@dataclass(frozen=True)
class HybridState:
    """The current descent, or the candidate screening between the two.

    Attributes
    ----------
    stage : what comes next.
    centre : (d,) the best guess, around which candidates are drawn.
    descent : the state of the current descent, or of the one that ended before the screening.
    best_cost : lowest cost of all points so far.
    """

    stage: Literal["first", "screening", "second"]
    centre: Array
    descent: LeastSquaresState
    best_cost: float


class Hybrid(Solver[HybridState, Outcome]):
    """Descents, with a screening of candidates in between if the first ends above ``good_cost``.

    Parameters
    ----------
    descent : LeastSquares
    candidates : int
        Number flown around the best guess, from which ``starts`` of the second descent are chosen.
    spread : float
        Standard deviation of the candidates, in search coordinates.
    good_cost : callable
        Gives a cost, when the first descent has ended; a higher one suggests that it ended in a wrong valley.
    seed : int
    """

    def __init__(
        self,
        descent: LeastSquares,
        *,
        candidates: int,
        starts: int,
        spread: float,
        good_cost: Callable[[], float],
        seed: int,
    ) -> None:
        self._descent = descent
        self._candidates, self._starts, self._spread = candidates, starts, spread
        self._good_cost, self._seed = good_cost, seed

    def init(self, known: Outcome) -> HybridState:
        """Start with the descent from the known points."""
        return HybridState("first", known.points[0], self._descent.init(known), float(known.cost.min()))

    def ask(self, state: HybridState) -> Batch:
        """Return the batch of the descent, or the candidates."""
        if state.stage != "screening":
            return self._descent.ask(state.descent)
        drawn = self._spread * even_normals(self._candidates, state.centre.size, self._seed)
        return Batch(np.clip(state.centre + drawn, state.descent.lower, state.descent.upper))

    def tell(self, state: HybridState, outcome: Outcome) -> HybridState:
        """Continue the descent, or start the second one from the best candidates."""
        if state.stage == "screening":
            chosen = np.argsort(outcome.cost, kind="stable")[: self._starts]
            starts = Outcome(outcome.points[chosen], outcome.cost[chosen])
            return replace(state, stage="second", descent=self._descent.init(starts, state.descent.box))
        descent = self._descent.tell(state.descent, outcome)
        best = min(state.best_cost, self._descent.best(descent, outcome)[1])
        poor = state.stage == "first" and self._descent.done(descent) and best > self._good_cost()
        return replace(state, stage="screening" if poor else state.stage, descent=descent, best_cost=best)

    def done(self, state: HybridState) -> bool:
        """Return whether the last descent is over."""
        return state.stage != "screening" and self._descent.done(state.descent)

    def best(self, state: HybridState, outcome: Outcome) -> tuple[Array, float]:
        """Return the descent's best start, or the best candidate."""
        return self._descent.best(state.descent, outcome)

    def replaces(self, state: HybridState) -> bool:
        """Return what the first descent says; the second has to find something better."""
        return state.stage == "first" and self._descent.replaces(state.descent)

    def between_steps(self, state: HybridState) -> bool:
        """Return whether an iteration of the descent, or the screening, has ended."""
        return self._descent.between_steps(state.descent)

    def phase(self, state: HybridState) -> str:
        """Return the descent's name, or the screening's."""
        return SCREENING if state.stage == "screening" else self._descent.phase(state.descent)

    def share(self, state: HybridState) -> float:
        """Return the share of two descents: the second is not always needed."""
        descent = self._descent.share(state.descent)
        return {"first": 0.5 * descent, "screening": 0.5, "second": 0.5 + 0.5 * descent}[state.stage]


def even_normals(count: int, d: int, seed: int) -> Array:
    """Return normal deviates (count, d) from a scrambled Sobol sequence, more even than independent draws."""
    from scipy.stats import (
        qmc,
    )  # half the size of the library, and many searches need no screening

    draws = qmc.MultivariateNormalQMC(np.zeros(d), rng=np.random.default_rng(seed))
    return np.asarray(draws.random(1 << max(count - 1, 0).bit_length())[:count])
