"""The interface of search methods: a value that proposes batches of points and receives their costs.

A solver holds settings only. Everything a search knows is in its state, a plain value: dataclasses marked
`stored`, tuples, dictionaries, arrays, numbers and strings. So a search can be continued from its state in
another process with bit-identical results, and batches can be evaluated anywhere.
"""

from __future__ import annotations

import itertools
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from morphcore.lanes import TOGETHER
from morphcore.search.checkpoint import stored
from morphcore.stopping import Deadline, Stop

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Box:
    """The space to search: ``lower`` and ``upper`` bounds (d,)."""

    lower: Array
    upper: Array

    def from_unit(self, unit: Array) -> Array:
        """Points (p, d) of the box from points of the unit cube."""
        return np.asarray(self.lower + (self.upper - self.lower) * unit)

    def to_unit(self, points: Array) -> Array:
        """Points (p, d) of the unit cube from points of the box."""
        return np.asarray((points - self.lower) / (self.upper - self.lower))


@dataclass(frozen=True)
class Batch:
    """Points (p, d) to be evaluated; ``residuals`` requests residuals in addition to costs."""

    points: Array
    residuals: bool = False

    def parts(self, max_parts: int) -> list[Array]:
        """Split the points into parts of similar size, each of which any process may evaluate on its own.

        A part consists of whole blocks of SIMD lanes, so that each model flies in the same block, with the
        same neighbours, as when one process flies them all. Otherwise the data shared by a block's lanes (the
        strips that any of them touches) could differ.

        Parameters
        ----------
        max_parts : int

        Returns
        -------
        At most ``max_parts`` arrays (k, d), none of them empty, in the order of the points.
        """
        blocks = -(-self.points.shape[0] // TOGETHER)
        count = max(1, min(max_parts, blocks))
        bounds = np.arange(count + 1) * blocks // count * TOGETHER
        return [self.points[low:high] for low, high in itertools.pairwise(bounds)]


@stored
@dataclass(frozen=True)
class Outcome:
    """An evaluated batch.

    Attributes
    ----------
    points : (p, d) as evaluated. A problem may repair points that it cannot evaluate.
    cost : (p,)
    residuals : (p, m), if they were requested.
    evaluations : number of points evaluated, repairs included.
    """

    points: Array
    cost: Array
    residuals: Array | None = None
    evaluations: int = 0


State = TypeVar("State")
Result = TypeVar("Result", bound=Outcome)
Result_co = TypeVar("Result_co", bound=Outcome, covariant=True)


class Solver(ABC, Generic[State, Result]):
    """A search method.

    A method defines `init`, `ask`, `tell` and `done`; the rest has defaults that suit a method whose batches
    are generations of candidates.
    """

    name = "search"  # name of its steps, in progress and in the history of a result

    @abstractmethod
    def init(self, known: Result) -> State:
        """Return the first state, given evaluated points of which the first is the best guess."""

    @abstractmethod
    def ask(self, state: State) -> Batch:
        """Return the next batch to evaluate."""

    @abstractmethod
    def tell(self, state: State, outcome: Result) -> State:
        """Return the state after evaluation of the batch that the present state proposed."""

    @abstractmethod
    def done(self, state: State) -> bool:
        """Return whether the search is over."""

    def best(self, state: State, outcome: Result) -> tuple[Array, float]:
        """Return the best point (d,) that the last outcome led to, and its cost; infinite if there is none.

        ``state`` : the state after that outcome.
        """
        del state
        minimum = int(np.argmin(outcome.cost))
        return outcome.points[minimum], float(outcome.cost[minimum])

    def replaces(self, state: State) -> bool:
        """Return whether its best takes the place of what was found before even where that costs less.

        So it is where a solver weighs more than the cost: what is known beforehand.
        """
        del state
        return False

    def between_steps(self, state: State) -> bool:
        """Return whether a step ends here; a step may take several batches."""
        del state
        return True

    def phase(self, state: State) -> str:
        """Return the name of the step that comes next."""
        del state
        return self.name

    def share(self, state: State) -> float:
        """Return the estimated progress of the search, 0..1."""
        del state
        return 0.0

    def remarks(self, outcome: Result) -> dict[str, float]:
        """Return further history entries for a step that ended with an outcome."""
        del outcome
        return {}


class Problem(Protocol[Result_co]):
    """A search problem."""

    @property
    def box(self) -> Box:
        """The bounds of the search."""
        ...

    @property
    def flights_each(self) -> int:
        """Number of flights per evaluation of a point."""
        ...

    def arranged(self, points: Array) -> Array:
        """Return random points (p, d) of the box, or of the unit cube, with coordinates in a useful order."""
        ...

    def prepare(self, deadline: Deadline) -> Any:
        """Return the choices to be made before the first evaluation, a plain value kept in the state."""
        ...

    def first(self) -> Batch:
        """Return the points to evaluate before any method starts, the best guess first."""
        ...

    def evaluate(self, batch: Batch, stop: Stop | None) -> Result_co:
        """Evaluate a batch.

        Raises
        ------
        Interrupted : ``stop`` returned True.
        """
        ...
