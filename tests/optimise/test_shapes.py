"""Clamped splines in batches, and their extrema in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from morphcore.optimise.shapes import clamped_shapes

KNOTS = 7


@pytest.fixture(scope="module")
def knots():
    """A hundred random splines from 0 to 1, wild ones among them: times and values."""
    rng = np.random.default_rng(0)
    gaps = rng.dirichlet(np.full(KNOTS - 1, 1.5), size=100) + 0.01
    time = np.concatenate([np.zeros((100, 1)), np.cumsum(gaps, axis=1)], axis=1)
    time /= time[:, -1:]
    value = np.concatenate([np.zeros((100, 1)), rng.normal(size=(100, KNOTS - 2)), np.ones((100, 1))], axis=1)
    return time, value


def test_the_batch_is_scipys_clamped_spline(knots):
    """Rates and accelerations at the knots are those of the dense solution, to round-off."""
    shapes = clamped_shapes(*knots)
    for i, (time, value) in enumerate(zip(*knots, strict=True)):
        spline = CubicSpline(time, value, bc_type="clamped")
        scale = np.abs(spline(time, 2)).max()
        np.testing.assert_allclose(shapes.rate[i], spline(time, 1), atol=1e-11 * scale)
        np.testing.assert_allclose(shapes.first[i], spline(time[:-1], 2), atol=1e-10 * scale)
        np.testing.assert_allclose(shapes.last[i, -1], spline(time[-1], 2), atol=1e-10 * scale)


def test_extrema_are_those_of_dense_sampling(knots):
    """No sampled rate or value exceeds the closed forms, and each is met to what the sampling resolves.

    At 20,000 points a quadratic's vertex is missed by 1e-5 of its height at most.
    """
    shapes = clamped_shapes(*knots)
    rates = np.concatenate([shapes.turning_rate(), shapes.rate], axis=1)
    values = np.concatenate([shapes.turning_values(), shapes.value], axis=1)
    dense = np.linspace(0.0, 1.0, 20_001)
    for i, (time, value) in enumerate(zip(*knots, strict=True)):
        spline = CubicSpline(time, value, bc_type="clamped")
        for closed, sampled in ((rates[i], spline(dense, 1)), (values[i], spline(dense))):
            size = np.ptp(closed)
            for sign in (1.0, -1.0):
                beyond = (sign * closed).max() - (sign * sampled).max()
                assert -1e-12 * size <= beyond <= 1e-5 * size


def test_knots_out_of_order_give_finite_numbers():
    """A search may evaluate knots that are out of order; the result is a number without a warning."""
    shapes = clamped_shapes(np.array([[0.0, 0.7, 0.3, 1.0]]), np.array([[0.0, 0.3, 0.6, 1.0]]))
    for part in (shapes.rate, shapes.first, shapes.turning_rate(), shapes.turning_values()):
        assert np.all(np.isfinite(part))
