"""Multi-start Levenberg-Marquardt in a box that follows curved valleys; all starts fly as one batch.

Levenberg (1944), Marquardt (1963): J(x) is lowered by the step s that minimises |r + D s|^2 + mu |s|^2. Few
directions of such a problem are stiff and many are loose ("sloppy": Transtrum, Machta & Sethna 2011), and its
valley bends: a step along a loose direction runs up the walls. So each trial step is flown and corrected: by
what its residuals differ from the linear forecast, c = r(x + s) - r - D s, the same least-squares problem is
amended, solved and flown again. The first correction is the geodesic acceleration of Transtrum & Sethna
(2012), the curvature taken from the flight itself; more of them reuse a Jacobian as the multi-step method of
Fan (2012) does. A correction costs one flight, a Jacobian d.

The damping is Levenberg's (equal in all coordinates, which are of order one), not Marquardt's: scaled by the
Jacobian's columns it would let a coordinate that the samples hardly see run far off. Several damping values
are tried at once, since a wider batch costs hardly more than a narrow one. Bounds by the active set (a
coordinate at its bound whose descent leads outward is held).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Residuals = Callable[[Array], Array]  # search points (p, d) -> residuals (p, m)

# forward-difference step in coordinates of order one: residuals are good to 1e-12, and a slope is off by half
# a step times their second derivative
PROBE = 1e-5
DAMPING_TRIALS = tuple(float(factor) for factor in 10.0 ** np.linspace(-2.0, 2.0, 8))  # times the present one
CORRECTIONS = 2  # of each trial step, by what its flight differs from the forecast
FIRST_DAMPING = 1e-3  # in units of the sum of the squares of the Jacobian
LEAST_DAMPING, MOST_DAMPING = 1e-14, 1e6
STALLED = 0.01  # relative decrease of the cost that counts as none: past it, only unseen directions drift
PATIENCE = 3  # iterations without decrease before a start has converged
EXACT_RMS = 1e-8  # residuals below it are those of the arithmetic: nothing is left to fit


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
    before = np.einsum("sm,sm->s", error, error)
    dampings = np.clip(state.damping[chosen, None] * DAMPING_TRIALS, LEAST_DAMPING, MOST_DAMPING)  # (s, t)
    found, after, winner = _best_trials(points, error, jacobian, dampings, lower, upper, residuals)
    improved = after < before
    point, cost = state.point.copy(), state.cost.copy()
    damping, stalled = state.damping.copy(), state.stalled.copy()
    point[chosen] = np.where(improved[:, None], found, points)
    cost[chosen] = np.where(improved, after, before)
    raised = dampings[:, -1] * DAMPING_TRIALS[-1]
    lowered = dampings[np.arange(chosen.size), winner]
    damping[chosen] = np.clip(np.where(improved, lowered, raised), LEAST_DAMPING, MOST_DAMPING)
    stalled[chosen] = np.where(before - after < STALLED * before, stalled[chosen] + 1, 0)
    stalled[chosen[cost[chosen] < error.shape[1] * EXACT_RMS**2]] = PATIENCE
    return PolishState(point, cost, damping, stalled, state.iteration + 1)


def _best_trials(
    points: Array,
    error: Array,
    jacobian: Array,
    dampings: Array,
    lower: Array,
    upper: Array,
    residuals: Residuals,
) -> tuple[Array, Array, NDArray[np.int64]]:
    """Fly steps of every damping (s, t) from points (s, d), and their corrections.

    Gives for each start its best point (s, d), the cost there (s,) and which damping led to it (s,).
    """
    (count, trials), d = dampings.shape, points.shape[1]
    squares = jacobian.transpose(0, 2, 1) @ jacobian
    # the floor is for samples that see nothing at all
    scale = np.maximum(np.trace(squares, axis1=1, axis2=2), np.finfo(float).tiny / LEAST_DAMPING)
    best, least = points.copy(), np.full(count, np.inf)
    winner = np.zeros(count, dtype=np.int64)
    rows = np.arange(count)
    assumed = np.repeat(
        error[:, None, :], trials, axis=1
    )  # residuals at no step, as if there were no curvature
    for _ in range(CORRECTIONS + 1):
        gradients = assumed @ jacobian
        tried = np.array(
            [
                [
                    _step(points[i], gradients[i, t], squares[i], scale[i] * dampings[i, t], lower, upper)
                    for t in range(trials)
                ]
                for i in range(count)
            ]
        )
        flown = residuals(tried.reshape(-1, d)).reshape(count, trials, -1)
        costs = np.einsum("stm,stm->st", flown, flown)
        leader = np.argmin(costs, axis=1)
        better = costs[rows, leader] < least
        best = np.where(better[:, None], tried[rows, leader], best)
        least = np.where(better, costs[rows, leader], least)
        winner = np.where(better, leader, winner)
        assumed = flown - (tried - points[:, None, :]) @ jacobian.transpose(0, 2, 1)
    return best, least, winner


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


def _step(x: Array, gradient: Array, squares: Array, damping: float, lower: Array, upper: Array) -> Array:
    """Where one damped Gauss-Newton step from x leads, in the box.

    A coordinate that would leave the box stops at its bound, and the others make up for it.
    """
    free = ~(((x <= lower) & (gradient > 0)) | ((x >= upper) & (gradient < 0)))
    system = squares + damping * np.eye(x.size)
    move = np.zeros_like(x)
    while free.any():
        pull = gradient[free] + system[np.ix_(free, ~free)] @ move[~free]
        move[free] = np.linalg.solve(system[np.ix_(free, free)], -pull)
        leaving = free & ((x + move < lower) | (x + move > upper))
        if not leaving.any():
            break
        move[leaving] = np.clip(x + move, lower, upper)[leaving] - x[leaving]
        free &= ~leaving
    return np.clip(x + move, lower, upper)
