"""Standard errors under noise that is correlated in time, against draws, refits and thinner rows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import stdtrit

from morphcore.identify.coloured import DISCREPANCY, ColouredNoise, Record
from morphcore.identify.identification import Identification
from morphcore.identify.parameters import Interval, search_space
from morphcore.identify.settings import search_settings
from morphcore.identify.uncertainty import uncertainty
from morphcore.models.equivalent import ParameterBatch, chain_model
from morphcore.threads import one_blas_thread
from morphdata.identify import EquivalentModel, IdentifySearch
from tests.identify.flights import reference_aircraft, reference_flight, synthetic

Array = NDArray[np.float64]

HEADING = 2  # the channel that has a free offset
PRIOR = 9e-10
NOISE_RAD = 2e-4
ROWS = 120
FITS = 200
TIMES_S = 0.01 * np.arange(ROWS)


def records(flights: int, residual: Array, jacobian: Array, motion_rad: float = 0.0) -> tuple[Record, ...]:
    """Residuals (m,) and Jacobian (m, d) of a whole fit, cut into those of equally long flights."""
    own, slope = residual.reshape(flights, ROWS, 3), jacobian.reshape(flights, ROWS, 3, -1)
    return tuple(Record(TIMES_S, own[k], slope[k], motion_rad) for k in range(flights))


def first_order(rng: np.random.Generator, shape: tuple[int, ...], correlation: float) -> Array:
    """Noise of unit variance, correlated from row to row (first axis)."""
    noise = rng.normal(size=shape)
    for row in range(1, shape[0]):
        noise[row] = correlation * noise[row - 1] + np.sqrt(1.0 - correlation**2) * noise[row]
    return noise


def slopes(rng: np.random.Generator, count: int, rows: int = ROWS, stop_s: float = 1.2) -> Array:
    """A smooth Jacobian (rows, 3, count) as of flights: every column a few slow waves."""
    time_s = np.linspace(0.0, stop_s, rows, endpoint=False)
    waves = np.stack([np.sin(np.pi * (k + 1) * time_s / stop_s / 2.0) for k in range(8)], axis=1)
    return np.einsum("rk,kcd->rcd", waves, rng.normal(0.0, 2e-3, (8, 3, count)))


def estimate(jacobian: Array, noise: Array) -> tuple[Array, Array]:
    """What a linear fit with the prior makes of noise (rows, 3): its error (d,) and what is left (rows, 3).

    The heading's offset is free.
    """
    d = jacobian.shape[-1]
    D = np.concatenate([jacobian, offset(jacobian.shape[0])], axis=2).reshape(-1, d + 1)
    held = np.append(np.full(d, PRIOR), 0.0)
    change = np.linalg.solve(D.T @ D + np.diag(held), D.T @ noise.ravel())
    return change[:d], (D @ change).reshape(noise.shape) - noise


def offset(rows: int) -> Array:
    """Derivatives (rows, 3, 1) of the residuals by the heading's offset."""
    columns = np.zeros((rows, 3, 1))
    columns[:, HEADING] = 1.0
    return columns


def fitted_noise(time_s: Array, left: Array, jacobian: Array, prior: float) -> ColouredNoise:
    """The noise around such a fit of one flight."""
    record = Record(time_s, left, jacobian, nuisance=offset(time_s.size))
    return ColouredNoise((record,), prior)


@pytest.mark.parametrize("correlation", [0.0, 0.8, 0.95])
def test_intervals_hold_the_truth(correlation: float) -> None:
    """95 per cent intervals of linear fits under white and first-order noise hold the truth 19 times in 20.

    150 fits of six parameters: of the 900 intervals, 90 to 99 per cent do. Fits share their Jacobian, not
    their noise, and the estimates of one fit are correlated, so that one per cent of chance is left.
    """
    rng = np.random.default_rng(3)
    jacobian = slopes(rng, 6)
    hits, ratios = [], []
    for _ in range(150):
        change, left = estimate(jacobian, NOISE_RAD * first_order(rng, (ROWS, 3), correlation))
        found = fitted_noise(TIMES_S, left, jacobian, PRIOR)
        with one_blas_thread():
            error = np.sqrt(np.diag(found.covariance))
        hits.append(np.abs(change) <= stdtrit(found.freedom, 0.975) * error)
        ratios.append(change / error)
    print(correlation, np.mean(hits, axis=0), np.std(ratios, axis=0))
    assert 0.90 <= np.mean(hits) <= 0.99


