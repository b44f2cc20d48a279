"""Posterior draws and profiles against algebra and quadrature, on models whose residuals are formulas."""

from __future__ import annotations

import io

import numpy as np
import pytest
from numpy.typing import NDArray

from morphcore.errors import InvalidInput
from morphcore.identify.chains import effective_samples, r_hat
from morphcore.identify.likelihood import Likelihood
from morphcore.identify.parameters import SearchSpace, search_space
from morphcore.identify.posterior import posterior
from morphcore.identify.profile import CRITICAL, profile, require_names
from morphcore.models.equivalent import chain_model
from morphdata.uncertainty import PosteriorSettings, PosteriorSummary
from morphdata.uncertainty import Profile as ProfileDocument
from tests.identify.flights import reference_aircraft, reference_flight

Array = NDArray[np.float64]

VARIANCE = 4e-8
ROWS = 60
BEND = 1.5  # of the valley


def rigid_space() -> SearchSpace:
    """Four unknowns: the corrections of rigid wings."""
    return search_space(chain_model(reference_aircraft(), reference_flight(), 1))


def linear_problem(space: SearchSpace, middle_scale: Array | None = None) -> tuple[Likelihood, Array]:
    """Likelihood of a linear model around the guess, with noise that scores see more or less of."""
    rng = np.random.default_rng(1)
    jacobian = 4e-4 * rng.normal(size=(ROWS, space.dimension))
    middle = VARIANCE * jacobian.T @ jacobian
    if middle_scale is not None:
        middle = middle * np.outer(middle_scale, middle_scale)
    return Likelihood(jacobian, middle, space.guess, space.lower, space.upper), jacobian


def test_effective_size_is_that_of_first_order_chains() -> None:
    """Chains of correlation 0.8 are worth (1 - 0.8) / (1 + 0.8) of their length, within a tenth."""
    rng = np.random.default_rng(2)
    draws = rng.normal(size=(2000, 32, 2))
    for step in range(1, draws.shape[0]):
        draws[step, :, 0] = 0.8 * draws[step - 1, :, 0] + 0.6 * draws[step, :, 0]
    found = effective_samples(draws)
    assert found[0] == pytest.approx(64_000 * 0.2 / 1.8, rel=0.1)
    assert found[1] == pytest.approx(64_000, rel=0.1)
    np.testing.assert_allclose(r_hat(draws), 1.0, atol=0.005)
    assert r_hat(draws + np.arange(32)[:, None] / 16.0).min() > 1.05
    assert effective_samples(draws + np.arange(32)[:, None] / 16.0).max() < 1000


def test_white_noise_gives_the_normal_likelihood() -> None:
    """With M = v D'D the scores and the rest together are r'r / v, for residuals of any shape."""
    space = rigid_space()
    likelihood, _ = linear_problem(space)
    rng = np.random.default_rng(3)
    points = space.guess + 0.1 * rng.uniform(-1.0, 1.0, size=(5, space.dimension))
    residual = 1e-3 * rng.normal(size=(5, ROWS))
    expected = -0.5 * (np.sum(residual**2, axis=1) / VARIANCE + np.sum((points - space.guess) ** 2, axis=1))
    np.testing.assert_allclose(likelihood.log_density(points, residual), expected, rtol=1e-9)
    assert likelihood.log_density(space.upper[None] + 1.0, residual[:1])[0] == -np.inf


def test_draws_of_a_linear_model_spread_like_the_sandwich() -> None:
    """Scores noisier than a white model's: draws have the sandwich covariance, with the prior."""
    space = rigid_space()
    likelihood, jacobian = linear_problem(space, np.array([1.0, 2.0, 1.5, 1.0]))
    truth = space.guess + np.array([0.05, -0.04, 0.03, 0.02])

    def residuals(points: Array) -> Array:
        return np.asarray((points - truth) @ jacobian.T)

    found = posterior(
        space, space.guess, likelihood, residuals, PosteriorSettings(samples=2000, max_flights=60_000)
    )
    bread = np.linalg.inv(jacobian.T @ jacobian)
    precision = np.linalg.inv(bread @ likelihood.middle @ bread)
    expected = np.linalg.inv(precision + np.eye(space.dimension))
    np.testing.assert_allclose(np.sqrt(np.diag(np.cov(found.draws.T)) / np.diag(expected)), 1.0, atol=0.05)
    centre = space.guess + expected @ precision @ (truth - space.guess)
    np.testing.assert_allclose(
        (found.draws.mean(axis=0) - centre) / np.sqrt(np.diag(expected)), 0.0, atol=0.1
    )
    document = PosteriorSummary.model_validate(found.to_document())
    assert document.effective_samples >= 2000
    assert document.r_hat is not None
    assert document.r_hat < 1.03
    assert document.acceptance > 0.9  # a quadratic model of a linear one is exact
    with np.load(io.BytesIO(found.to_file())) as archive:
        assert archive["values"].shape == (document.draws, space.dimension)
        assert list(archive["parameters"]) == list(document.parameters)


