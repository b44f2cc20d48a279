"""Parsed JSON in place of documents, and what is neither: refused by its place, not by an attribute."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from morphcore import identify, load_aircraft, load_flight, simulate
from morphcore.errors import InvalidInput

EXAMPLES = Path(__file__).parents[1] / "examples"
AIRCRAFT, FLIGHT = (
    json.loads((EXAMPLES / f"{name}.json").read_text(encoding="utf-8")) for name in ("aircraft", "flight")
)
LOADED: Any = load_aircraft(EXAMPLES / "aircraft.json"), load_flight(EXAMPLES / "flight.json")
MORPH: Any = {"sweep": {"kind": "constant_rate", "final_rad": 0.2, "rate_rad_s": 1.0}}


def flown(aircraft: Any, flight: Any, schedules: Any) -> Any:
    """A short flight of the rigid model."""
    return simulate(aircraft, flight, schedules, model="rigid", duration_s=0.1).trajectory


def test_parsed_json_is_a_document() -> None:
    """What `json.load` returns flies as what `load_aircraft` and `load_flight` return."""
    np.testing.assert_array_equal(flown(AIRCRAFT, FLIGHT, MORPH).euler, flown(*LOADED, MORPH).euler)
    assert np.ptp(flown(AIRCRAFT, FLIGHT, MORPH).drives["sweep_right"]) > 0.05


@pytest.mark.parametrize(
    ("given", "pointer"),
    [
        (("aircraft.json", FLIGHT, MORPH), "/aircraft"),
        ((None, FLIGHT, MORPH), "/aircraft"),
        (({**AIRCRAFT, "surfaces": []}, FLIGHT, MORPH), "/aircraft/surfaces"),
        ((AIRCRAFT, 30.0, MORPH), "/flight"),
        ((AIRCRAFT, {**FLIGHT, "airspeed_m_s": -1.0}, MORPH), "/flight/airspeed_m_s"),
        ((AIRCRAFT, FLIGHT, "morph.csv"), "/schedules"),
        ((AIRCRAFT, FLIGHT, {"sweep": 3}), "/schedules/sweep"),
        ((AIRCRAFT, FLIGHT, {"sweeep": MORPH["sweep"]}), "/schedules/sweeep"),
    ],
)
def test_what_is_neither_is_refused(given: tuple[Any, Any, Any], pointer: str) -> None:
    """A path, a number or a wrong field in place of a document is named."""
    with pytest.raises(InvalidInput) as caught:
        flown(*given)
    assert caught.value.pointer == pointer


@pytest.mark.parametrize("samples", [["flight.csv"], "flight.csv", [{"name": "one"}]])
def test_samples_are_trajectories(samples: Any) -> None:
    """A path in place of a sample says how to read it."""
    with pytest.raises(InvalidInput, match="load_trajectory") as caught:
        identify(*LOADED, samples)
    assert caught.value.pointer == "/samples/0"
