"""Multi-start Levenberg-Marquardt in a box that follows curved valleys; all starts are one batch.

Levenberg (1944), Marquardt (1963): J(x) is lowered by the step s that minimises |r + D s|^2 + mu |s|^2. Few
directions of such a problem are stiff and many are loose ("sloppy": Transtrum, Machta & Sethna 2011), and its
valley bends: a step along a loose direction runs up the walls. So each trial step is flown and corrected: the
difference of its residuals from the linear forecast, c = r(x + s) - r - D s, is added to the same
least-squares problem, which is solved and flown again. The first correction is the geodesic acceleration of
Transtrum & Sethna (2012), the curvature taken from the flight itself; more of them reuse a Jacobian as the
multi-step method of Fan (2012) does. A correction costs one flight, a Jacobian d.

The damping is Levenberg's (equal in all coordinates, which are of order one), not Marquardt's: scaled by the
Jacobian's columns it would let a coordinate that the samples hardly see run far off. Several damping values
are tried at once, since a wider batch costs hardly more than a narrow one. Bounds by the active set (a
coordinate at its bound whose descent leads outward is held). A bound is widened, within the limits of the
problem, where a start has been pushed against it for a whole iteration.

What is known beforehand enters as a prior: residuals of its own, whose weights may be chosen anew from the
residuals and the Jacobian of each iteration. That costs no flights.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from morphcore.search.checkpoint import stored
from morphcore.search.prior import FixedPrior, Prior
from morphcore.search.solver import Batch, Box, Outcome, Problem, Solver

Array = NDArray[np.float64]
Residuals = Callable[[Array], Array]  # search points (p, d) -> residuals (p, m)

# forward-difference step in coordinates of order one: residuals are accurate to 1e-12, and the error of a
# slope is half a step times the second derivative
PROBE = 1e-5
DAMPING_TRIALS = tuple(float(factor) for factor in 10.0 ** np.linspace(-2.0, 2.0, 8))  # of the present one
CORRECTIONS = 2  # corrections of each trial step by the difference of its flight from the forecast
FIRST_DAMPING = 1e-3  # in units of the sum of squares of the Jacobian
MIN_DAMPING, MAX_DAMPING = 1e-14, 1e6
STALLED = 0.01  # a smaller relative decrease counts as none: only undetermined directions still drift
PATIENCE = 3  # iterations without decrease before a start has converged
EXACT_RMS = 1e-8  # smaller residuals are round-off: nothing is left to fit
# hopeless starts are dropped during the descent: iteration -> starts kept (as a share of the first field)
NARROWING = ((3, 1.0), (6, 0.5))
# of the box's width, by which a bound moves outward when a start is pushed against it
WIDENING = 0.5


@stored
@dataclass(frozen=True)
class TrialSteps:
    """Trial steps of an iteration under way, of s starts with t dampings each.

    Attributes
    ----------
    starts : (s,) indices of the starts that move.
    error, jacobian : (s, m) and (s, m, d) residuals at the starts, and their derivatives.
    dampings : (s, t)
    tried : (s, t, d) the points to be flown next.
    correction : number of corrections made.
    best, cost, winner : (s, d), (s,), (s,) the best trial so far, and the damping that led to it.
    """

    starts: NDArray[np.int64]
    error: Array
    jacobian: Array
    dampings: Array
    tried: Array
    correction: int
    best: Array
    cost: Array
    winner: NDArray[np.int64]


@stored
@dataclass(frozen=True)
class LeastSquaresState:
    """Starts s of a descent.

    Attributes
    ----------
    point, weight : (s, d) where the starts are, and the weights of the prior there.
    cost : (s,) the prior's part included.
    damping, stalled : (s,)
    lower, upper : (d,) the box, which may have been widened.
    iteration : how many there have been.
    trials : of an iteration under way.
    """

    point: Array
    cost: Array
    damping: Array
    stalled: NDArray[np.int64]
    weight: Array
    lower: Array
    upper: Array
    iteration: int = 0
    trials: TrialSteps | None = field(default=None, repr=False)

    @property
    def box(self) -> Box:
        """The box with its bounds as they were widened."""
        return Box(self.lower, self.upper)

    @property
    def best_weight(self) -> Array:
        """(d,) weights of the prior at the best start."""
        return np.asarray(self.weight[int(np.argmin(self.cost))])

    @property
    def active(self) -> NDArray[np.bool_]:
        """(s,) starts that still move."""
        return self.stalled < PATIENCE


class LeastSquares(Solver[LeastSquaresState, Outcome]):
    """Descents from all known points.

    Parameters
    ----------
    problem : provides the box.
    iterations : int
        at most.
    prior : Prior, optional
        What is known beforehand. A weak one settles the directions that the residuals cannot see.
    limits : Box, optional
        How far the box may be widened; None: not at all.
    """

    name = "polish"  # its name in the history of a result

    def __init__(
        self, problem: Problem[Any], iterations: int, prior: Prior | None = None, limits: Box | None = None
    ) -> None:
        self._box = problem.box
        self._limits = self._box if limits is None else limits
        self._iterations = iterations
        nothing = np.zeros_like(self._box.lower)
        self._prior = FixedPrior(nothing, nothing) if prior is None else prior

    def init(self, known: Outcome, box: Box | None = None) -> LeastSquaresState:
        """Start at every point.

        ``box`` : whose bounds were widened before; None for the problem's.
        """
        box = self._box if box is None else box
        count = known.points.shape[0]
        weight = np.tile(self._prior.first, (count, 1))
        return LeastSquaresState(
            known.points,
            known.cost + self._prior_cost(known.points, weight),
            np.full(count, FIRST_DAMPING),
            np.zeros(count, dtype=np.int64),
            weight,
            np.minimum(box.lower, known.points.min(axis=0)),
            np.maximum(box.upper, known.points.max(axis=0)),
        )

    def ask(self, state: LeastSquaresState) -> Batch:
        """Return the starts and their probes, then three rounds of trial steps."""
        if state.trials is None:
            probed, _ = probes(state.point[_moving(state)], state.upper)
            return Batch(probed, residuals=True)
        return Batch(state.trials.tried.reshape(-1, state.lower.size), residuals=True)

    def tell(self, state: LeastSquaresState, outcome: Outcome) -> LeastSquaresState:
        """Take the first trial steps, correct them, or accept the best of them."""
        if outcome.residuals is None:
            raise TypeError("the batch requested residuals")
        if state.trials is None:
            return self._begun(state, outcome.residuals)
        trials = self._judged(state, state.trials, outcome)
        if trials.correction <= CORRECTIONS:
            return replace(state, trials=trials)
        return self._widened(state, _accepted(state, trials))

    def done(self, state: LeastSquaresState) -> bool:
        """Return True when no remaining start moves any more or the iterations are used up."""
        if state.trials is not None:
            return False
        return state.iteration >= self._iterations or _moving(state).size == 0

    def best(self, state: LeastSquaresState, outcome: Outcome) -> tuple[Array, float]:
        """Return the best start after an iteration, with its cost without the prior."""
        if state.trials is None and state.iteration == 0:
            return super().best(state, outcome)
        leader = int(np.argmin(state.cost))
        point = state.point[leader]
        if state.trials is not None:
            return point, np.inf
        return point, float(state.cost[leader] - self._prior_cost(point, state.weight[leader]))

    def replaces(self, state: LeastSquaresState) -> bool:
        """Return whether an iteration has ended: where the weights rise, so may the cost without them."""
        return state.trials is None and state.iteration > 0

    def between_steps(self, state: LeastSquaresState) -> bool:
        """Return whether an iteration has ended."""
        return state.trials is None

    def share(self, state: LeastSquaresState) -> float:
        """Return the completed share of the iterations."""
        return state.iteration / self._iterations

    def _prior_cost(self, points: Array, weight: Array) -> Array:
        """What points (..., d) cost for being off the prior's, (...)."""
        return np.asarray(np.sum(weight * (points - self._prior.point) ** 2, axis=-1))

    def _prior_errors(self, points: Array, weight: Array) -> Array:
        """The same as residuals (..., d)."""
        return np.asarray(np.sqrt(weight) * (points - self._prior.point))

    def _begun(self, state: LeastSquaresState, residuals: Array) -> LeastSquaresState:
        """Choose the prior's weights at the starts, and damped steps from there and their probes."""
        starts = _moving(state)
        points = state.point[starts]
        error, jacobian = _differences(residuals, probes(points, state.upper)[1])
        weight = state.weight.copy()
        for k, start in enumerate(starts):
            if state.stalled[start]:
                continue  # weights that went on changing would keep it from coming to rest
            offset = points[k] - self._prior.point
            weight[start] = self._prior.weights(error[k], jacobian[k], offset, state.weight[start])
        own = weight[starts]
        error = np.concatenate([error, self._prior_errors(points, own)], axis=1)
        slope = np.sqrt(own)[:, :, None] * np.eye(points.shape[1])
        jacobian = np.concatenate([jacobian, slope], axis=1)
        dampings = np.clip(state.damping[starts, None] * DAMPING_TRIALS, MIN_DAMPING, MAX_DAMPING)
        # as if there were no curvature
        assumed = np.repeat(error[:, None, :], dampings.shape[1], axis=1)
        trials = TrialSteps(
            starts,
            error,
            jacobian,
            dampings,
            self._steps(state, points, jacobian, dampings, assumed),
            correction=0,
            best=points.copy(),
            cost=np.full(starts.size, np.inf),
            winner=np.zeros(starts.size, dtype=np.int64),
        )
        return replace(state, weight=weight, trials=trials)

    def _judged(self, state: LeastSquaresState, trials: TrialSteps, outcome: Outcome) -> TrialSteps:
        """Return the trials with the best of the flown ones, and with corrected steps to be flown next."""
        points, tried = state.point[trials.starts], trials.tried
        count, tests = trials.dampings.shape
        rows = np.arange(count)
        prior = self._prior_errors(tried, state.weight[trials.starts, None])
        measured = np.asarray(outcome.residuals).reshape(count, tests, -1)
        flown = np.concatenate([measured, prior], axis=2)
        costs = np.einsum("stm,stm->st", flown, flown)
        leader = np.argmin(costs, axis=1)
        better = costs[rows, leader] < trials.cost
        correction = trials.correction + 1
        if correction <= CORRECTIONS:
            assumed = flown - (tried - points[:, None, :]) @ trials.jacobian.transpose(0, 2, 1)
            tried = self._steps(state, points, trials.jacobian, trials.dampings, assumed)
        return replace(
            trials,
            tried=tried,
            correction=correction,
            best=np.where(better[:, None], trials.tried[rows, leader], trials.best),
            cost=np.where(better, costs[rows, leader], trials.cost),
            winner=np.where(better, leader, trials.winner),
        )

    def _steps(
        self, state: LeastSquaresState, points: Array, jacobian: Array, dampings: Array, assumed: Array
    ) -> Array:
        """Return where steps of all dampings (s, t) lead from points (s, d), (s, t, d).

        ``assumed`` : (s, t, m) residuals of the linear model at zero step.
        """
        squares = jacobian.transpose(0, 2, 1) @ jacobian
        # the floor covers samples that determine nothing at all
        scale = np.maximum(np.trace(squares, axis1=1, axis2=2), np.finfo(float).tiny / MIN_DAMPING)
        gradients = assumed @ jacobian
        return np.array(
            [
                [
                    _step(x, gradient, square, unit * damping, state.lower, state.upper)
                    for gradient, damping in zip(of_start, row, strict=True)
                ]
                for x, of_start, square, unit, row in zip(
                    points, gradients, squares, scale, dampings, strict=True
                )
            ]
        )

    def _widened(self, before: LeastSquaresState, after: LeastSquaresState) -> LeastSquaresState:
        """Return the state with wider bounds where a start was at one before and after an iteration."""
        held = {
            side: np.any((before.point == bound) & (after.point == bound), axis=0) & (bound != limit)
            for side, bound, limit in (
                ("lower", before.lower, self._limits.lower),
                ("upper", before.upper, self._limits.upper),
            )
        }
        if not (held["lower"].any() or held["upper"].any()):
            return after
        reach = WIDENING * (self._box.upper - self._box.lower)
        at_one = ((before.point == before.lower) & held["lower"]) | (
            (before.point == before.upper) & held["upper"]
        )
        return replace(
            after,
            lower=np.where(held["lower"], np.maximum(before.lower - reach, self._limits.lower), before.lower),
            upper=np.where(held["upper"], np.minimum(before.upper + reach, self._limits.upper), before.upper),
            stalled=np.where(np.any(at_one, axis=1), 0, after.stalled),
        )


