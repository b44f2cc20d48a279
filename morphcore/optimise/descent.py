"""Gauss-Newton descent under limits, from several starts at once.

The departures of a flight are residuals, so that the finite differences of one flight for each unknown give
a quadratic model of the cost. Its minimum is sought under the *exact* limits, which cost no flight
(sequential quadratic programming), and under the hinge torque's history, linear like the departures.
Marquardt's damping (1963) keeps the step where the model holds; several dampings are flown side by side.
Every schedule that is flown, probes included, keeps the limits of rate, acceleration and sign.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from morphcore.optimise.limits import MorphSpace
from morphcore.optimise.torque_limit import TorqueLimit, Trials

Array = NDArray[np.float64]
Fly = Callable[[Array], Trials]

# probe of the differences and the slack that its base needs: knots that stand closely take the smaller ones
PROBES = ((1e-6, 1e-3), (1e-7, 1e-3), (1e-7, 1e-4), (1e-8, 1e-5))
MARGIN = (
    1e-7  # relative, left by a step: far below what a limit is known to, far above the solver's tolerance
)
DAMPING_TRIALS = (0.03, 0.3, 3.0)  # times each start's present damping
FIRST_DAMPING = 3e-2
LEAST_DAMPING, MOST_DAMPING = 1e-8, 1e6
STALLED = 1e-4  # relative decrease of the cost that counts as none
PATIENCE = 2  # iterations without decrease before a start has converged
LEAST_COST = 1e-12  # rad^2: below, nothing is left to be gained
STILL = 1e-9  # a step shorter than this is none; unknowns are shares of duration and change


@dataclass(frozen=True)
class DescentState:
    """Starts s of a descent: points (s, d) that keep all limits; costs, dampings, stalls (s,)."""

    point: Array
    cost: Array
    torque: Array
    damping: Array
    stalled: NDArray[np.int64]
    iteration: int

    @property
    def active(self) -> NDArray[np.bool_]:
        """(s,) starts that still move."""
        return self.stalled < PATIENCE

    @property
    def best(self) -> int:
        """The start with the least cost."""
        return int(np.argmin(self.cost))


@dataclass(frozen=True)
class _Linear:
    """Errors and torques near a base: ``value + gradient (z - base)``; (m,) and (m, d)."""

    base: Array
    errors: Array
    errors_gradient: Array
    torque: Array
    torque_gradient: Array


def first_descent(points: Array, trials: Trials) -> DescentState:
    """Starts at points (s, d) that were flown already."""
    count = points.shape[0]
    return DescentState(
        points,
        trials.cost,
        trials.peak,
        np.full(count, FIRST_DAMPING),
        np.zeros(count, dtype=np.int64),
        0,
    )


def next_descent(
    state: DescentState, space: MorphSpace, limit: TorqueLimit, fly: Fly, keep: int
) -> DescentState:
    """One iteration of the ``keep`` best starts that still move; the others rest."""
    order = np.argsort(state.cost, kind="stable")[:keep]
    chosen = order[state.active[order]]
    if chosen.size == 0:
        return state
    models = _linearised(space, state.point[chosen], fly)
    tried = np.stack([state.point[chosen]] * len(DAMPING_TRIALS))  # (trials, starts, d)
    for i, (start, model) in enumerate(zip(chosen, models, strict=True)):
        if model is not None:
            for k, factor in enumerate(DAMPING_TRIALS):
                damping = factor * state.damping[start]
                tried[k, i] = _step(space, limit, state.point[start], state.cost[start], model, damping)
    shape = tried.shape[:2]
    anchors = np.tile(state.point[chosen], (len(DAMPING_TRIALS), 1))
    held = Trials.known(
        np.tile(state.cost[chosen], len(DAMPING_TRIALS)), np.tile(state.torque[chosen], len(DAMPING_TRIALS))
    )
    flat = tried.reshape(-1, space.dimension)
    moved = np.abs(flat - anchors).max(axis=1) > STILL
    points, cost, peak = flat.copy(), held.cost.copy(), held.peak.copy()
    if moved.any():
        points[moved], trials = limit.kept(space, flat[moved], anchors[moved], held.select(moved), fly)
        cost[moved], peak[moved] = trials.cost, trials.peak
    return _accepted(state, chosen, points.reshape(*shape, -1), cost.reshape(shape), peak.reshape(shape))


def _accepted(
    state: DescentState, chosen: NDArray[np.int64], points: Array, tried: Array, peak: Array
) -> DescentState:
    """The state after trials (trials, starts): the best of each start where it is better."""
    rows = np.arange(chosen.size)
    winner = np.argmin(tried, axis=0)
    before, after = state.cost[chosen], tried[winner, rows]
    improved = after < before
    point, cost, torque = state.point.copy(), state.cost.copy(), state.torque.copy()
    damping, stalled = state.damping.copy(), state.stalled.copy()
    point[chosen] = np.where(improved[:, None], points[winner, rows], state.point[chosen])
    cost[chosen] = np.where(improved, after, before)
    torque[chosen] = np.where(improved, peak[winner, rows], state.torque[chosen])
    lowered = state.damping[chosen] * np.array(DAMPING_TRIALS)[winner]
    raised = state.damping[chosen] * max(DAMPING_TRIALS) ** 2
    damping[chosen] = np.clip(np.where(improved, lowered, raised), LEAST_DAMPING, MOST_DAMPING)
    still = before - after <= STALLED * before
    stalled[chosen] = np.where(still, stalled[chosen] + 1, 0)
    return DescentState(point, cost, torque, damping, stalled, state.iteration + 1)


def probes_of(space: MorphSpace, point: Array) -> tuple[Array, Array] | None:
    """Points (1 + d, d), a base near the given one and its probes, and their steps (d,); all keep the limits.

    None where the limits leave no room for any.
    """
    for length, margin in PROBES:
        base = space.nearest(point, margin)
        if base is None:
            continue
        ahead, behind = base + length * np.eye(base.size), base - length * np.eye(base.size)
        forward = space.keeps(ahead)
        if np.all(forward | space.keeps(behind)):
            probes = np.where(forward[:, None], ahead, behind)
            return np.concatenate([base[None, :], probes]), np.where(forward, length, -length)
    return None


def linear_model(trials: Trials, points: Array, steps: Array) -> _Linear:
    """Differences of flights at a base and its probes."""
    return _Linear(
        points[0],
        trials.errors[0],
        ((trials.errors[1:] - trials.errors[0]) / steps[:, None]).T,
        trials.torque[0],
        ((trials.torque[1:] - trials.torque[0]) / steps[:, None]).T,
    )


def _linearised(space: MorphSpace, points: Array, fly: Fly) -> list[_Linear | None]:
    """A linear model near each point (s, d), all flights as one batch."""
    probed = [probes_of(space, point) for point in points]
    some = [item for item in probed if item is not None]
    if not some:
        return [None] * len(probed)
    flown = fly(np.concatenate([batch for batch, _ in some]))
    models: list[_Linear | None] = []
    first = 0
    for item in probed:
        if item is None:
            models.append(None)
            continue
        count = item[0].shape[0]
        models.append(linear_model(flown.select(slice(first, first + count)), *item))
        first += count
    return models


def _step(
    space: MorphSpace, limit: TorqueLimit, point: Array, cost: float, model: _Linear, damping: float
) -> Array:
    """The minimum (d,) of the damped quadratic model under the limits, made to keep them exactly."""
    J, cost = model.errors_gradient, max(cost, LEAST_COST)
    normal = J.T @ J / cost
    toward = J.T @ model.errors / cost
    # a floor under Marquardt's scale: an unknown that the attitude does not see must not run to its bound
    scale = damping * (np.diag(normal) + 1e-6 * np.trace(normal) / point.size)

    def value(z: Array) -> float:
        move, change = z - model.base, z - point
        return float(0.5 * (move @ normal @ move) + toward @ move + 0.5 * (change @ (scale * change)))

    def slope(z: Array) -> Array:
        return np.asarray(normal @ (z - model.base) + toward + scale * (z - point))

    found = space.constrained(
        value, slope, model.base, MARGIN, limit.linear(model.base, model.torque, model.torque_gradient)
    )
    return space.put_back(found, point)
