"""The searches that a goal needs, one after the other, each chosen from the results of the earlier ones."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from morphcore.errors import InvalidInput
from morphcore.optimise.flights import SAMPLE_S, MorphFlights
from morphcore.optimise.limits import MorphSpace
from morphcore.search.checkpoint import stored
from morphdata.optimize import Morph

Array = NDArray[np.float64]
ModelName = Literal["equivalent", "rigid"]

TICK_S = SAMPLE_S  # durations are compared in whole samples: in between, the sums have the same rows


@stored
@dataclass(frozen=True)
class Task:
    """A search to be run: its model and its duration in s."""

    model: ModelName
    duration_s: float


@stored
@dataclass(frozen=True)
class Found:
    """The result of a search: its best point (d,), the weighted cost J, and the unweighted variation (rad^2).

    If no schedule satisfies the torque limit, cost and variation are infinite and ``torque`` is the lowest
    peak seen, N m. They are also infinite if the best flight ``diverged``.
    """

    model: ModelName
    duration_s: float
    point: Array
    cost: float
    variation: float
    torque: float
    diverged: bool = False

    @property
    def feasible(self) -> bool:
        """Whether a schedule satisfies all limits."""
        return bool(np.isfinite(self.cost))

    def varied(self, space: MorphSpace, flights: MorphFlights) -> Found:
        """Return a copy with its variation, which takes one flight."""
        if not self.feasible:
            return self
        flown = flights.fly([space.schedule(self.point)], torque=False)
        if flown.diverged[0]:
            return replace(self, cost=np.inf, variation=np.inf, diverged=True)
        return replace(self, variation=float(flown.variation[0]))


def durations(morph: Morph, shortest_s: float) -> Array:
    """Return the durations, s, that a goal may choose from, ascending; the longest is the morph's own."""
    if morph.goal == "variation":
        return np.array([morph.duration_s])
    first, last = int(np.ceil(shortest_s / TICK_S - 1e-9)), int(np.floor(morph.duration_s / TICK_S + 1e-9))
    ticks = TICK_S * np.arange(first, last + 1)
    if ticks.size == 0 or morph.duration_s - ticks[-1] > 1e-9:
        ticks = np.append(ticks, morph.duration_s)
    if morph.goal == "minimum_time":
        return np.asarray(ticks, dtype=np.float64)
    rows = np.unique(np.round(np.linspace(0, ticks.size - 1, morph.front_points)).astype(np.int64))
    return np.asarray(ticks[rows], dtype=np.float64)


def next_task(morph: Morph, choice: Array, found: tuple[Found, ...]) -> Task | None:
    """Return the next search; None when the goal is reached.

    The last is always the rigid model's for the chosen duration, for comparison.

    Raises
    ------
    InvalidInput : no morph meets the goal.
    """
    done = {round(item.duration_s, 6): item for item in found if item.model == "equivalent"}
    if morph.goal == "minimum_time":
        wanted = _bisected(morph, choice, done)
    else:
        wanted = next((float(t) for t in choice if round(float(t), 6) not in done), None)
    if wanted is not None:
        return Task("equivalent", wanted)
    if any(item.model == "rigid" for item in found):
        return None
    return Task("rigid", chosen(morph, found).duration_s)


def chosen(morph: Morph, found: tuple[Found, ...]) -> Found:
    """Return the search whose schedule is the result, or is the best so far while searches remain."""
    searched = sorted((item for item in found if item.model == "equivalent"), key=lambda f: f.duration_s)
    searched = [item for item in searched if item.feasible] or searched
    if morph.goal == "minimum_time":
        return next((item for item in searched if _is_calm(morph, item)), searched[-1])
    return searched[-1]


def _is_calm(morph: Morph, item: Found) -> bool:
    return morph.max_variation_rad2 is None or item.variation <= morph.max_variation_rad2


def _bisected(morph: Morph, choice: Array, done: dict[float, Found]) -> float | None:
    """Return the next duration to try for the shortest that is calm enough; None when it is known.

    First the shortest, then the longest, then bisection between the longest that is not calm enough and the
    shortest that is. The next shorter duration than the one found has been searched too and is not calm
    enough.
    """
    known = [done.get(round(float(t), 6)) for t in choice]
    for end in (0, len(known) - 1):
        if known[end] is None:
            return float(choice[end])
        if end == 0 and _is_calm(morph, known[0]):  # type: ignore[arg-type]
            return None
    calm = [i for i, item in enumerate(known) if item is not None and _is_calm(morph, item)]
    if not calm:
        minimum = min((item for item in known if item is not None), key=lambda item: item.variation)
        raise InvalidInput(
            f"no morph of {choice[0]:.4g} to {choice[-1]:.4g} s stays below "
            f"{morph.max_variation_rad2:g} rad^2: the minimum found is {minimum.variation:.4g} rad^2 "
            f"in {minimum.duration_s:.4g} s",
            pointer="/morph/max_variation_rad2",
            hint=f"raise it to {1.01 * minimum.variation:.3g} or more, or loosen the limits",
        )
    high = min(calm)
    low = max(i for i, item in enumerate(known) if item is not None and i < high)
    return float(choice[(low + high) // 2]) if high - low > 1 else None


def planned(morph: Morph, choices: int) -> int:
    """Return roughly how many searches a goal takes, for a given number of candidate durations."""
    if morph.goal == "minimum_time":
        return 3 + int(np.ceil(np.log2(max(choices, 2))))
    return choices + 1


def warm_starts(space: MorphSpace, found: tuple[Found, ...]) -> Array:
    """Return points (w, d) to start a search from, taken from the search with the nearest duration, if any.

    They are its shape unchanged, and the same schedule at its own pace, timed so that both end together.
    """
    like = [item for item in found if item.model == "equivalent" and item.feasible]
    if not like:
        return np.zeros((0, space.dimension))
    near = min(like, key=lambda item: abs(item.duration_s - space.duration_s))
    ratio = near.duration_s / space.duration_s
    later = near.point.copy()
    later[: space.inner] = 1.0 - ratio * (1.0 - later[: space.inner])
    return np.stack([near.point, later]) if ratio != 1.0 else near.point[None, :]
