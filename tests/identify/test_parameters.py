"""Search coordinates: their box, their meaning, and refusals that name the field."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from morphcore.errors import InvalidInput
from morphcore.identify.parameters import SearchSpace, search_space
from morphcore.models.equivalent import chain_model, physical_guess
from tests.identify.flights import reference_aircraft, reference_flight


def space(links: int = 3, **options: object) -> SearchSpace:
    """The search space of the reference aircraft."""
    return search_space(chain_model(reference_aircraft(), reference_flight(), links), **options)  # type: ignore[arg-type]


@pytest.mark.parametrize("links", [1, 2, 3, 5, 8])
def test_the_guess_decodes_to_beam_theory(links: int) -> None:
    """The centre of the box is the physical guess itself, also in the division of the span."""
    searched = space(links)
    shares = [name.startswith("log_ratio") for name in searched.names]
    centre = 0.5 * (searched.lower + searched.upper)
    np.testing.assert_allclose(centre[shares], searched.guess[shares], atol=1e-12)
    found, expected = searched.decode(searched.guess), physical_guess(searched.model)
    assert found.values.keys() == expected.values.keys()
    for name, value in expected.values.items():
        np.testing.assert_allclose(found[name], value, rtol=1e-12, atol=1e-15)


@settings(max_examples=40, deadline=None)
@given(st.integers(2, 8), st.integers(0, 2**31))
def test_every_point_of_the_box_is_a_model(links: int, seed: int) -> None:
    """Anywhere in the box the divisions sum to one and stiffness, damping, lag and lift are positive."""
    searched = space(links)
    x = np.random.default_rng(seed).uniform(searched.lower, searched.upper, (4, searched.dimension))
    batch = searched.decode(x)
    np.testing.assert_allclose(batch["division"].sum(axis=2), 1.0, rtol=1e-14)
    for values in (
        batch["division"],
        batch["stiffness_nm_rad"],
        batch["damping_nms_rad"],
        batch["lag_s"],
        batch["lift_factor"],
    ):
        assert np.all(values > 0)


def test_bounds_given_in_si_units_hold() -> None:
    """Corners of the box decode to the bounds that the user gave."""
    searched = space(
        3, bounds={"stiffness_nm_rad": [2e4, 3e5], "lift_factor": [0.9, 1.2], "division": [0.2, 0.5]}
    )
    low, high = searched.decode(searched.lower), searched.decode(searched.upper)
    np.testing.assert_allclose([low["stiffness_nm_rad"].min(), high["stiffness_nm_rad"].max()], [2e4, 3e5])
    np.testing.assert_allclose([low["lift_factor"][0], high["lift_factor"][0]], [0.9, 1.2])
    x = np.random.default_rng(0).uniform(searched.lower, searched.upper, (2000, searched.dimension))
    division = searched.decode(x)["division"]
    assert division.min() >= 0.2
    assert division.max() <= 0.5


@pytest.mark.parametrize(("low", "high"), [(0.0, 1.0), (0.1, 0.6), (0.21, 0.46), (0.3, 0.4), (0.26, 0.9)])
def test_bounds_of_the_division_leave_what_room_they_can(low: float, high: float) -> None:
    """The box is centred on the nominal shares (2/9, 4/9, 1/3) where they obey, else on equal ones.

    It is as wide as it can be: no share leaves the bounds anywhere, and one reaches them at a corner, or the
    ratios reach their range of 1.5.
    """
    searched = space(3, bounds={"division": [low, high]})
    ratios = slice(0, 2)
    lower, upper = searched.lower[ratios], searched.upper[ratios]
    nominal = np.array([2 / 9, 4 / 9, 1 / 3]) if low < 2 / 9 and high > 4 / 9 else np.full(3, 1 / 3)
    np.testing.assert_allclose(0.5 * (lower + upper), np.log(nominal[:2] / nominal[2]), atol=1e-9)
    limits = searched.parameter_limits[:3]
    assert limits.min() >= low
    assert limits.max() <= high
    assert np.allclose(upper - lower, 3.0) or np.isclose(limits, [low, high], rtol=1e-9).any()


def test_corrections_that_are_not_searched_stay_neutral() -> None:
    """Leaving a correction out takes it from the box and keeps its physical default."""
    searched = space(2, aero_coefficients=["lift_factor"])
    assert searched.names[-1] == "lift_factor"
    batch = searched.decode(searched.upper)
    assert batch["profile_drag"][0, 0] == 0.01
    assert batch["ac_offset_m"][0] == 0.0


def test_separate_wings_double_the_structural_unknowns() -> None:
    """Each wing gets divisions, stiffness and damping of its own; the corrections are shared."""
    assert space(3, separate_wings=True).dimension == 2 * 14 + 4
    assert space(3).dimension == 14 + 4


@pytest.mark.parametrize(
    ("bounds", "field"),
    [
        ({"stiffness_nm_rad": [-1.0, 5.0]}, "stiffness_nm_rad"),
        ({"stiffness_nm_rad": [1e-9, 1e9]}, "stiffness_nm_rad"),
        ({"damping_nms_rad": [5.0, 5.0]}, "damping_nms_rad"),
        ({"lag_s": [0.0, 1.0]}, "lag_s"),
        ({"lift_factor": [2.0, 1.0]}, "lift_factor"),
        ({"division": [0.4, 0.9]}, "division"),
        ({"lift": [0.5, 1.0]}, "lift"),
        ({"profile_drag": [float("nan"), 1.0]}, "profile_drag"),
    ],
)
def test_absurd_bounds_are_refused_by_name(bounds: dict[str, list[float]], field: str) -> None:
    """Bounds that are empty, of the wrong sign, too wide or unknown give an error that points at them."""
    with pytest.raises(InvalidInput) as caught:
        space(3, bounds=bounds)
    assert caught.value.pointer.startswith(f"/model/bounds/{field}")
    assert caught.value.hint
