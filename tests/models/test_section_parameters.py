"""Zero-lift angle and cm0 as parameters of a model: documents of today and yesterday, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Aircraft
from morphcore.models.equivalent import chain_model, fitted, lane_constants, physical_guess
from morphcore.models.parameters_document import parameters_document, parameters_from_document
from morphdata.aircraft import Aircraft as AircraftDocument
from tests.models.chains import EXAMPLES, aircraft_of, example_aircraft, example_flight
from tests.models.test_parameters_document import DOCUMENT

SECTION = {"zero_lift_rad": -0.05, "cm0": -0.06}
COEFFICIENTS = tuple(SECTION)


def cambered() -> Aircraft:
    """The example's aircraft with those sections."""
    aircraft = example_aircraft()
    return replace(aircraft, surfaces=tuple(replace(s, **SECTION) for s in aircraft.surfaces))


def two_pairs() -> Aircraft:
    """Wings and a tail that bends, each with sections of its own."""
    aircraft = example_aircraft()
    tails = [
        replace(
            s, name=f"tail {s.side}", span_m=1.0, position_m=(-2.0, s.position_m[1], -0.4), hinges=(),
            zero_lift_rad=0.02, cm0=0.01,
        )
        for s in aircraft.surfaces
    ]  # fmt: skip
    return replace(cambered(), surfaces=(*cambered().surfaces, *tails))


def test_a_document_of_yesterday_has_the_aircrafts_sections() -> None:
    """Without the coefficients a model flies with the aircraft's; with them, the model's count, zero too."""
    model = chain_model(cambered(), example_flight(), 2)
    old = fitted(model, parameters_from_document(DOCUMENT))
    new = physical_guess(model)
    for number in range(2):
        for name, value in SECTION.items():
            assert model.on_surface(old, number)[name] == model.on_surface(new, number)[name] == value
    same = {"aero": {**DOCUMENT["aero"], **SECTION}}
    flat = {"aero": {**DOCUMENT["aero"], **dict.fromkeys(COEFFICIENTS, 0.0)}}
    rows = [
        lane_constants(model, parameters_from_document({**DOCUMENT, **change}), 0.005).rows
        for change in ({}, same, flat)
    ]
    np.testing.assert_array_equal(rows[0], rows[1])
    assert np.abs(rows[2] - rows[0]).max() > 0.01


def test_a_result_carries_them() -> None:
    """One mirror pair has them among the corrections, several have them by surface; both are read back."""
    model = chain_model(cambered(), example_flight(), 2)
    document = parameters_document(physical_guess(model))
    assert {name: document["aero"][name] for name in COEFFICIENTS} == SECTION
    several = chain_model(two_pairs(), example_flight(), 2)
    guess = physical_guess(several)
    document = parameters_document(guess)
    assert document["surfaces"]["right wing"]["zero_lift_rad"] == -0.05
    assert document["surfaces"]["tail right"]["cm0"] == 0.01
    read = parameters_from_document(document)
    for name in COEFFICIENTS:
        np.testing.assert_array_equal(read[name], guess[name])


@pytest.mark.parametrize("name", COEFFICIENTS)
def test_a_coefficient_of_some_surfaces_only_is_refused(name: str) -> None:
    """Left out of one surface while another or the whole has it: nobody could say which it should be."""
    document = parameters_document(physical_guess(chain_model(two_pairs(), example_flight(), 2)))
    for who in ("right wing", "tail right"):
        part: dict[str, Any] = {**document, "surfaces": {k: dict(v) for k, v in document["surfaces"].items()}}
        del part["surfaces"][who][name]
        with pytest.raises(InvalidInput) as caught:
            parameters_from_document(part)
        assert caught.value.pointer == f"/model/surfaces/{who}/{name}"
    for own in document["surfaces"].values():
        own.pop(name, None)
    with pytest.raises(InvalidInput):
        parameters_from_document(document)
    del document["aero"][name]
    assert name not in parameters_from_document(document).values


@pytest.mark.parametrize(("field", "value"), [("zero_lift_rad", -0.36), ("cm0", 0.51), ("twist_rad", 0.51)])
def test_limits(field: str, value: float) -> None:
    """What no section has is refused with the field at fault."""
    document = AircraftDocument.load(EXAMPLES / "aircraft.json").model_dump(exclude_none=True)
    document["surfaces"][1][field] = value
    with pytest.raises(InvalidInput) as caught:
        aircraft_of(document)
    assert caught.value.pointer == f"/aircraft/surfaces/1/{field}"