def _moving(state: LeastSquaresState) -> NDArray[np.int64]:
    """Return the remaining starts (s,) that still move, best first."""
    share = next((share for limit, share in NARROWING if state.iteration < limit), 0.0)
    keep = max(1, round(share * state.cost.size))
    order = np.argsort(state.cost, kind="stable")[:keep]
    return np.asarray(order[state.active[order]])


def _accepted(state: LeastSquaresState, trials: TrialSteps) -> LeastSquaresState:
    """Return the state after an iteration; each start moves to its best trial if that is an improvement."""
    chosen, dampings = trials.starts, trials.dampings
    before = np.einsum("sm,sm->s", trials.error, trials.error)
    improved = trials.cost < before
    point, cost = state.point.copy(), state.cost.copy()
    damping, stalled = state.damping.copy(), state.stalled.copy()
    point[chosen] = np.where(improved[:, None], trials.best, state.point[chosen])
    cost[chosen] = np.where(improved, trials.cost, before)
    raised = dampings[:, -1] * DAMPING_TRIALS[-1]
    lowered = dampings[np.arange(chosen.size), trials.winner]
    damping[chosen] = np.clip(np.where(improved, lowered, raised), MIN_DAMPING, MAX_DAMPING)
    stalled[chosen] = np.where(before - trials.cost < STALLED * before, stalled[chosen] + 1, 0)
    stalled[chosen[cost[chosen] < trials.error.shape[1] * EXACT_RMS**2]] = PATIENCE
    return replace(
        state,
        point=point,
        cost=cost,
        damping=damping,
        stalled=stalled,
        iteration=state.iteration + 1,
        trials=None,
    )


