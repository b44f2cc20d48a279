"""The verdict says in plain words what an identification is worth."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from morphid.verdict import Verdict, verdict

Document = dict[str, Any]


def fit(role: str, *, error_rad: float | None, motion_rad: float = 0.2) -> Document:
    """Give the fit of one flight that moves in pitch alone."""
    return {
        "sample": f"a {role} flight",
        "role": role,
        "J_identified": None if error_rad is None else 1e-6,
        "rms_rad": {"phi": 0.0, "theta": error_rad, "psi": 0.0},
        "range_rad": {"phi": 0.0, "theta": motion_rad, "psi": 0.0},
    }


def judged(*fits: Document, **more: Any) -> Verdict:
    """Judge a result of these fits."""
    return verdict({"fit": list(fits), **more}, "use it")


@pytest.mark.parametrize(
    ("error_rad", "grade"), [(1e-4, "good"), (4e-3, "usable"), (2e-2, "poor"), (None, "poor")]
)
def test_the_held_out_error_gives_the_grade(error_rad: float | None, grade: str) -> None:
    """Good below one per cent of the motion, usable below five, else poor; fitted flights do not count."""
    found = judged(fit("train", error_rad=1e-7), fit("held_out", error_rad=error_rad))
    assert found.grade == grade
    assert "a held_out flight" in found.reasons[0]
    assert found.next_steps, "there is always something to do next"
    assert ("use it" in found.next_steps) == (grade != "poor")


def test_the_worst_of_several_counts() -> None:
    """One flight that is predicted badly is not made up for by another."""
    assert judged(fit("held_out", error_rad=1e-5), fit("held_out", error_rad=2e-2)).grade == "poor"


def test_without_a_held_out_flight_a_model_is_usable_at_best() -> None:
    """A fit proves nothing by itself."""
    found = judged(fit("train", error_rad=1e-6))
    assert found.grade == "usable"
    assert any("Hold one flight out" in step for step in found.next_steps)


def test_bounds_and_undetermined_parameters_are_named() -> None:
    """A bound that stopped the search lowers the grade, but not one of a parameter without effect."""
    doubts: Document = {"at_bound": ["lift_factor"], "undetermined": ["lag_s"]}
    found = judged(fit("held_out", error_rad=1e-5), uncertainty=doubts)
    assert found.grade == "usable"
    assert "lift_factor" in found.reasons[1]
    assert "lag_s" in found.reasons[2]
    harmless = copy.deepcopy(doubts)
    harmless["undetermined"] = ["lag_s", "lift_factor"]
    assert judged(fit("held_out", error_rad=1e-5), uncertainty=harmless).grade == "good"


def test_a_warning_lowers_the_grade() -> None:
    """What the method does not answer for is not good."""
    warnings = [{"code": "large_alpha", "message": "m", "hint": "h", "pointer": ""}]
    assert judged(fit("held_out", error_rad=1e-5), warnings=warnings).grade == "usable"
