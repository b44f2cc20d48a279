"""Multi-start Levenberg-Marquardt in a box, all starts and all finite differences flown as one batch.

Marquardt (1963) with Nielsen's damping, bounds by the active set (a coordinate at its bound whose descent
leads outward is held). Several damping values are tried at once, since a wider batch costs hardly more than a
narrow one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Residuals = Callable[[Array], Array]  # search points (p, d) -> residuals (p, m)

PROBE = 1e-4  # forward-difference step in coordinates of order one; residuals are good to 1e-12
DAMPING_TRIALS = (0.03, 0.3, 3.0, 30.0)  # times each start's present damping
FIRST_DAMPING = 1e-2
LEAST_DAMPING, MOST_DAMPING = 1e-10, 1e8
STALLED = 0.05  # relative decrease of the cost that counts as none: past it, only unseen directions drift
PATIENCE = 3  # iterations without decrease before a start has converged


@dataclass(frozen=True)
class PolishState:
    """Starts s of a multi-start polish: points (s, d); costs, dampings, stalls (s,); the iteration."""

    point: Array
    cost: Array
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


def first_polish(points: Array, cost: Array) -> PolishState:
    """Starts at given points (s, d) with known costs (s,)."""
    count = points.shape[0]
    return PolishState(points, cost, np.full(count, FIRST_DAMPING), np.zeros(count, dtype=np.int64), 0)


def next_polish(
    state: PolishState, lower: Array, upper: Array, residuals: Residuals, keep: int
) -> PolishState:
    """One iteration of the ``keep`` best starts that still move; the others rest."""
    order = np.argsort(state.cost, kind="stable")[:keep]
    chosen = order[state.active[order]]
    if chosen.size == 0:
        return state
    points = state.point[chosen]
    error, jacobian = differences(points, upper, residuals)
    trials, factors = [], []
    for factor in DAMPING_TRIALS:
        trials.append(
            np.stack(
                [
                    _step(x, r, j, factor * damping, lower, upper)
                    for x, r, j, damping in zip(points, error, jacobian, state.damping[chosen], strict=True)
                ]
            )
        )
        factors.append(factor)
    flown = residuals(np.concatenate(trials))
    tried = np.einsum("pm,pm->p", flown, flown).reshape(len(factors), chosen.size)
    winner = np.argmin(tried, axis=0)
    rows = np.arange(chosen.size)
    before = np.einsum("pm,pm->p", error, error)
    after = tried[winner, rows]
    improved = after < before
    point, cost = state.point.copy(), state.cost.copy()
    damping, stalled = state.damping.copy(), state.stalled.copy()
    point[chosen] = np.where(improved[:, None], np.stack(trials)[winner, rows], points)
    cost[chosen] = np.where(improved, after, before)
    raised = state.damping[chosen] * max(DAMPING_TRIALS) * 2.0
    lowered = state.damping[chosen] * np.array(DAMPING_TRIALS)[winner]
    damping[chosen] = np.clip(np.where(improved, lowered, raised), LEAST_DAMPING, MOST_DAMPING)
    still = ~improved | (before - after < STALLED * before)
    stalled[chosen] = np.where(still, stalled[chosen] + 1, 0)
    return PolishState(point, cost, damping, stalled, state.iteration + 1)


def differences(points: Array, upper: Array, residuals: Residuals) -> tuple[Array, Array]:
    """Residuals (s, m) and their forward-difference Jacobians (s, m, d) at points (s, d), one batch."""
    count, d = points.shape
    # step inward at an upper bound
    steps = np.where(points + PROBE > upper, -PROBE, PROBE)
    probed = points[:, None, :] + np.concatenate(
        [np.zeros((count, 1, d)), steps[:, :, None] * np.eye(d)], axis=1
    )
    flown = residuals(probed.reshape(-1, d)).reshape(count, d + 1, -1)
    jacobian = (flown[:, 1:] - flown[:, :1]) / steps[:, :, None]
    return flown[:, 0], jacobian.transpose(0, 2, 1)


def _step(x: Array, residual: Array, jacobian: Array, damping: float, lower: Array, upper: Array) -> Array:
    """One damped Gauss-Newton step from x, kept in the box."""
    gradient = jacobian.T @ residual
    normal = jacobian.T @ jacobian
    held = ((x <= lower) & (gradient > 0)) | ((x >= upper) & (gradient < 0))
    free = ~held
    move = np.zeros_like(x)
    # a floor under Marquardt's scale: a coordinate that the samples cannot see must not run to its bound
    scale = np.diag(normal) + 1e-6 * np.trace(normal) / x.size + 1e-300
    for _ in range(x.size):
        if not free.any():
            break
        system = normal[np.ix_(free, free)] + damping * np.diag(scale[free])
        move[:] = 0.0
        move[free] = np.linalg.solve(system, -gradient[free])
        leaving = free & (((x + move <= lower) & (x <= lower)) | ((x + move >= upper) & (x >= upper)))
        if not leaving.any():
            break
        free &= ~leaving
    return np.clip(x + move, lower, upper)
