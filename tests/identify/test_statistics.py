"""Statistics of residuals: Theil's coefficient and its parts, whiteness, likeness to the drives."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from morphcore.identify.statistics import (
    autocorrelation,
    channel_statistics,
    theil_parts,
    whiteness,
)

Array = NDArray[np.float64]

TIME_S = np.arange(0.0, 3.0, 0.01)
MOTION = 0.1 * np.sin(2.0 * TIME_S)
SEEDS = 200


def ar1(rho: float, seed: int, rows: int = TIME_S.size) -> Array:
    """Noise of variance 1 in which each row remembers the one before."""
    steps = np.random.default_rng(seed).normal(size=rows)
    noise = np.empty(rows)
    noise[0] = steps[0]
    for row in range(1, rows):
        noise[row] = rho * noise[row - 1] + np.sqrt(1.0 - rho**2) * steps[row]
    return noise


def test_theils_parts_by_their_definitions() -> None:
    """An offset is all bias, a wrong amplitude about a mean all variance, noise without either covariance."""
    centred = MOTION - MOTION.mean()
    cases = {1: centred + 0.02, 2: 1.3 * centred}
    for part, modelled in cases.items():
        found = theil_parts(centred, modelled)
        assert found is not None
        assert found[part] == pytest.approx(1.0, abs=1e-9)
        assert sum(found[1:]) == pytest.approx(1.0, abs=1e-9)
    # a quarter of a wave ahead: same mean and size, by whole waves
    angle = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)
    found = theil_parts(np.sin(angle), np.cos(angle))
    assert found is not None
    assert found[3] == pytest.approx(1.0, abs=1e-9)
    assert found[0] == pytest.approx(np.sqrt(0.5), rel=1e-9)  # rms sqrt(1), sizes sqrt(1/2) each


def test_theils_coefficient_goes_from_0_to_1() -> None:
    """0 for a perfect model, 1 for one that does nothing, or the opposite."""
    assert theil_parts(MOTION, MOTION) == (0.0, 0.0, 0.0, 0.0)
    for modelled in (np.zeros_like(MOTION), -MOTION):
        found = theil_parts(MOTION, modelled)
        assert found is not None
        assert found[0] == pytest.approx(1.0)
    assert theil_parts(np.zeros(9), np.zeros(9)) is None


def test_white_noise_is_called_white_and_coloured_noise_is_not() -> None:
    """At most two of a hundred white residuals are called coloured, and all of AR(1) with 0.95 a row."""
    white = sum(whiteness(ar1(0.0, seed))[2] for seed in range(SEEDS))
    coloured = sum(whiteness(ar1(0.95, seed))[2] for seed in range(SEEDS))
    assert white >= 0.98 * SEEDS
    assert coloured == 0


def test_the_probability_is_even_under_white_noise() -> None:
    """The portmanteau test keeps its level: five in a hundred below 0.05, within sampling error."""
    below = np.mean([whiteness(ar1(0.0, seed))[1] < 0.05 for seed in range(SEEDS)])
    assert 0.01 <= below <= 0.10


def test_an_outlier_does_not_hide_a_correlation() -> None:
    """A hundredfold outlier alone has all the power; the judgement stays what it was without it."""
    for rho, expected in ((0.0, True), (0.95, False)):
        noise = ar1(rho, 3)
        noise[100] += 100.0
        assert whiteness(noise)[2] is expected


def test_autocorrelation_of_a_known_process() -> None:
    """That of AR(1) falls by its factor from lag to lag."""
    rho = autocorrelation(ar1(0.8, 1, rows=100_000), 3)
    np.testing.assert_allclose(rho, 0.8 ** np.arange(4), atol=0.02)


def test_the_shape_of_a_drive_is_found_in_a_residual() -> None:
    """An error like a drive's rate correlates with it, noise does not; a drive at rest has no shape."""
    drive = np.clip(TIME_S - 1.0, 0.0, 0.8)
    rate = np.gradient(drive, TIME_S)
    found = channel_statistics(TIME_S, MOTION, MOTION + 1e-3 * rate, {"sweep": drive, "fold": 0.0 * drive})
    assert found.drive_correlation == pytest.approx(1.0, abs=1e-6)
    noise = channel_statistics(TIME_S, MOTION, MOTION + 1e-3 * ar1(0.0, 2), {"sweep": drive})
    assert abs(noise.drive_correlation or 0.0) < 0.2
    assert channel_statistics(TIME_S, MOTION, 1.1 * MOTION, {"fold": 0.0 * drive}).drive_correlation is None


def test_nothing_is_said_of_nothing() -> None:
    """A flight that diverged, or an angle that neither moves nor errs, has no statistics."""
    lost = np.where(TIME_S > 2.0, np.nan, MOTION)
    assert set(channel_statistics(TIME_S, MOTION, lost, {}).to_document().values()) == {None}
    still = np.full_like(TIME_S, 0.3)
    assert set(channel_statistics(TIME_S, still, still, {}).to_document().values()) == {None}
