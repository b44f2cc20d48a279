"""The verdict says in plain words what an identification is worth."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import pytest

from morphcore.identify.cost import SampleCase
from morphcore.identify.diagnoses import WRONG_DATA
from morphcore.identify.sample_fit import SampleFit
from morphcore.identify.verdict import GRADES, Verdict, verdict
from morphcore.simulate.trajectory import Role, Trajectory
from morphcore.validity import ResultWarning
from morphdata.verdict import Verdict as VerdictDocument

TIME_S = np.arange(0.0, 2.0, 0.01)
MOTION = 0.1 * (1.0 - np.cos(0.5 * np.pi * TIME_S))  # 0.2 rad at the end
RIGID = 0.8 * MOTION


def fit(
    role: Role = "held_out", *, share: float = 1e-3, noise_rad: float = 0.0, lost: bool = False
) -> SampleFit:
    """Give the fit of a flight that moves in pitch alone, missed by a share of its motion."""
    noise = np.random.default_rng(1).normal(0.0, noise_rad, TIME_S.size)
    still = np.zeros_like(TIME_S)
    sample = Trajectory(
        f"a {role} flight", TIME_S, {"sweep": TIME_S}, still, MOTION + noise, still, role=role
    )
    flown = np.stack([still, (1.0 + share) * MOTION, still], axis=1)
    rigid = np.stack([still, RIGID, still], axis=1)
    flown[TIME_S > 1.0] = np.nan if lost else flown[TIME_S > 1.0]
    # no model flies here: the plan is not looked at
    return SampleFit(SampleCase(sample, cast("Any", None)), rigid, rigid, flown)


def warning(code: str, sample: int = 0) -> ResultWarning:
    """Give a warning about a sample."""
    return ResultWarning(code, f"{code} was seen", "mend it", f"/samples/{sample}/theta_rad")


@pytest.mark.parametrize(("share", "grade"), [(1e-3, "good"), (0.02, "usable"), (0.1, "poor")])
def test_the_held_out_error_gives_the_grade(share: float, grade: str) -> None:
    """Good below one per cent of the motion, usable below five, else poor; fitted flights do not count."""
    found = verdict([fit("train", share=1e-4), fit("held_out", share=share)])
    assert found.grade == grade
    assert any("a held_out flight" in reason for reason in found.reasons)


def test_a_held_out_flight_that_diverges_is_poor_and_a_fitted_one_fails() -> None:
    """What the model was fitted to it must fly; J null is no success."""
    assert verdict([fit("train"), fit("held_out", lost=True)]).grade == "poor"
    found = verdict([fit("train", lost=True), fit("held_out")], [warning("flipped_sign")])
    assert found.grade == "failed"
    assert "diverged at t = " in found.reasons[0]
    assert any("Flipped_sign was seen" in reason for reason in found.reasons)


def test_the_worst_of_several_counts() -> None:
    """One flight that is predicted badly is not made up for by another."""
    assert verdict([fit("train"), fit(share=1e-4), fit(share=0.1)]).grade == "poor"


def test_without_a_held_out_flight() -> None:
    """One fitted flight proves nothing; several prove each other, and the verdict says what lacks."""
    alone = verdict([fit("train")])
    assert alone.grade == "usable"
    several = verdict([fit("train"), fit("train")])
    assert several.grade == "good"
    for found in (alone, several):
        assert any("no flight was held out" in reason for reason in found.reasons)
        assert any("Hold one flight out" in step for step in found.next_steps)


def test_white_noise_is_no_error_of_the_model() -> None:
    """Noise of 4 per cent of the motion: what neighbouring rows do not share is not the model's."""
    noisy = fit(noise_rad=0.004)
    errors = noisy.errors("identified")[:, 1]
    assert np.sqrt(np.mean(errors**2)) > 0.02 * np.sqrt(np.mean(MOTION**2))
    assert noisy.error_share() < 0.01
    assert verdict([fit("train"), noisy]).grade == "good"
    # an error of the same size with a shape
    assert verdict([fit("train"), fit(share=0.04)]).grade == "usable"