@pytest.mark.slow
def test_draws_follow_a_bent_valley() -> None:
    """One coordinate follows the exponential of another: means and spreads are those of quadrature."""
    space = rigid_space()
    centre = space.guess
    scale = np.sqrt(VARIANCE) / np.array([0.5, 0.03, 0.1, 0.1])  # of residuals, by the spread of coordinates

    def residuals(points: Array) -> Array:
        off = points - centre
        off[:, 1] -= 0.1 * (np.exp(BEND * off[:, 0]) - 1.0)
        return np.asarray(off * scale)

    at = np.diag(scale)
    at[1, 0] = -0.1 * BEND * scale[1]
    likelihood = Likelihood(at, VARIANCE * at.T @ at, centre, space.lower, space.upper)
    found = posterior(
        space, centre, likelihood, residuals, PosteriorSettings(samples=3000, max_flights=100_000)
    )
    first, second = (np.linspace(-2.5, 2.5, 1201), np.linspace(-1.5, 2.5, 2401))
    grid = np.stack(np.meshgrid(first, second, indexing="ij"), axis=-1).reshape(-1, 2)
    points = np.tile(centre, (grid.shape[0], 1))
    points[:, :2] += grid
    density = np.where(likelihood.inside(points), 1.0, 0.0)
    density *= np.exp(
        -0.5 * (np.sum(residuals(points)[:, :2] ** 2, axis=1) / VARIANCE + np.sum(grid**2, axis=1))
    )
    density /= density.sum()
    mean = density @ grid
    spread = np.sqrt(density @ (grid - mean) ** 2)
    drawn = found.draws[:, :2] - centre[:2]
    print(found.to_document()["effective_samples"], found.acceptance, mean, drawn.mean(axis=0), spread)
    np.testing.assert_allclose((drawn.mean(axis=0) - mean) / spread, 0.0, atol=0.1)
    np.testing.assert_allclose(drawn.std(axis=0) / spread, 1.0, atol=0.08)
    assert found.r_hat.max() < 1.05


def test_a_profile_of_a_linear_model_is_its_interval() -> None:
    """The rise is the square of the distance in standard deviations; 95 per cent end at 1.96 of them."""
    space = rigid_space()
    likelihood, jacobian = linear_problem(space)

    def residuals(points: Array) -> Array:
        return np.asarray((points - space.guess) @ jacobian.T)

    name, at = "lift_factor", space.names.index("lift_factor")
    found = profile(space, name, space.guess, likelihood, residuals, 9)
    spread = float(np.sqrt(likelihood.covariance[at, at]))
    points = space.guess + np.zeros((9, space.dimension))
    points[:, at] += spread * np.linspace(-3.0, 3.0, 9)
    expected = np.sort(space.flatten(space.decode(points))[:, space.parameter_names.index(name)])
    np.testing.assert_allclose(found.value, expected, rtol=1e-6)
    np.testing.assert_allclose(found.rise, np.linspace(-3.0, 3.0, 9) ** 2, atol=0.02)
    ends = space.guess + np.zeros((2, space.dimension))
    ends[:, at] += spread * np.sqrt(CRITICAL) * np.array([-1.0, 1.0])
    low, high = space.flatten(space.decode(ends))[:, space.parameter_names.index(name)]
    np.testing.assert_allclose(found.interval, (low, high), rtol=0.01)
    ProfileDocument.model_validate(found.to_document())


def test_a_profile_names_a_searched_parameter() -> None:
    """A name that is unknown, or not searched, is refused with those that are."""
    with pytest.raises(InvalidInput, match="bending"):
        require_names(rigid_space(), ["lift_factor", "bending"])
    assert require_names(rigid_space(), ["centre_shift_m"]) == ["ac_offset_m"]
