"""The demonstration holds a flight out."""

from __future__ import annotations

import importlib
from pathlib import Path
from types import ModuleType

import pytest

EXAMPLES = Path(__file__).resolve().parent.parent.parent / "examples"


@pytest.fixture
def demo(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The script, imported as its folder sees it."""
    monkeypatch.syspath_prepend(EXAMPLES)
    return importlib.import_module("demo")


def test_one_flight_is_held_out(demo: ModuleType) -> None:
    """The request fits some flights and keeps exactly one to predict."""
    roles = [sample["role"] for sample in demo.request()["samples"]]
    assert sorted(roles) == ["held_out", "train", "train"]
