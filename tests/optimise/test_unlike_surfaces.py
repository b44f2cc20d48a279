"""Morphs of an aircraft whose wings and tail have other numbers of links and lift factors."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.models.parameters_document import parameters_document
from morphcore.optimise import optimisation_from_request
from morphcore.simulate.request import simulation_from_document
from morphdata import aircraft as documents
from morphdata import flight as flights
from morphdata.optimize import OptimizeRequest
from tests.models.test_every_surface_its_own import LATTICE, NAMES, surface
from tests.optimise.morphs import last

AIRCRAFT = {
    "fuselage": {"length_m": 5.0, "width_m": 0.5, "height_m": 0.5, "density_kg_m3": 60.0},
    "surfaces": [surface(name) for name in NAMES],
}
FLIGHT = {"airspeed_m_s": 70.0, "air_density_kg_m3": 1.225}
LINKS = {"wing": 3, "tail": 1}
MORPH = {"kind": "constant_rate", "final_rad": 0.2, "duration_s": 0.3}


def request(**change: Any) -> dict[str, Any]:
    """Aircraft, flight and model, the latter in the form of a result."""
    aircraft = Aircraft.of(documents.Aircraft.parse(AIRCRAFT))
    flight = Flight.of(flights.Flight.parse(FLIGHT))
    model = chain_model(aircraft, flight, LINKS, LATTICE)
    batch = physical_guess(model, apart=("tail",)).changed(lift_factor=np.array([[1.05, 0.9]]))
    known = parameters_document(batch) | {"lattice": LATTICE.to_document(), "step_s": 0.01, "start": "trim"}
    return {"aircraft": AIRCRAFT, "flight": FLIGHT, "model": {"parameters": known}} | change


def test_a_morph_is_optimised() -> None:
    """By a request, with the model as it is."""
    document = request(
        morph={"final_rad": 0.4, "duration_s": 0.8, "settle_s": 0.2},
        limits={"max_rate_rad_s": 0.9},
        search={"particles": 3, "generations": 1, "seed": 5},
        verify="none",
    )
    run = optimisation_from_request(OptimizeRequest.parse(document))
    model, batch = run.chain("equivalent")
    assert model.links_per_wing == LINKS
    assert model.on_surface(batch, 2)["lift_factor"].tolist() == [0.9]
    found = run.result(last(run).checkpoint).to_document()
    assert found["variation"]["optimum"]["equivalent"] is not None


def test_a_factor_of_no_surface_is_refused_by_requests() -> None:
    """With the names to use, before anything is flown."""
    document = request(schedules={"both": MORPH}, duration_s=0.5)
    document["model"]["kind"] = "equivalent"
    document["model"]["parameters"]["aero"]["lift_factors"] = {"fin": 0.9}
    with pytest.raises(InvalidInput) as caught:
        simulation_from_document(document)
    assert caught.value.pointer == "/model/parameters/aero/lift_factors/fin"
    assert "wing, tail" in caught.value.hint