def differences(points: Array, upper: Array, residuals: Residuals) -> tuple[Array, Array]:
    """Return residuals (s, m) and forward-difference Jacobians (s, m, d) at points (s, d), in one batch."""
    probed, steps = probes(points, upper)
    return _differences(residuals(probed), steps)


def probes(points: Array, upper: Array) -> tuple[Array, Array]:
    """Return points (s (1 + d), d), each of (s, d) followed by its probes, and the probes' steps (s, d)."""
    count, d = points.shape
    # step inward at an upper bound
    steps = np.where(points + PROBE > upper, -PROBE, PROBE)
    probed = points[:, None, :] + np.concatenate(
        [np.zeros((count, 1, d)), steps[:, :, None] * np.eye(d)], axis=1
    )
    return probed.reshape(-1, d), steps


def _differences(residuals: Array, steps: Array) -> tuple[Array, Array]:
    flown = residuals.reshape(steps.shape[0], steps.shape[1] + 1, -1)
    jacobian = (flown[:, 1:] - flown[:, :1]) / steps[:, :, None]
    return flown[:, 0], jacobian.transpose(0, 2, 1)


def _step(x: Array, gradient: Array, squares: Array, damping: float, lower: Array, upper: Array) -> Array:
    """Return where one damped Gauss-Newton step from x leads, in the box.

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
