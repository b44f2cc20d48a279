"""Biases, delays, outliers and gaps of measured flights leave the model that flew where it is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from morphcore import Trajectory
from morphcore.identify.measurement import white_noise
from morphdata.measurement import Measurement
from tests.identify.disturbed import TRAINING, biased, fitted, flown, noisy, outliers, thinned

NOISE_RAD = 1e-4
SEEDS = 20

Disturb = Callable[[str, int], Trajectory]
BIASED: dict[str, Disturb] = {
    "roll bias 1 mrad": lambda name, _seed: biased(flown(name), phi=1e-3),
    "pitch bias 1 mrad": lambda name, _seed: biased(flown(name), theta=1e-3),
    "20 ms late": lambda name, _seed: flown(name, late_s=0.02),
    "pitch bias 3 mrad, 10 ms late": lambda name, _seed: biased(flown(name, late_s=0.01), theta=3e-3),
}


def disturbed(disturb: Disturb, seed: int = 0, noise_rad: float = 0.0) -> list[Trajectory]:
    """The training flights, each with noise of its own."""
    samples = [disturb(name, seed) for name in TRAINING]
    return [noisy(sample, noise_rad, 100 * k + seed) for k, sample in enumerate(samples)]


@pytest.mark.parametrize("name", ["roll bias 1 mrad", "20 ms late"])
def test_a_bias_or_a_delay_that_nobody_declared_is_found(name: str) -> None:
    """Flights without noise: J falls tenfold with biases and delays free, so they are, and all is exact."""
    found = fitted(disturbed(BIASED[name]))
    np.testing.assert_allclose(found.relative, 0.0, atol=0.03)
    measurement = found.measurement("asymmetric")
    bias, delay_s = (1e-3, 0.0) if "roll" in name else (0.0, 0.02)
    assert measurement["bias"]["phi"]["value"] == pytest.approx(bias, abs=2e-5)
    assert measurement["delay_s"]["value"] == pytest.approx(delay_s, abs=2e-4)
    assert "predicted to lower" in measurement["reason"]


def test_clean_flights_are_fitted_as_they_are() -> None:
    """Without noise, biases and delays nothing is freed, and the model that flew comes back."""
    found = fitted([flown(name) for name in TRAINING])
    np.testing.assert_allclose(found.relative, 0.0, atol=0.03)
    for name in TRAINING:
        measurement = found.measurement(name)
        assert measurement["bias"] == {}
        assert measurement["delay_s"] is None


def test_noise_frees_biases_and_delays() -> None:
    """White noise tells a measured flight; what is found is within four standard errors of what was done.

    Of eight estimates and one draw of the noise; the mean of psi's noise alone is 3.6 of its deviations here.
    """
    samples = disturbed(BIASED["pitch bias 3 mrad, 10 ms late"], seed=1, noise_rad=NOISE_RAD)
    found = fitted(samples)
    assert np.all(np.abs(found.relative) < 3.0 * found.standard_error)
    for name in TRAINING:
        measurement = found.measurement(name)
        expected = {"phi": 0.0, "theta": 3e-3, "psi": 0.0}
        for channel, value in expected.items():
            estimate = measurement["bias"][channel]
            assert abs(estimate["value"] - value) < 4.0 * estimate["standard_error"], (name, channel)
        delay_s = measurement["delay_s"]
        assert abs(delay_s["value"] - 0.01) < 4.0 * delay_s["standard_error"]
        assert measurement["noise_rad"]["theta"] == pytest.approx(NOISE_RAD, rel=0.35)


def test_the_heading_to_begin_with_is_free() -> None:
    """A first row whose heading is off by 3 mrad is one row of many: the model that flew comes back.

    The descent ends where J falls by less than a per cent, of which that row is most: the heading is found to
    within 0.05 mrad, not 3.
    """
    samples = []
    for name in TRAINING:
        sample = flown(name)
        psi = sample.psi.copy()
        psi[0] += 3e-3
        samples.append(replace(sample, psi=psi))
    found = fitted(samples)
    np.testing.assert_allclose(found.relative, 0.0, atol=0.03)
    heading = found.measurement("asymmetric")["heading_rad"]["value"]
    assert heading == pytest.approx(3e-3 / samples[1].time_s.size, abs=5e-5)


@pytest.mark.parametrize("loss", ["huber", "soft_l1"])
def test_a_few_outliers_do_not_count_with_a_robust_loss(loss: str) -> None:
    """Three rows of each flight are off by 50 mrad: stiffness moves by less than 5 per cent."""
    samples = [outliers(flown(name), seed) for seed, name in enumerate(TRAINING, start=2)]
    found = fitted(samples, Measurement(loss=loss))  # type: ignore[arg-type]
    np.testing.assert_allclose(found.relative, 0.0, atol=0.05)


def test_gaps_do_not_matter() -> None:
    """Of each flight 30 per cent of the rows are missing, at random."""
    found = fitted([thinned(flown(name), seed, 0.7) for seed, name in enumerate(TRAINING)])
    np.testing.assert_allclose(found.relative, 0.0, atol=0.05)


@pytest.mark.parametrize("sigma", [3e-5, 1e-3])
def test_white_noise_is_seen_in_a_smooth_signal(sigma: float) -> None:
    """Third differences tell it within a fifth at uneven times, outliers or not; where there is none, 0."""
    rng = np.random.default_rng(3)
    time_s = np.sort(rng.uniform(0.0, 3.0, 400))
    smooth = 0.1 * np.sin(3.0 * time_s) + 0.05 * np.exp(-((time_s - 1.0) ** 2) / 0.1)
    values = smooth + rng.normal(0.0, sigma, time_s.size)
    values[[50, 200, 300]] += 0.05
    assert white_noise(time_s, values) == pytest.approx(sigma, rel=0.2)
    assert white_noise(time_s, smooth) == 0.0
    coarse = np.arange(0.0, 3.0, 0.1)
    assert white_noise(coarse, np.sin(3.0 * coarse)) == 0.0


@pytest.mark.extended
@pytest.mark.slow
@pytest.mark.parametrize("name", BIASED)
def test_biases_and_delays_over_many_seeds(name: str) -> None:
    """Median over 20 seeds of noise: within 3 per cent and two standard errors; unseen within 0.3 mrad."""
    unseen = replace(flown("rate_0.2"), role="held_out", channels={})
    errors, ratios, worst = [], [], []
    for seed in range(SEEDS):
        found = fitted([*disturbed(BIASED[name], seed, NOISE_RAD), unseen])
        errors.append(found.relative)
        ratios.append(np.abs(found.relative) / found.standard_error)
        worst.append(np.abs(found.result.fits[-1].errors("identified")).max())
    print(name, np.median(errors, axis=0), np.median(ratios, axis=0), np.median(worst))
    assert np.all(np.abs(np.median(errors, axis=0)) < 0.03)
    assert np.all(np.median(ratios, axis=0) < 2.0)
    assert np.median(worst) < 3e-4


@pytest.mark.extended
@pytest.mark.slow
@pytest.mark.parametrize("loss", ["huber", "soft_l1"])
def test_outliers_over_many_seeds(loss: str) -> None:
    """Median over 20 draws of the rows that are off: 5 per cent."""
    errors = [
        fitted(
            [outliers(flown(name), 100 * k + seed) for k, name in enumerate(TRAINING)],
            Measurement(loss=loss),  # type: ignore[arg-type]
        ).relative
        for seed in range(SEEDS)
    ]
    print(loss, np.median(np.abs(errors), axis=0), np.abs(errors).max(axis=0))
    assert np.all(np.median(np.abs(errors), axis=0) < 0.05)
