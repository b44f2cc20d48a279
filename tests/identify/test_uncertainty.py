"""Uncertainty against linear regression, noise studies and a direction that no sample sees."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from morphcore.identify.cost import residuals, sample_cases
from morphcore.identify.parameters import search_space
from morphcore.identify.polish import differences, first_polish, next_polish
from morphcore.identify.uncertainty import uncertainty
from morphcore.models.equivalent import chain_model
from tests.identify.flights import reference_aircraft, reference_flight, synthetic

NOISE_RAD = 2e-4


def test_covariance_is_that_of_linear_regression() -> None:
    """For a linear model the covariance is s^2 (A^T A)^-1, computed here by the normal equations."""
    space = search_space(chain_model(reference_aircraft(), reference_flight(), 2))
    rng = np.random.default_rng(1)
    matrix, noise = rng.normal(size=(200, space.dimension)), rng.normal(0.0, 0.1, 200)
    found = uncertainty(space, space.guess, noise, matrix)
    expected = noise @ noise / (200 - space.dimension) * np.linalg.inv(matrix.T @ matrix)
    np.testing.assert_allclose(found.covariance, expected, rtol=1e-9)


def test_an_unseen_parameter_is_reported() -> None:
    """A column of zeros in the Jacobian is a direction that the samples cannot see."""
    space = search_space(chain_model(reference_aircraft(), reference_flight(), 2))
    rng = np.random.default_rng(1)
    matrix, noise = rng.normal(size=(200, space.dimension)), rng.normal(0.0, 0.1, 200)
    blind = space.names.index("damping_nms_rad.joint_1.lag")
    matrix[:, blind] = 0.0
    (direction,) = uncertainty(space, space.guess, noise, matrix).to_document()["unidentifiable"]
    assert set(direction["direction"]) == {"damping_nms_rad.joint_1.lag"}


def test_standard_errors_cover_the_truth() -> None:
    """Refits of one flight under fresh noise scatter as the standard errors say.

    Two corrections are sought from twelve noisy copies of a flight with known parameters. The estimates'
    deviations from the truth, in standard errors, must have a mean square near one: chi-square with 24
    degrees of freedom lies in 0.4..2.0 with 99.8 per cent probability.
    """
    model = chain_model(reference_aircraft(), reference_flight(), 2)
    space = search_space(model, aero_coefficients=["lift_factor", "centre_shift_m"])
    chosen = np.array([space.names.index("lift_factor"), space.names.index("centre_shift_m")])
    truth = space.guess.copy()
    truth[chosen] = [0.3, 0.5]
    clean = synthetic(space.decode(truth), right_rad=0.5)
    deviations = []
    for seed in range(12):
        noise = np.random.default_rng(seed).normal(0.0, NOISE_RAD, clean.euler.shape)
        noisy = clean.euler + noise
        sample = replace(clean, phi=noisy[:, 0], theta=noisy[:, 1], psi=noisy[:, 2])
        cases = sample_cases(model, [sample])

        def errors(points: np.ndarray, cases: object = cases) -> np.ndarray:  # type: ignore[type-arg]
            x = np.tile(space.guess, (points.shape[0], 1))
            x[:, chosen] = points
            return residuals(model, space.decode(x), cases, "trim")  # type: ignore[arg-type]

        lower, upper = space.lower[chosen], space.upper[chosen]
        start = space.guess[chosen][None, :]
        state = first_polish(start, np.sum(errors(start) ** 2, axis=1))
        for _ in range(4):
            state = next_polish(state, lower, upper, errors, 1)
        residual, jacobian = differences(state.point, upper, errors)
        variance = residual[0] @ residual[0] / (residual.size - 2)
        covariance = variance * np.linalg.inv(jacobian[0].T @ jacobian[0])
        deviations.append((state.point[0] - truth[chosen]) / np.sqrt(np.diag(covariance)))
    assert 0.4 < np.mean(np.square(deviations)) < 2.0
