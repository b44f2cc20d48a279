"""The weight of the physical guess is the one under which the flights are most likely."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.stats import multivariate_normal

from morphcore.identify.evidence import (
    MAX_SPREAD,
    MIN_SPREAD,
    WEIGHTS,
    ChosenPrior,
    guess_spread,
    independent_rows,
    linear_model,
    log_evidence,
    log_likelihood,
)

Array = NDArray[np.float64]

ROWS, CHANNELS = 200, 3
SHAPES = [(ROWS, CHANNELS)]


def design(columns: int, seed: int) -> Array:
    """A Jacobian (m, d) whose columns differ in size by decades, as those of flights do."""
    rng = np.random.default_rng(seed)
    return np.asarray(rng.normal(size=(ROWS * CHANNELS, columns)) * np.geomspace(1e-3, 1e-5, columns))


def test_is_the_likelihood_of_the_residuals() -> None:
    """Up to a constant it is the normal density of the residuals, whose covariance a library factorises.

    With variance v and spread s of the guess the residuals at the guess have the covariance v + s^2 D D'; the
    best v for a ratio v / s^2 is found by looking at many. Tolerance: the grid of v.
    """
    jacobian = design(4, 1)[:90]
    rng = np.random.default_rng(2)
    error = jacobian @ rng.normal(0.0, 0.3, 4) + rng.normal(0.0, 1e-4, 90)
    linear = linear_model(error, jacobian, np.zeros(4), 1e-8, [(30, 3)])
    weights = np.array([1e-8, 1e-7, 1e-6])
    found = log_likelihood(linear, weights, 90.0)
    expected = []
    for weight in weights:
        spreads = np.geomspace(MIN_SPREAD, MAX_SPREAD, 150)
        densities = [
            multivariate_normal.logpdf(
                error, cov=weight * spread**2 * (np.eye(90) + jacobian @ jacobian.T / weight)
            )
            for spread in spreads
        ]
        expected.append(max(densities))
    np.testing.assert_allclose(np.diff(found), np.diff(expected), atol=0.02)


@pytest.mark.parametrize("spread", [0.1, 0.5])
@pytest.mark.parametrize("noise_rad", [1e-5, 1e-3])
def test_the_weight_is_the_noise_over_the_spread_of_the_guess(spread: float, noise_rad: float) -> None:
    """Of white noise and guesses off by a known spread the weights are (noise / spread)^2 in the median.

    Tolerance: sixteen parameters tell their spread to a factor 1.2, so the weight to 1.4; twice that here.
    """
    rng, found = np.random.default_rng(3), []
    jacobian = design(16, 4)
    for _ in range(15):
        offset = rng.normal(0.0, spread, 16)  # of the guess from the truth
        at_guess = jacobian @ offset + rng.normal(0.0, noise_rad, jacobian.shape[0])
        prior = ChosenPrior(np.zeros(16), np.full(16, 1e-9), lambda: SHAPES)
        weights = prior.weights(at_guess, jacobian, np.zeros(16), prior.first)
        assert np.all(weights == weights[0])
        found.append(weights[0])
    ratio = np.median(found) / (noise_rad / spread) ** 2
    print(ratio)
    assert 0.35 < ratio < 2.8


@pytest.mark.parametrize("spread", [0.1, 0.3, 0.6])
def test_the_spread_of_the_guess_is_found(spread: float) -> None:
    """Of guesses off by a known spread it is found, whatever the weight of the prior that the fit had.

    Tolerance: sixteen parameters tell their spread to 18 per cent, the median of 15 sets of them to 6; as a
    root mean square over what it may be it is a little larger.
    """
    rng, found = np.random.default_rng(5), []
    jacobian = design(16, 4)
    for _ in range(15):
        offset = rng.normal(0.0, spread, 16)
        at_guess = jacobian @ offset + rng.normal(0.0, 1e-5, jacobian.shape[0])
        each = [
            guess_spread(linear_model(at_guess, jacobian, np.zeros(16), weight, SHAPES))
            for weight in (1e-10, 1e-9)
        ]
        assert each[0] == pytest.approx(each[1], rel=0.1)
        found.append(each[0])
    print(np.median(found) / spread)
    assert 0.85 < np.median(found) / spread < 1.25


def test_exact_flights_take_the_weight_away() -> None:
    """Where the model can fly all that was measured, what it was guessed to be hardly counts any more."""
    jacobian, offset = design(6, 5), np.full(6, 0.4)
    prior = ChosenPrior(np.zeros(6), np.full(6, 1e-6), lambda: SHAPES)
    weight = prior.weights(jacobian @ offset, jacobian, np.zeros(6), prior.first)[0]
    # an exact fit is good to 1e-8 rad of each row, and the spread of the guess is 0.4
    assert weight < 10.0 * (1e-8 / 0.4) ** 2 * ROWS * CHANNELS


def test_a_weight_stays_unless_another_is_clearly_likelier() -> None:
    """A choice that changed with every iteration would keep a descent from coming to rest."""
    rng = np.random.default_rng(6)
    jacobian = design(5, 7)
    error = jacobian @ rng.normal(0.0, 0.3, 5) + rng.normal(0.0, 1e-4, jacobian.shape[0])
    prior = ChosenPrior(np.zeros(5), np.full(5, 1e-12), lambda: SHAPES)
    chosen = prior.weights(error, jacobian, np.zeros(5), prior.first)
    assert chosen[0] > prior.first[0]
    for factor in (0.8, 1.25):
        near = factor * chosen
        np.testing.assert_array_equal(prior.weights(error, jacobian, np.zeros(5), near), near)


def test_rows_that_say_the_same_count_once() -> None:
    """White rows count in full; those of an AR(1) process of correlation r as (1 - r) / (1 + r) of them.

    Tolerance: the autocorrelation is estimated from 6000 rows.
    """
    white = np.random.default_rng(8).normal(size=(6000, 2))
    assert independent_rows(white.ravel(), [(6000, 2)]) == pytest.approx(12000, rel=0.1)
    coloured = lfilter([1.0], [1.0, -0.9], white, axis=0)
    assert independent_rows(coloured.ravel(), [(6000, 2)]) == pytest.approx(12000 * 0.1 / 1.9, rel=0.25)
    two = np.concatenate([white[:3000].ravel(), white[3000:].ravel()])
    assert independent_rows(two, [(3000, 2), (3000, 2)]) == pytest.approx(12000, rel=0.1)


def test_denser_rows_change_nothing() -> None:
    """A smooth discrepancy sampled twice as densely leaves the prior's weight in proportion to the rows.

    J doubles with the rows, so the weight that is to count the same doubles, too. Tolerance: the grid.
    """
    time = np.linspace(0.0, 2.0, 2 * ROWS)
    columns = np.stack([np.sin((k + 1) * time) for k in range(5)], axis=1) * 1e-3
    missed = 1e-5 * np.sin(17.0 * time + 0.4) + 1e-5 * np.cos(11.0 * time)
    found = []
    for step in (1, 2):
        jacobian = columns[::step]
        error = jacobian @ np.array([0.3, -0.2, 0.1, 0.2, -0.4]) + missed[::step]
        prior = ChosenPrior(np.zeros(5), np.full(5, 1e-14), lambda step=step: [(2 * ROWS // step, 1)])  # type: ignore[misc]
        found.append(prior.weights(error, jacobian, np.zeros(5), prior.first)[0])
    assert found[0] / found[1] == pytest.approx(2.0, rel=0.35)


def test_a_parameter_that_explains_nothing_makes_flights_less_likely() -> None:
    """A column more fits noise better, and the likelihood falls; one that is needed raises it."""
    rng = np.random.default_rng(9)
    jacobian = design(4, 10) * 10.0
    needed = jacobian[:, :3] @ np.array([0.5, -0.4, 0.6])
    error = needed + rng.normal(0.0, 1e-4, jacobian.shape[0])
    evidence = [
        log_evidence(linear_model(error, jacobian[:, :n], np.zeros(n), 1e-8, SHAPES), ROWS * CHANNELS)
        for n in (2, 3, 4)
    ]
    assert evidence[1] == max(evidence)
    assert WEIGHTS.size > 50