def test_thinner_rows_tell_as_much_of_slow_noise() -> None:
    """Noise that is correlated over 0.2 s: with every fourth row standard errors are within 20 per cent."""
    rng = np.random.default_rng(4)
    jacobian = slopes(rng, 5, 4 * ROWS)
    _, left = estimate(jacobian, NOISE_RAD * first_order(rng, (4 * ROWS, 3), 0.95))
    time_s = 0.01 * np.arange(4 * ROWS)

    def errors(step: int) -> Array:
        found = fitted_noise(time_s[::step], left[::step], jacobian[::step], PRIOR / step)
        return np.sqrt(np.diag(found.covariance))

    np.testing.assert_allclose(errors(4), errors(1), rtol=0.2)


def test_the_jackknife_is_that_of_refits() -> None:
    """Of a linear model, leaving out each of four flights in one step is to fit the other three anew."""
    rng = np.random.default_rng(5)
    each = [slopes(rng, 4) for _ in range(4)]
    noise = [NOISE_RAD * first_order(rng, (ROWS, 3), 0.9) * (1 + k) for k in range(4)]

    def fit(chosen: list[int]) -> tuple[Array, Array]:
        D = np.concatenate([each[k].reshape(-1, 4) for k in chosen])
        residual = np.concatenate([noise[k].ravel() for k in chosen])
        change = -np.linalg.solve(D.T @ D + PRIOR * np.eye(4), D.T @ residual)
        return change, residual + D @ change

    _, left = fit([0, 1, 2, 3])
    without = np.stack([fit([k for k in range(4) if k != out])[0] for out in range(4)])
    expected = 3.0 * np.cov(without.T, bias=True)
    D = np.concatenate([jacobian.reshape(-1, 4) for jacobian in each])
    found = ColouredNoise(records(4, left, D), PRIOR)
    assert found.between_flights is not None
    np.testing.assert_allclose(found.between_flights, expected, rtol=1e-8)
    assert np.all(np.diag(found.covariance) >= np.diag(expected) * (1.0 - 1e-12))
    two = ColouredNoise(records(2, left[: 6 * ROWS], D[: 6 * ROWS]), PRIOR)
    assert two.between_flights is None


def test_one_flight_does_not_hide_what_chains_miss() -> None:
    """Fitted to rounding, a flight alone still has errors of a chain's discrepancy: a share of the motion.

    With large residuals there is no floor: they show themselves.
    """
    rng = np.random.default_rng(6)
    jacobian = slopes(rng, 4)
    rows, left = jacobian.reshape(-1, 4), 1e-9 * rng.normal(size=3 * ROWS)
    spread = {
        motion: np.sqrt(np.diag(ColouredNoise(records(1, left, rows, motion), 0.0).covariance))
        for motion in (0.0, 0.01, 0.02)
    }
    assert np.all(spread[0.01] > 1e3 * spread[0.0])
    np.testing.assert_allclose(spread[0.02], 2.0 * spread[0.01], rtol=1e-6)
    noisy = NOISE_RAD * rng.normal(size=3 * ROWS)
    with_floor, without = (
        ColouredNoise(records(1, noisy, rows, motion), 0.0).covariance
        for motion in (NOISE_RAD / DISCREPANCY, 0.0)
    )
    np.testing.assert_array_equal(with_floor, without)


