"""Warnings of an optimised morph that come from the trim it starts from."""

from __future__ import annotations

import json
from typing import Any

import pytest

from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.optimise import ScheduleOptimisation
from tests.identify.flights import reference_flight
from tests.models.chains import EXAMPLES, aircraft_of
from tests.optimise.morphs import QUICK, SHORT, last


def warned(softer: float, tail_m: float | None) -> set[str]:
    """Codes of the warnings of a morph of the example aircraft, wings softer, with a tail this far down."""
    document: dict[str, Any] = json.loads((EXAMPLES / "aircraft.json").read_text(encoding="utf-8"))
    for surface in document["surfaces"]:
        surface["material"]["youngs_modulus_pa"] /= softer
    if tail_m is not None:
        tail = {"span_m": 0.5, "chord_m": 0.2, "thickness_m": 0.02, "material": surface["material"]}
        for side, y in (("right", 0.35), ("left", -0.35)):
            place = {"name": f"{side} tail", "side": side, "position_m": [-1.5, y, tail_m], "flexible": False}
            document["surfaces"].append({**tail, **place})
    aircraft = aircraft_of(document)
    model = chain_model(aircraft, reference_flight(), 2)
    run = ScheduleOptimisation(
        aircraft, reference_flight(), physical_guess(model), morph=SHORT, search=QUICK, verify="none"
    )
    return {warning["code"] for warning in run.result(last(run).checkpoint).warnings}


@pytest.mark.parametrize(
    ("softer", "tail_m", "expected"),
    [(1.0, None, set()), (8.0, None, {"large_bending"}), (1.0, 0.1, {"surface_in_wake"}), (1.0, -0.6, set())],
)
def test_the_trim_of_a_morph_is_judged(softer: float, tail_m: float | None, expected: set[str]) -> None:
    """Tips far up and a tail in the wing's wake warn as in a simulation; a tail well clear does not."""
    assert warned(softer, tail_m) & {"large_bending", "surface_in_wake"} == expected
