"""Exported models of aircraft with control surfaces."""

from __future__ import annotations

import json

import numpy as np

from morphcore.export.model_tables import model_tables, reference_trim
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.models.parameters_document import parameters_document
from morphdata.aircraft import Aircraft as AircraftDocument
from morphdata.export import ModelFile
from morphdata.lattice import Lattice
from tests.aero.controlled import flight_document, tailed


def tables(document: dict):
    """The groups of arrays of a guess of two links."""
    aircraft, flight = AircraftDocument.parse(document), flight_document()
    chain = chain_model(Aircraft.of(aircraft), Flight.of(flight), 2, Lattice(chordwise=1, spanwise=4))
    batch = physical_guess(chain)
    file = ModelFile.parse(
        {"aircraft": aircraft, "flight": flight, "model": {**parameters_document(batch), "start": "trim"}}
    )
    return model_tables(file, chain, batch, reference_trim(chain, batch, "trim"))


def test_the_controls_are_a_group() -> None:
    """Each control has a row, in the order of surfaces; an aircraft without has no such group."""
    document = tailed(flexible=True, hinged=True)
    for surface in document["surfaces"]:
        surface["controls"][0]["angle_rad"] = 0.02
    found = tables(document)["controls"]
    assert found["drive"].tolist() == ["aileron_right", "elevator_right", "aileron_left", "elevator_left"]
    np.testing.assert_array_equal(found["surface_index"], [0, 1, 2, 3])
    np.testing.assert_array_equal(found["sign"], [1.0, 1.0, -1.0, 1.0])
    np.testing.assert_array_equal(found["from"], [0.5, 0.0, 0.5, 0.0])
    np.testing.assert_array_equal(found["angle_rad"], 0.02)
    assert (
        json.loads(str(tables(document)["documents"]["aircraft"]))["surfaces"][0]["controls"][0]["to"] == 0.9
    )
    plain = tailed(flexible=True, hinged=True)
    for surface in plain["surfaces"]:
        del surface["controls"]
    assert "controls" not in tables(plain)


def test_the_reference_trim_holds_them() -> None:
    """A held elevator changes the moment of the exported trim."""
    moments = []
    for angle in (0.0, 0.05):
        document = tailed(flexible=True, hinged=True)
        for surface in (document["surfaces"][1], document["surfaces"][3]):
            surface["controls"][0]["angle_rad"] = angle
        moments.append(tables(document)["trim"]["moment_nm"][1])
    assert moments[1] - moments[0] > 1.0
