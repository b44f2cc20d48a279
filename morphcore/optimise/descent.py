"""Gauss-Newton descent under limits, from several starts at once.

The departures of a flight are residuals, so that the finite differences of one flight for each unknown give a
quadratic model of the cost. Its minimum is found under the *exact* limits, which cost no flight (sequential
quadratic programming), and under the hinge torque's history, linear like the departures. Marquardt's damping
(1963) keeps the step where the model is valid; several damping values are flown in parallel. Every schedule
that is flown, probes included, keeps the limits of rate, acceleration and sign.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from morphcore.optimise.limits import MorphSpace
from morphcore.optimise.torque_limit import Anchored, TorqueLimit, Trials
from morphcore.search.checkpoint import stored
from morphcore.search.solver import Batch, Solver

Array = NDArray[np.float64]

# finite-difference steps and the slack that the base point needs; closely spaced knots use the smaller ones
PROBES = ((1e-6, 1e-3), (1e-7, 1e-3), (1e-7, 1e-4), (1e-8, 1e-5))
MARGIN = (
    1e-7  # relative slack left by a step: far below the limits' accuracy, far above the solver's tolerance
)
DAMPING_TRIALS = (0.03, 0.3, 3.0)  # multiples of each start's present damping
FIRST_DAMPING = 3e-2
MIN_DAMPING, MAX_DAMPING = 1e-8, 1e6
STALLED = 1e-4  # a smaller relative decrease of the cost counts as none
PATIENCE = 2  # iterations without decrease before a start has converged
MIN_COST = 1e-12  # rad^2: below this there is nothing left to gain
STILL = 1e-9  # shorter steps count as none; the unknowns are shares of duration and change
# the field of starts narrows during the descent: iteration -> starts kept (as a share of the first field)
NARROWING = ((5, 1.0), (10, 0.5))
USUAL_ITERATIONS = 8  # typical number in a descent, for the displayed progress


@stored
@dataclass(frozen=True)
class Probes:
    """The points that an iteration flies for its finite differences.

    Attributes
    ----------
    starts : (c,) indices of the starts that move. found : (c,) whether probes exist near a start.
    points : (q, 1 + d, d) of the q found ones, a base near the start and its probes; steps : (q, d).
    """

    starts: NDArray[np.int64]
    found: NDArray[np.bool_]
    points: Array
    steps: Array


@stored
@dataclass(frozen=True)
class DescentState:
    """Starts s of a descent: points (s, d) that satisfy all limits; costs, torques, dampings, stalls (s,).

    probes : of the next iteration; None if there is none. tried : (t, c, d) its trial steps, which are flown
    after the probes.
    """

    point: Array
    cost: Array
    torque: Array
    damping: Array
    stalled: NDArray[np.int64]
    iteration: int = 0
    probes: Probes | None = field(default=None, repr=False)
    tried: Array | None = field(default=None, repr=False)

    @property
    def active(self) -> NDArray[np.bool_]:
        """(s,) whether each start still moves."""
        return self.stalled < PATIENCE


@dataclass(frozen=True)
class _Linear:
    """Errors and torques near a base: ``value + gradient (z - base)``; (m,) and (m, d)."""

    base: Array
    errors: Array
    errors_gradient: Array
    torque: Array
    torque_gradient: Array


class ScheduleDescent(Solver[DescentState, Trials]):
    """Descents from all known schedules.

    Parameters
    ----------
    space, limit : the limits that the schedules must satisfy.
    iterations : int
        at most.
    """

    name = "polish"  # its name in the history of a result

    def __init__(self, space: MorphSpace, limit: TorqueLimit, iterations: int) -> None:
        self._space, self._limit, self._iterations = space, limit, iterations

    def init(self, known: Trials) -> DescentState:
        """Start at every schedule."""
        count = known.cost.size
        damping, stalled = np.full(count, FIRST_DAMPING), np.zeros(count, dtype=np.int64)
        return self._aimed(DescentState(known.points, known.cost, known.peak, damping, stalled))

    def ask(self, state: DescentState) -> Batch:
        """Return the probes first, then the non-zero trial steps, anchored to their starts."""
        probes = _probes(state)
        if state.tried is None:
            return Batch(probes.points.reshape(-1, self._space.dimension), residuals=True)
        held, moved = _held(state), self._moved(state, state.tried)
        return Anchored(state.tried.reshape(held.points.shape)[moved], anchors=held.select(moved))

    def tell(self, state: DescentState, outcome: Trials) -> DescentState:
        """Compute trial steps from linear models, or accept the best trial."""
        if _probes(state).starts.size == 0:
            return replace(state, probes=None)
        trials = _held(state)
        if state.tried is None:
            tried = self._trial_steps(state, outcome)
            if self._moved(state, tried).any():
                return replace(state, tried=tried)
        else:
            moved = self._moved(state, state.tried)
            points = state.tried.reshape(trials.points.shape).copy()
            points[moved], trials.cost[moved], trials.peak[moved] = outcome.points, outcome.cost, outcome.peak
            trials = replace(trials, points=points)
        return self._aimed(_accepted(state, trials))

    def done(self, state: DescentState) -> bool:
        """Return True when no remaining start can move any more or the iterations are used up."""
        return state.probes is None

    def best(self, state: DescentState, outcome: Trials) -> tuple[Array, float]:
        """Return the best start."""
        del outcome
        leader = int(np.argmin(state.cost))
        return state.point[leader], float(state.cost[leader])

    def between_steps(self, state: DescentState) -> bool:
        """Return whether an iteration has ended."""
        return state.tried is None

    def share(self, state: DescentState) -> float:
        """Return progress as a share of the iterations that a descent usually takes."""
        return min(state.iteration / min(USUAL_ITERATIONS, self._iterations), 1.0)

    def _aimed(self, state: DescentState) -> DescentState:
        """Return the state with the probes of the next iteration, if there is one.

        There are none when no remaining start moves: that iteration is the last.
        """
        share = next((share for end, share in NARROWING if state.iteration < end), 0.0)
        order = np.argsort(state.cost, kind="stable")[: max(1, round(share * state.cost.size))]
        starts = order[state.active[order]]
        if state.iteration >= self._iterations:
            return replace(state, probes=None)
        near = [probes_of(self._space, point) for point in state.point[starts]]
        found = [item for item in near if item is not None]
        d = self._space.dimension
        probes = Probes(
            starts,
            np.array([item is not None for item in near]),
            np.array([points for points, _ in found]).reshape(-1, 1 + d, d),
            np.array([steps for _, steps in found]).reshape(-1, d),
        )
        return replace(state, probes=probes)

    def _trial_steps(self, state: DescentState, outcome: Trials) -> Array:
        """Return steps (t, c, d) of all dampings in linear models near the starts."""
        probes = _probes(state)
        points = state.point[probes.starts]
        tried = np.stack([points] * len(DAMPING_TRIALS))
        each = probes.points.shape[1]
        for q, i in enumerate(np.flatnonzero(probes.found)):
            start = probes.starts[i]
            model = linear_model(outcome, slice(q * each, (q + 1) * each), probes.steps[q])
            for k, factor in enumerate(DAMPING_TRIALS):
                damping = factor * state.damping[start]
                tried[k, i] = _step(self._space, self._limit, points[i], state.cost[start], model, damping)
        return tried

    def _moved(self, state: DescentState, tried: Array) -> NDArray[np.bool_]:
        """Return which of the trial steps (t c,) differ from their start."""
        away = np.abs(tried - state.point[_probes(state).starts])
        return np.asarray(away.max(axis=2).ravel() > STILL)


def _probes(state: DescentState) -> Probes:
    if state.probes is None:
        raise ValueError("the descent is over")
    return state.probes


def _held(state: DescentState) -> Trials:
    """Return the starts that move, repeated for each damping value."""
    starts = np.tile(_probes(state).starts, len(DAMPING_TRIALS))
    return Trials.known(state.point[starts], state.cost[starts], state.torque[starts])


def _accepted(state: DescentState, trials: Trials) -> DescentState:
    """Return the state after the trials of all dampings; a start moves if its best trial is better."""
    chosen = _probes(state).starts
    shape = (len(DAMPING_TRIALS), chosen.size)
    points, tried = trials.points.reshape(*shape, -1), trials.cost.reshape(shape)
    peak = trials.peak.reshape(shape)
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
    damping[chosen] = np.clip(np.where(improved, lowered, raised), MIN_DAMPING, MAX_DAMPING)
    still = before - after <= STALLED * before
    stalled[chosen] = np.where(still, stalled[chosen] + 1, 0)
    return DescentState(point, cost, torque, damping, stalled, state.iteration + 1)


def probes_of(space: MorphSpace, point: Array) -> tuple[Array, Array] | None:
    """Base point near the given one with its probes, (1 + d, d), and their steps (d,); all are feasible.

    None if the limits leave no room for probes.
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


def linear_model(trials: Trials, rows: slice, steps: Array) -> _Linear:
    """Return the linear model near a base from its flight and those of its probes, some rows of trials."""
    if trials.residuals is None or trials.torque is None:
        raise TypeError("the batch requested residuals")
    errors, torque = trials.residuals[rows], trials.torque[rows]
    return _Linear(
        trials.points[rows][0],
        errors[0],
        ((errors[1:] - errors[0]) / steps[:, None]).T,
        torque[0],
        ((torque[1:] - torque[0]) / steps[:, None]).T,
    )


def _step(
    space: MorphSpace, limit: TorqueLimit, point: Array, cost: float, model: _Linear, damping: float
) -> Array:
    """The minimum (d,) of the damped quadratic model under the limits, made to keep them exactly."""
    J, cost = model.errors_gradient, max(cost, MIN_COST)
    normal = J.T @ J / cost
    toward = J.T @ model.errors / cost
    # floor of Marquardt's scaling: an unknown that does not affect the attitude must not run to its bound
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
