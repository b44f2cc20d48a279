"""Uncertainty against linear regression, noise studies and a direction that no sample sees."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from morphcore.identify.cost import residuals, sample_cases
from morphcore.identify.parameters import SearchSpace, search_space
from morphcore.identify.uncertainty import uncertainty
from morphcore.models.equivalent import chain_model
from morphcore.search.least_squares import LeastSquares, differences
from tests.identify.flights import reference_aircraft, reference_flight, synthetic
from tests.search.problems import Formula, searched

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
    blind = space.names.index("damping_nms_rad.joint_1.edgewise")
    matrix[:, blind] = 0.0
    (direction,) = uncertainty(space, space.guess, noise, matrix).to_document()["unidentifiable"]
    former = "damping_nms_rad.joint_1.lag"  # written as well throughout version 0.2
    assert set(direction["direction"]) == {"damping_nms_rad.joint_1.edgewise", former}


def test_standard_errors_cover_the_truth() -> None:
    """Refits of one flight under fresh noise scatter as the standard errors say.

    Two corrections are searched from twelve noisy copies of a flight with known parameters. The estimates'
    deviations from the truth, in standard errors, must have a mean square near one: chi-square with 24
    degrees of freedom lies in 0.4..2.0 with 99.8 per cent probability.
    """
    model = chain_model(reference_aircraft(), reference_flight(), 2)
    space = search_space(model, aero_coefficients=["lift_factor", "ac_offset_m"])
    chosen = np.array([space.names.index("lift_factor"), space.names.index("ac_offset_m")])
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

        upper = space.upper[chosen]
        problem = Formula(errors, space.lower[chosen], upper, space.guess[chosen])
        best = searched(problem, LeastSquares(problem, 4))[-1].best
        residual, jacobian = differences(best[None, :], upper, errors)
        variance = residual[0] @ residual[0] / (residual.size - 2)
        covariance = variance * np.linalg.inv(jacobian[0].T @ jacobian[0])
        deviations.append((best - truth[chosen]) / np.sqrt(np.diag(covariance)))
    assert 0.4 < np.mean(np.square(deviations)) < 2.0


def seen_space(**bounds: tuple[float, float]) -> tuple[SearchSpace, np.ndarray, np.ndarray]:
    """The unknowns of three links, with residuals and a Jacobian that determines all of them."""
    space = search_space(chain_model(reference_aircraft(), reference_flight(), 3), bounds=bounds)
    rng = np.random.default_rng(2)
    return space, rng.normal(0.0, 1.0, 400), 60.0 * rng.normal(size=(400, space.dimension))


def test_intervals_hold_95_per_cent_of_the_estimates() -> None:
    """Estimates drawn with the covariance lie in each parameter's interval 95 times in a hundred.

    The covariance is that of the search coordinates; intervals are in each parameter's own unit. 20,000 draws
    leave 0.3 per cent of chance; what the shares' curvature leaves is below 1.
    """
    space, noise, jacobian = seen_space()
    found = uncertainty(space, space.guess, noise, jacobian)
    draws = np.random.default_rng(3).multivariate_normal(space.guess, found.covariance, 20_000)
    values = space.flatten(space.decode(draws))
    assert set(found.intervals) == set(np.array(space.parameter_names)[space.searched])
    for name, (low, high) in found.intervals.items():
        assert low is not None, name
        assert high is not None, name
        column = values[:, space.parameter_names.index(name)]
        assert np.mean((column >= low) & (column <= high)) == pytest.approx(0.95, abs=0.012), name
    assert found.undetermined == ()
    stiff = found.intervals["stiffness_nm_rad.joint_1.flap"]
    at = space.flatten(space.decode(space.guess))[0][
        space.parameter_names.index("stiffness_nm_rad.joint_1.flap")
    ]
    assert stiff[0] * stiff[1] == pytest.approx(at**2)  # type: ignore[operator] - of one factor both ways


def test_limits_of_named_parameters_are_those_of_the_box() -> None:
    """The least and the greatest value of each parameter at random points and corners of the box."""
    space, _, _ = seen_space(division=(0.2, 0.6))
    rng = np.random.default_rng(5)
    inside = rng.uniform(space.lower, space.upper, size=(4000, space.dimension))
    corners = np.where(rng.uniform(size=(4000, space.dimension)) < 0.5, space.lower, space.upper)
    values = space.flatten(space.decode(np.concatenate([inside, corners])))
    seen = np.stack([values.min(axis=0), values.max(axis=0)], axis=1)
    np.testing.assert_allclose(space.parameter_limits, seen, rtol=1e-9, atol=1e-12)


def test_a_parameter_at_its_bound_is_open_there() -> None:
    """It is listed by its name, its interval has no end on that side; what nothing shows has none at all."""
    space, noise, jacobian = seen_space()
    x = space.guess.copy()
    bounded = space.names.index("damping_nms_rad.joint_2.flap")
    x[bounded] = space.lower[bounded]
    x[space.names.index("log_ratio.1")] = space.upper[space.names.index("log_ratio.1")]
    jacobian[:, space.names.index("stiffness_nm_rad.joint_1.edgewise")] *= 1e-4
    document = uncertainty(space, x, noise, jacobian).to_document()
    assert document["at_bound"] == ["division.1", "damping_nms_rad.joint_2.flap"]
    low, high = document["interval_95"]["damping_nms_rad.joint_2.flap"]
    assert low is None
    assert (
        high > space.flatten(space.decode(x))[0][space.parameter_names.index("damping_nms_rad.joint_2.flap")]
    )
    assert document["interval_95"]["division.1"][1] is None
    assert document["interval_95"]["stiffness_nm_rad.joint_1.edgewise"] == [None, None]
    assert document["undetermined"] == [
        "stiffness_nm_rad.joint_1.edgewise",
        "stiffness_nm_rad.joint_1.lag",  # its former name
    ]


def test_what_is_not_searched_has_no_interval() -> None:
    """Fixed corrections, and the one share of a rigid wing, are known: an interval would be a guess."""
    space = search_space(
        chain_model(reference_aircraft(), reference_flight(), 1), aero_coefficients=["lift_factor"]
    )
    rng = np.random.default_rng(1)
    found = uncertainty(space, space.guess, rng.normal(size=50), rng.normal(size=(50, 1)))
    assert list(found.intervals) == ["lift_factor"]
