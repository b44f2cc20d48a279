"""The demonstration holds a flight out and says in plain words what its result is worth."""

from __future__ import annotations

import copy
import importlib
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

EXAMPLES = Path(__file__).resolve().parent.parent.parent / "examples"
Document = dict[str, Any]


@pytest.fixture
def demo(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The script, imported as its folder sees it."""
    monkeypatch.syspath_prepend(EXAMPLES)
    return importlib.import_module("demo")


def fit(role: str, *, error_rad: float | None, motion_rad: float = 0.2) -> Document:
    """Give the fit of one flight that moves in pitch alone."""
    return {
        "sample": f"a {role} flight",
        "role": role,
        "J_identified": None if error_rad is None else 1e-6,
        "rms_rad": {"phi": 0.0, "theta": error_rad, "psi": 0.0},
        "range_rad": {"phi": 0.0, "theta": motion_rad, "psi": 0.0},
    }


def judged(demo: ModuleType, *fits: Document, **more: Any) -> Any:
    """Judge a result of these fits."""
    return demo.verdict({"fit": list(fits), **more}, "use it")


def test_one_flight_is_held_out(demo: ModuleType) -> None:
    """The request fits some flights and keeps exactly one to predict."""
    roles = [sample["role"] for sample in demo.request()["samples"]]
    assert sorted(roles) == ["held_out", "train", "train"]


@pytest.mark.parametrize(
    ("error_rad", "grade"), [(1e-4, "good"), (4e-3, "usable"), (2e-2, "poor"), (None, "poor")]
)
def test_the_held_out_error_gives_the_grade(demo: ModuleType, error_rad: float | None, grade: str) -> None:
    """Good below one per cent of the motion, usable below five, else poor; fitted flights do not count."""
    found = judged(demo, fit("train", error_rad=1e-7), fit("held_out", error_rad=error_rad))
    assert found.grade == grade
    assert "a held_out flight" in found.reasons[0]
    assert found.next_steps, "there is always something to do next"
    assert ("use it" in found.next_steps) == (grade != "poor")


def test_the_worst_of_several_counts(demo: ModuleType) -> None:
    """One flight that is predicted badly is not made up for by another."""
    assert judged(demo, fit("held_out", error_rad=1e-5), fit("held_out", error_rad=2e-2)).grade == "poor"


def test_without_a_held_out_flight_a_model_is_usable_at_best(demo: ModuleType) -> None:
    """A fit proves nothing by itself."""
    found = judged(demo, fit("train", error_rad=1e-6))
    assert found.grade == "usable"
    assert any("Hold one flight out" in step for step in found.next_steps)


def test_bounds_and_undetermined_parameters_are_named(demo: ModuleType) -> None:
    """A bound that stopped the search lowers the grade, but not one of a parameter without effect."""
    doubts: Document = {"at_bound": ["lift_factor"], "undetermined": ["lag_s"]}
    found = judged(demo, fit("held_out", error_rad=1e-5), uncertainty=doubts)
    assert found.grade == "usable"
    assert "lift_factor" in found.reasons[1]
    assert "lag_s" in found.reasons[2]
    harmless = copy.deepcopy(doubts)
    harmless["undetermined"] = ["lag_s", "lift_factor"]
    assert judged(demo, fit("held_out", error_rad=1e-5), uncertainty=harmless).grade == "good"


def test_a_warning_lowers_the_grade(demo: ModuleType) -> None:
    """What the method does not answer for is not good."""
    warnings = [{"code": "large_alpha", "message": "m", "hint": "h", "pointer": ""}]
    assert judged(demo, fit("held_out", error_rad=1e-5), warnings=warnings).grade == "usable"
