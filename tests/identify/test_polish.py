"""Multi-start Levenberg-Marquardt against textbook problems and scipy's solver."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from morphcore.identify.polish import PROBE, differences, first_polish, next_polish

Array = NDArray[np.float64]


def decay(points: Array) -> Array:
    """Residuals of a e^(-b t) + c against a curve; points (p, 3)."""
    t = np.linspace(0.0, 4.0, 40)
    a, b, c = points.T[:, :, None]
    return a * np.exp(-b * t) + c - (2.0 * np.exp(-0.7 * t) + 0.3 + 0.01 * np.sin(9 * t))


def polished(points: Array, lower: Array, upper: Array, keep: int = 10) -> Array:
    """The best point after as many iterations as it takes."""
    cost = np.sum(decay(points) ** 2, axis=1)
    state = first_polish(points, cost)
    for _ in range(60):
        after = next_polish(state, lower, upper, decay, keep)
        if after is state:
            break
        state = after
    return np.asarray(state.point[state.best])


def test_reaches_the_minimum_that_scipy_finds() -> None:
    """From any of several starts the polish ends at the minimum of an independent solver.

    Tolerance: the polish stops when the cost falls by less than 5 per cent in three iterations; on this curve
    the convergence is quadratic by then.
    """
    lower, upper = np.full(3, -10.0), np.full(3, 10.0)
    starts = np.random.default_rng(3).normal(0.5, 1.0, (5, 3))
    expected = least_squares(lambda x: decay(x[None, :])[0], [1.0, 1.0, 0.0]).x
    np.testing.assert_allclose(polished(starts, lower, upper), expected, rtol=1e-4)


def test_stays_in_the_box_and_finds_its_constrained_minimum() -> None:
    """With the free minimum outside the box the polish ends on its face, where scipy's solver ends."""
    lower, upper = np.array([0.0, 0.0, -1.0]), np.array([1.5, 3.0, 1.0])
    expected = least_squares(
        lambda x: decay(x[None, :])[0], [1.0, 1.0, 0.0], bounds=(lower, upper), xtol=1e-14, ftol=1e-14
    ).x
    found = polished(np.array([[1.0, 1.0, 0.0], [0.2, 2.5, 0.5]]), lower, upper)
    assert np.all((found >= lower) & (found <= upper))
    assert found[0] == upper[0]
    np.testing.assert_allclose(found, expected, rtol=1e-3)


def test_cost_never_rises() -> None:
    """Every iteration leaves each start at most as dear as before."""
    lower, upper = np.full(3, -10.0), np.full(3, 10.0)
    points = np.random.default_rng(5).normal(0.0, 2.0, (6, 3))
    state = first_polish(points, np.sum(decay(points) ** 2, axis=1))
    for _ in range(15):
        after = next_polish(state, lower, upper, decay, 6)
        assert np.all(after.cost <= state.cost)
        state = after


def test_resting_starts_do_not_move() -> None:
    """Only the best ``keep`` starts are flown; the others keep their place."""
    lower, upper = np.full(3, -10.0), np.full(3, 10.0)
    points = np.random.default_rng(7).normal(0.0, 1.0, (4, 3))
    state = first_polish(points, np.sum(decay(points) ** 2, axis=1))
    after = next_polish(state, lower, upper, decay, 1)
    moved = np.any(after.point != state.point, axis=1)
    assert moved.sum() == 1
    assert moved[state.best]


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
