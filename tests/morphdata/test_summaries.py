"""What a listing says of the drives that move: nothing of the plain sweep, the names of all others."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import pytest

from morphdata.identify import EXAMPLE_REQUEST
from morphdata.operations import operation_named
from morphdata.optimize import EXAMPLE_OPTIMIZATION
from morphdata.simulate import EXAMPLE_SIMULATION

TWO_HINGES = json.loads(
    (Path(__file__).parents[2] / "examples" / "two_hinges" / "aircraft.json").read_text("utf-8")
)
RATE = {"kind": "constant_rate", "final_rad": 0.3, "rate_rad_s": 0.4}


def summary(operation: str, request: dict[str, Any]) -> list[str]:
    """The drives in the summary of a request."""
    known = operation_named(operation)
    found: list[str] = known.summary(known.request.parse(request))["drives"]
    return found


@pytest.mark.parametrize(
    ("operation", "request_"),
    [("identify", EXAMPLE_REQUEST), ("simulate", EXAMPLE_SIMULATION), ("optimize", EXAMPLE_OPTIMIZATION)],
)
def test_plain_sweep_is_not_worth_a_word(operation: str, request_: dict[str, Any]) -> None:
    """The examples sweep both wings, and their listings say what they said before."""
    assert summary(operation, request_) == []


def test_other_drives_are_named() -> None:
    """Both sides of a kind under its word, one side by its own name."""
    request = {**copy.deepcopy(EXAMPLE_SIMULATION), "aircraft": TWO_HINGES}
    assert summary("simulate", {**request, "schedules": {"fold": RATE}}) == ["fold"]
    assert summary("simulate", {**request, "schedules": {"sweep": RATE, "fold_left": RATE}}) == [
        *("sweep", "fold_left")
    ]
    morph = {**copy.deepcopy(EXAMPLE_OPTIMIZATION), "aircraft": TWO_HINGES}
    morph["morph"] = {**morph["morph"], "drive": "fold", "final_rad": 0.3}
    assert summary("optimize", morph) == ["fold"]


def test_the_drives_of_samples_are_those_that_were_measured() -> None:
    """A drive without a column holds its angle and is not listed."""
    request = {**copy.deepcopy(EXAMPLE_REQUEST), "aircraft": TWO_HINGES}
    sample = request["samples"][0]
    for side in ("left", "right"):
        sample[f"fold_{side}_rad"] = sample.pop(f"sweep_{side}_rad")
    assert summary("identify", request) == ["fold"]