def test_what_only_the_prior_holds_has_no_interval() -> None:
    """A direction that the samples do not see is open on both sides, although the fit's prior settles it."""
    space = search_space(chain_model(reference_aircraft(), reference_flight(), 2))
    rng = np.random.default_rng(7)
    jacobian = slopes(rng, space.dimension)
    blind = space.names.index("damping_nms_rad.joint_1.edgewise")
    jacobian[:, :, blind] = 0.0
    _, left = estimate(jacobian, 1e-5 * rng.normal(size=(ROWS, 3)))
    rows = jacobian.reshape(left.size, -1)
    noise = fitted_noise(TIMES_S, left, jacobian, PRIOR)
    document = uncertainty(space, space.guess, left.ravel(), rows, noise).to_document()
    assert document["method"] == "coloured"
    assert document["interval_95"]["damping_nms_rad.joint_1.edgewise"] == [None, None]
    former = "damping_nms_rad.joint_1.lag"  # written as well throughout version 0.2
    assert document["undetermined"] == ["damping_nms_rad.joint_1.edgewise", former]
    (direction,) = document["unidentifiable"]
    assert set(direction["direction"]) == {"damping_nms_rad.joint_1.edgewise", former}
    low, high = document["interval_95"]["lift_factor"]
    assert low < 1.0 < high


@pytest.mark.extended
@pytest.mark.slow
@pytest.mark.parametrize("links", [2, 3])
@pytest.mark.parametrize("correlation", [0.0, 0.95])
def test_intervals_of_fits_hold_the_truth(links: int, correlation: float) -> None:
    """200 fits of two synthetic flights, all angles noisy from the first row on: 90 to 99 per cent hold it.

    Each fit has a truth of its own, up to a factor e off the guess: what the prior is taken to allow.
    Counted are the parameters whose interval is closed in at least half of the fits; three standard
    deviations of chance (of 200 draws) are allowed on either side.
    """
    space = search_space(chain_model(reference_aircraft(), reference_flight(), links))
    held: dict[str, list[bool]] = {}
    for seed in range(FITS):
        rng = np.random.default_rng(seed)
        truth = space.decode(space.guess + rng.uniform(-1.0, 1.0, space.dimension))
        expected = dict(zip(space.parameter_names, space.flatten(truth)[0], strict=True))
        for name, (low, high) in noisy_fit(rng, truth, correlation).items():
            if low is not None and high is not None:
                held.setdefault(name, []).append(low <= expected[name] <= high)
    reported = {name: float(np.mean(each)) for name, each in held.items() if len(each) >= FITS / 2}
    print(links, correlation, {name: round(share, 3) for name, share in reported.items()})
    assert len(reported) >= links
    for name, share in reported.items():
        assert 0.90 - 3.0 * np.sqrt(0.09 / FITS) <= share <= 0.99 + 3.0 * np.sqrt(0.0099 / FITS), name
    assert 0.90 <= float(np.mean([hit for name in reported for hit in held[name]])) <= 0.99


def noisy_fit(rng: np.random.Generator, truth: ParameterBatch, correlation: float) -> dict[str, Interval]:
    """Intervals of a fit of two flights of a model, with noise of a correlation from row to row."""
    samples = []
    for clean in (
        synthetic(truth, name="even"),
        synthetic(truth, name="uneven", left_rad=0.3, right_rad=0.7),
    ):
        angles = clean.euler + NOISE_RAD * first_order(rng, clean.euler.shape, correlation)
        samples.append(replace(clean, phi=angles[:, 0], theta=angles[:, 1], psi=angles[:, 2]))
    run = Identification(
        reference_aircraft(),
        reference_flight(),
        samples,
        EquivalentModel(links_per_wing=truth.links, step_s=0.01),
        search_settings(IdentifySearch(method="least_squares")),
    )
    checkpoint = b""
    for step in run.steps():
        checkpoint = step.checkpoint
    found = run.result(checkpoint).uncertainty
    assert found is not None
    return found.intervals
