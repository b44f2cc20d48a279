"""The figures of an identification on the sample flights of the independent flexible program."""

from __future__ import annotations

from typing import Any

import pytest

from morphcore import identify
from tests.identify.flights import example, reference_documents

THREE = ("rate_0.2", "rate_0.5", "rate_0.8")


def fits(*names: str, held_out: tuple[str, ...] = (), seed: int = 1) -> dict[str, dict[str, Any]]:
    """The fit of every sample, by name, for three links a wing."""
    samples = [example(name) for name in names] + [example(name, "held_out") for name in held_out]
    document = identify(*reference_documents(), samples, links_per_wing=3, seed=seed).to_document()
    return {fit["sample"].removeprefix("train_"): fit for fit in document["fit"]}


def check_pitch(fit: dict[str, Any], ratio: float, rms_rad: float) -> None:
    """J relative to the rigid model's, and the pitch angle's RMS."""
    print(fit["sample"], fit["J_identified"] / fit["J_rigid"], fit["rms_rad"]["theta"])
    assert fit["J_identified"] <= ratio * fit["J_rigid"]
    assert fit["rms_rad"]["theta"] <= rms_rad


def check_ranges(fit: dict[str, Any], share: float) -> None:
    """Each angle's RMS within a share of its range in the sample."""
    for angle, rms in fit["rms_rad"].items():
        print(fit["sample"], angle, rms / fit["range_rad"][angle])
        assert rms <= share * fit["range_rad"][angle]


def test_three_flights_are_met_within_the_figures() -> None:
    """Three links on three flights: J at most 1e-3 of the rigid model's and pitch within 0.6 mrad, on each.

    The asymmetric flight, which was held back, is met within 3 per cent of each angle's range all the same.
    """
    found = fits(*THREE, held_out=("asymmetric",))
    for name in THREE:
        check_pitch(found[name], 1e-3, 0.6e-3)
    check_ranges(found["asymmetric"], 0.03)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [2, 3, 4, 5])
def test_from_any_seed(seed: int) -> None:
    """The same figures from other seeds."""
    found = fits(*THREE, seed=seed)
    for name in THREE:
        check_pitch(found[name], 1e-3, 0.6e-3)


@pytest.mark.slow
@pytest.mark.parametrize("left_out", THREE)
def test_a_flight_left_out_is_predicted(left_out: str) -> None:
    """Trained on two of the three, the third is met within a factor two of the same figures: no overfit."""
    found = fits(*(name for name in THREE if name != left_out), held_out=(left_out,))
    check_pitch(found[left_out], 2e-3, 1.2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("names", [("asymmetric",), (*THREE, "asymmetric")])
def test_the_asymmetric_flight(names: tuple[str, ...]) -> None:
    """Alone and with the others, the asymmetric flight is met within 3 per cent of each angle's range."""
    check_ranges(fits(*names)["asymmetric"], 0.03)
