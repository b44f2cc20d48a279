"""Biases, delays and further channels beside the parameters: their intervals, and what they do to others."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import stdtrit

from morphcore.identify.coloured import ColouredNoise, Record
from morphcore.threads import one_blas_thread
from tests.identify.test_coloured import NOISE_RAD, TIMES_S, first_order, slopes

Array = NDArray[np.float64]

PRIOR = 9e-10
ROWS, CHANNELS = TIMES_S.size, 5  # three angles, a rate and a deflection, all weighted to radians of attitude
PARAMETERS = 5


def biased_record(rng: np.random.Generator, seed: int) -> tuple[Array, Array]:
    """Jacobian (k, 5, 5) and nuisance columns (k, 5, 6): a bias in every channel, and a delay of all."""
    waves = np.concatenate([slopes(rng, PARAMETERS), slopes(rng, PARAMETERS)[:, :2]], axis=1)
    nuisance = np.zeros((ROWS, CHANNELS, CHANNELS + 1))
    for channel in range(CHANNELS):
        nuisance[:, channel, channel] = 1.0
    nuisance[:, :, -1] = slopes(np.random.default_rng(seed), 1)[:, :1, 0] * np.arange(1.0, CHANNELS + 1.0)
    return waves, nuisance


def fitted(jacobian: list[Array], nuisance: list[Array], noise: list[Array]) -> tuple[Array, list[Array]]:
    """Errors of a joint linear fit, parameters first and then each flight's nuisances; what is left over."""
    d, n = PARAMETERS, CHANNELS + 1
    rows = []
    for k, (own, extra) in enumerate(zip(jacobian, nuisance, strict=True)):
        row = np.zeros((ROWS * CHANNELS, d + n * len(jacobian)))
        row[:, :d] = own.reshape(-1, d)
        row[:, d + k * n : d + (k + 1) * n] = extra.reshape(-1, n)
        rows.append(row)
    design, right = np.concatenate(rows), -np.concatenate([each.ravel() for each in noise])
    held = np.zeros(design.shape[1])
    held[:d] = PRIOR
    change = -np.linalg.solve(design.T @ design + np.diag(held), design.T @ right)
    left = right + design @ change
    return change, [each.reshape(ROWS, CHANNELS) for each in np.split(left, len(jacobian))]


@pytest.mark.parametrize("correlation", [0.0, 0.9])
def test_intervals_of_parameters_and_nuisances_hold_the_truth(correlation: float) -> None:
    """Of two flights with biases and delays of their own, 90 to 99 per cent of all intervals hold the truth.

    Channels have noise of different size. 60 fits of 5 parameters and 12 nuisances: 1,020 intervals.
    """
    rng = np.random.default_rng(1)
    flights = [biased_record(rng, seed) for seed in (1, 2)]
    sizes = NOISE_RAD * np.array([1.0, 0.3, 2.0, 0.5, 1.0])
    hits, nuisance_hits = [], []
    for _ in range(60):
        noise = [sizes * first_order(rng, (ROWS, CHANNELS), correlation) for _ in flights]
        change, left = fitted([f[0] for f in flights], [f[1] for f in flights], noise)
        found = ColouredNoise(
            tuple(Record(TIMES_S, own, f[0], nuisance=f[1]) for own, f in zip(left, flights, strict=True)),
            PRIOR,
        )
        with one_blas_thread():
            half = stdtrit(found.freedom, 0.975) * np.sqrt(np.diag(found.joint_covariance))
        hits.append(np.abs(change[:PARAMETERS]) <= half[:PARAMETERS])
        nuisance_hits.append(np.abs(change[PARAMETERS:]) <= half[PARAMETERS:])
    print(correlation, np.mean(hits), np.mean(nuisance_hits))
    assert 0.90 <= np.mean(hits) <= 0.99
    assert 0.90 <= np.mean(nuisance_hits) <= 0.99


def test_eliminated_nuisances_are_those_that_are_fitted() -> None:
    """A Jacobian with the nuisances fitted anew at each step gives the covariance of the joint problem.

    The reduced one is made by projection, by hand, with the slopes of the fitted nuisances.
    """
    rng = np.random.default_rng(2)
    jacobian, nuisance = biased_record(rng, 3)
    _, (left,) = fitted([jacobian], [nuisance], [NOISE_RAD * first_order(rng, (ROWS, CHANNELS), 0.8)])
    D, B = jacobian.reshape(-1, PARAMETERS), nuisance.reshape(-1, CHANNELS + 1)
    slope = -np.linalg.lstsq(B, D, rcond=None)[0]
    reduced = (D + B @ slope).reshape(jacobian.shape)
    joint = ColouredNoise((Record(TIMES_S, left, jacobian, nuisance=nuisance),), PRIOR)
    same = ColouredNoise(
        (Record(TIMES_S, left, reduced, nuisance=nuisance, nuisance_slope=slope),),
        PRIOR,
    )
    np.testing.assert_allclose(same.joint_covariance, joint.joint_covariance, rtol=1e-6, atol=1e-16)
    np.testing.assert_allclose(
        same.information,
        reduced.reshape(-1, PARAMETERS).T @ reduced.reshape(-1, PARAMETERS) + PRIOR * np.eye(PARAMETERS),
        rtol=1e-8,
    )
    assert joint.nuisance_covariance(0).shape == (CHANNELS + 1, CHANNELS + 1)


def test_a_bias_that_is_fitted_costs_certainty() -> None:
    """What a bias could explain tells nothing about the parameters: no standard error gets smaller by it."""
    rng = np.random.default_rng(4)
    jacobian, nuisance = biased_record(rng, 5)
    _, (left,) = fitted([jacobian], [nuisance], [NOISE_RAD * first_order(rng, (ROWS, CHANNELS), 0.0)])
    free = ColouredNoise((Record(TIMES_S, left, jacobian, nuisance=nuisance),), 0.0)
    known = ColouredNoise((Record(TIMES_S, left, jacobian),), 0.0)
    ratio = np.sqrt(np.diag(free.covariance) / np.diag(known.covariance))
    assert np.all(ratio > 0.9)  # the estimates of the noise differ a little
    assert ratio.max() > 1.2


def test_leaving_a_flight_out_leaves_out_its_nuisances() -> None:
    """The jackknife of a linear model with biases is that of refits without each of four flights."""
    rng = np.random.default_rng(5)
    flights = [biased_record(rng, seed) for seed in range(4)]
    noise = [NOISE_RAD * (1 + k) * first_order(rng, (ROWS, CHANNELS), 0.9) for k in range(4)]

    def fit(chosen: list[int]) -> tuple[Array, list[Array]]:
        return fitted(
            *(
                [group[k] for k in chosen]
                for group in ([f[0] for f in flights], [f[1] for f in flights], noise)
            )
        )

    _, left = fit([0, 1, 2, 3])
    without = np.stack([fit([k for k in range(4) if k != out])[0][:PARAMETERS] for out in range(4)])
    found = ColouredNoise(
        tuple(Record(TIMES_S, own, f[0], nuisance=f[1]) for own, f in zip(left, flights, strict=True)),
        PRIOR,
    )
    assert found.between_flights is not None
    np.testing.assert_allclose(found.between_flights, 3.0 * np.cov(without.T, bias=True), rtol=1e-7)