def test_coloured_residuals_are_reported_where_they_matter() -> None:
    """An error above a hundredth of the motion that follows the drives is said to do so."""
    found = verdict([fit("train"), fit(share=0.03)])
    assert any("correlated from row to row (theta), and with the drives (theta)" in r for r in found.reasons)
    assert not any("correlated" in reason for reason in verdict([fit("train"), fit()]).reasons)


def test_overfitting_is_named() -> None:
    """A flight that is predicted twenty times worse than the fitted ones are met."""
    found = verdict([fit("train", share=1e-3), fit(share=0.02)])
    assert any("20 times worse" in reason for reason in found.reasons)


def test_links_that_gain_nothing_are_poor() -> None:
    """J near the rigid model's."""
    assert any("gain nothing" in reason for reason in verdict([fit("train"), fit(share=-0.19)]).reasons)


def test_bounds_and_undetermined_parameters_are_named() -> None:
    """A bound that stopped the search lowers the grade, but not one of a parameter without effect."""
    fits = [fit("train"), fit()]
    found = verdict(fits, undetermined=["lag_s"], at_bound=["lift_factor"])
    assert found.grade == "usable"
    assert "lift_factor" in found.reasons[0]
    assert any("lag_s" in reason for reason in found.reasons)
    assert verdict(fits, undetermined=["lag_s", "lift_factor"], at_bound=["lift_factor"]).grade == "good"


def test_a_delay_that_the_fit_allows_for_is_usable() -> None:
    """Its parameters are sound, the recorders are not; a fit that did not allow for it is poor."""
    assert verdict([fit("train", share=1e-3), fit()], [warning("late")]).grade == "usable"
    assert verdict([fit("train", share=0.008), fit()], [warning("late")]).grade == "poor"


@pytest.mark.parametrize("code", sorted(WRONG_DATA - {"late"}))
def test_wrong_data_are_poor_however_well_they_fit(code: str) -> None:
    """In a fitted flight; in one that was held out the model is not concerned, only its proof."""
    fits = [fit("train"), fit()]
    found = verdict(fits, [warning(code)])
    assert (found.grade, found.reasons[0]) == ("poor", f"{code.capitalize()} was seen.")
    assert verdict(fits, [warning(code, sample=1)]).grade == "usable"


def test_warnings_of_the_method_lower_the_grade_and_harmless_ones_do_not() -> None:
    """A stalled wing is doubtful; air that is computed as incompressible at one speed is not."""
    fits = [fit("train"), fit()]
    assert verdict(fits, [warning("large_alpha")]).grade == "usable"
    assert verdict(fits, [warning("compressible"), warning("gap")]).grade == "good"


def test_what_the_fit_has_allowed_for_is_said() -> None:
    """Biases and delays are no reason to doubt a fit that knows them."""
    estimates = {"bias": {"phi": {"value": -2e-3}, "psi": {"value": 0.7}}, "delay_s": {"value": 0.0115}}
    found = verdict([fit("train"), fit()], measurement={"a": estimates, "b": {"bias": {}, "delay_s": None}})
    assert found.grade == "good"
    assert (
        "The fit has found and allowed for biases of roll and pitch up to 2 mrad and delays up to 12 ms."
        in (found.reasons)
    )
    assert not any("allowed" in r for r in verdict([fit("train"), fit()], measurement={"a": {}}).reasons)


def test_a_search_that_was_stopped_is_usable_at_best() -> None:
    """Its best so far may be far from the best."""
    assert verdict([fit("train"), fit()], finished=False).grade == "usable"


def test_the_document_is_that_of_the_api() -> None:
    """Grade and reasons stand under the names that the API fixes."""
    found = verdict([fit("train"), fit()])
    document = VerdictDocument.model_validate(found.to_document())
    assert isinstance(found, Verdict)
    assert document.grade in GRADES
    assert document.reasons == list(found.reasons)
