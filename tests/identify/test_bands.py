"""Predictive bands hold measured rows of flights that were not fitted, and belief comes with a result."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from morphcore.identify.bands import predict_bands
from morphcore.identify.identification import Identification
from morphcore.identify.parameters import search_space
from morphcore.identify.result import IdentifyResult
from morphcore.identify.settings import search_settings
from morphcore.models.equivalent import chain_model
from morphcore.simulate.trajectory import Trajectory
from morphdata.identified import Uncertainty as UncertaintyDocument
from morphdata.identify import EquivalentModel, IdentifySearch
from morphdata.uncertainty import PosteriorSettings, UncertaintySettings
from tests.identify.flights import reference_aircraft, reference_flight, synthetic

Array = NDArray[np.float64]

NOISE_RAD = 2e-4
HELD_OUT = {"fast": (0.8, 0.8, 0.6), "mixed": (0.6, 0.2, 0.9)}


def noisy(sample: Trajectory, rng: np.random.Generator, role: str = "train") -> Trajectory:
    """A flight with white noise on all angles, from the first row on."""
    angles = sample.euler + NOISE_RAD * rng.normal(size=sample.euler.shape)
    return replace(sample, phi=angles[:, 0], theta=angles[:, 1], psi=angles[:, 2], role=role)  # type: ignore[arg-type]


def identified(
    seed: int, links: int = 2, settings: UncertaintySettings | None = None
) -> tuple[IdentifyResult, list[Trajectory]]:
    """An identification from two noisy flights of a chain near the guess, and noisy flights held out."""
    rng = np.random.default_rng(seed)
    space = search_space(chain_model(reference_aircraft(), reference_flight(), links))
    truth = space.decode(space.guess + rng.uniform(-0.3, 0.3, space.dimension))
    trained = [synthetic(truth, name="even"), synthetic(truth, name="uneven", left_rad=0.3, right_rad=0.7)]
    unseen = [
        noisy(synthetic(truth, name=name, left_rad=left, right_rad=right, duration_s=time), rng, "held_out")
        for name, (left, right, time) in HELD_OUT.items()
    ]
    run = Identification(
        reference_aircraft(),
        reference_flight(),
        [*(noisy(sample, rng) for sample in trained), *unseen],
        EquivalentModel(links_per_wing=links, step_s=0.01),
        search_settings(IdentifySearch(method="least_squares")),
        uncertainty=settings,
    )
    checkpoint = b""
    for step in run.steps():
        checkpoint = step.checkpoint
    return run.result(checkpoint), unseen


def test_what_is_requested_comes_with_the_result() -> None:
    """Posterior, a profile and bands of held-out flights, in the documents that the API fixes.

    Of rigid wings, whose four corrections two noisy flights determine: the middle of the posterior lies
    within two standard errors of the estimate, and most rows of the held-out flights in their bands.
    """
    settings = UncertaintySettings(
        posterior=PosteriorSettings(samples=100, max_flights=3000), profile=["lift_factor"], profile_points=5
    )
    result, unseen = identified(1, 1, settings)
    document = UncertaintyDocument.model_validate(result.to_document()["uncertainty"])
    assert document.posterior is not None
    drawn = document.posterior.parameters["lift_factor"]
    error = document.standard_error["lift_factor"]
    assert error is not None
    assert abs(drawn.quantile_50 - float(result.parameters["lift_factor"][0])) < 2.0 * error
    assert drawn.standard_deviation == pytest.approx(error, rel=0.4)
    assert len(document.profile["lift_factor"].value) == 5
    assert {band.sample for band in result.bands} == set(HELD_OUT)
    shares = [np.mean(band.holds(each.euler)) for band, each in zip(result.bands, unseen, strict=True)]
    assert min(shares) > 0.75
    curves = {each["name"]: each for each in result.curves()["samples"]}
    assert set(curves["fast"]["band"]) == {"phi_rad", "theta_rad", "psi_rad"}
    assert set(curves["fast"]["band"]["theta_rad"]) == {"low", "high"}
    assert "band" not in curves["even"]
    again = predict_bands(result, unseen, seed=1)
    np.testing.assert_allclose(again[0].lower, result.bands[0].lower, atol=1e-12)


@pytest.mark.extended
@pytest.mark.slow
@pytest.mark.parametrize("links", [2, 3])
def test_bands_hold_rows_of_unseen_flights(links: int) -> None:
    """Of twenty identifications' held-out rows, noise and all, 90 to 99 per cent lie in the bands."""
    shares = []
    for seed in range(20):
        result, unseen = identified(seed, links)
        bands = {band.sample: band for band in result.bands}
        shares += [np.mean(bands[each.name].holds(each.euler)) for each in unseen]
    print(links, np.round(shares, 2), np.mean(shares))
    assert 0.90 <= np.mean(shares) <= 0.99
