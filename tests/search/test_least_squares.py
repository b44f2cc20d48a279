"""Multi-start Levenberg-Marquardt against textbook problems and scipy's solver."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from morphcore.search.least_squares import PROBE, LeastSquares, LeastSquaresState, differences
from morphcore.search.run import SearchState
from tests.search.problems import Formula, searched

Array = NDArray[np.float64]


def decay(points: Array) -> Array:
    """Residuals of a e^(-b t) + c against a curve; points (p, 3)."""
    t = np.linspace(0.0, 4.0, 40)
    a, b, c = points.T[:, :, None]
    return a * np.exp(-b * t) + c - (2.0 * np.exp(-0.7 * t) + 0.3 + 0.01 * np.sin(9 * t))


def states_of(points: Array, lower: Array, upper: Array) -> list[SearchState]:
    """All states of descents from points (s, d)."""
    problem = Formula(decay, lower, upper, points)
    return searched(problem, LeastSquares(problem, 60))


def test_reaches_the_minimum_that_scipy_finds() -> None:
    """From any of several starts the descent ends at the minimum of an independent solver.

    Tolerance: the descent stops when the cost hardly falls in three iterations; on this curve the convergence
    is quadratic by then.
    """
    lower, upper = np.full(3, -10.0), np.full(3, 10.0)
    starts = np.random.default_rng(3).normal(0.5, 1.0, (5, 3))
    expected = least_squares(lambda x: decay(x[None, :])[0], [1.0, 1.0, 0.0]).x
    np.testing.assert_allclose(states_of(starts, lower, upper)[-1].best, expected, rtol=1e-4)


def test_stays_in_the_box_and_finds_its_constrained_minimum() -> None:
    """With the free minimum outside the box the descent ends on its face, where scipy's solver ends."""
    lower, upper = np.array([0.0, 0.0, -1.0]), np.array([1.5, 3.0, 1.0])
    expected = least_squares(
        lambda x: decay(x[None, :])[0], [1.0, 1.0, 0.0], bounds=(lower, upper), xtol=1e-14, ftol=1e-14
    ).x
    found = states_of(np.array([[1.0, 1.0, 0.0], [0.2, 2.5, 0.5]]), lower, upper)[-1].best
    assert np.all((found >= lower) & (found <= upper))
    assert found[0] == upper[0]
    np.testing.assert_allclose(found, expected, rtol=1e-3)


def test_cost_never_rises() -> None:
    """Every iteration leaves each start at most as expensive as before."""
    lower, upper = np.full(3, -10.0), np.full(3, 10.0)
    states = states_of(np.random.default_rng(5).normal(0.0, 2.0, (6, 3)), lower, upper)
    costs = [state.solver.cost for state in states]
    for before, after in itertools.pairwise(costs):
        assert np.all(after <= before)


def test_the_field_narrows_to_the_best_start() -> None:
    """After three iterations half of the starts rest, after six all but the best."""
    lower, upper = np.full(3, -10.0), np.full(3, 10.0)
    states = states_of(np.random.default_rng(7).normal(0.0, 3.0, (8, 3)), lower, upper)
    inner: list[LeastSquaresState] = [state.solver for state in states]
    for before, after in itertools.pairwise(inner):
        moved = np.flatnonzero(np.any(after.point != before.point, axis=1))
        maximum = 8 if before.iteration < 3 else 4 if before.iteration < 6 else 1
        assert moved.size <= maximum
        assert set(moved) <= set(np.argsort(before.cost, kind="stable")[:maximum])
    assert inner[-1].iteration > 6


def test_differences_step_inward_at_the_upper_bound() -> None:
    """At a bound the difference quotient stays inside the box and still approximates the slope.

    Tolerance: forward differences are off by half a step times the second derivative, here below 1e-3.
    """
    x = np.array([[2.0, 0.7, 0.3]])
    seen: list[Array] = []

    def watched(points: Array) -> Array:
        seen.append(points)
        return decay(points)

    _, jacobian = differences(x, x[0], watched)
    assert np.all(np.concatenate(seen) <= x[0])
    central = np.stack(
        [(decay(x + h) - decay(x - h))[0] / (2 * PROBE) for h in PROBE * np.eye(3)[:, None, :]], axis=1
    )
    np.testing.assert_allclose(jacobian[0], central, atol=1e-3)
