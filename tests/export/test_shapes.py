"""Exported models of swept and inclined surfaces hold where their links are."""

from __future__ import annotations

import io
from typing import Any

import numpy as np

from morphcore.export.formats import Export
from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.models.kinematics import link_poses
from morphcore.models.parameters_document import parameters_document
from morphdata.export import ExportRequest
from tests.models.chains import aircraft_of, flight_of, instant
from tests.simulate.test_shapes import FIN, wings

COARSE = {"chordwise": 1, "spanwise": 4}


def test_links_are_where_root_and_rotation_put_them() -> None:
    """From `root_m`, `rotation` and the links' origins follow the poses of all links with hinges at zero."""
    aircraft: dict[str, Any] = {
        "fuselage": {"mass_kg": 60.0, "inertia_kg_m2": [30.0, 120.0, 140.0]},
        "surfaces": [*wings(), FIN],
    }
    flight = {"airspeed_m_s": 45.0, "air_density_kg_m3": 1.225}
    model = chain_model(aircraft_of(aircraft), flight_of(flight), 3)
    batch = physical_guess(model)
    known = {**parameters_document(batch), "lattice": COARSE, "step_s": 0.005, "start": "trim"}
    request = {"aircraft": aircraft, "flight": flight, "model": {"parameters": known}, "format": "npz"}
    found = np.load(io.BytesIO(Export(ExportRequest.parse(request)).data()))
    R_BL, r_B = link_poses(
        model, batch, instant(model, np.zeros((2, 3))).hinges[0], np.zeros((1, model.coordinates))
    )
    owner, place = found["links.surface_index"], np.zeros(3)
    for link, number in enumerate(owner):
        rotation = found["surfaces.rotation"][number]
        first = link == found["surfaces.first_link_index"][number]
        origin = found["links.origin_m"][link]
        place = origin if first else place + rotation @ origin
        np.testing.assert_allclose(R_BL[0, link], rotation, rtol=0.0, atol=1e-15)
        np.testing.assert_allclose(r_B[0, link], place, rtol=0.0, atol=1e-13)
    roots = r_B[0, found["surfaces.first_link_index"]]
    np.testing.assert_allclose(found["surfaces.root_m"], roots, rtol=0.0, atol=1e-15)


def test_surfaces_may_have_other_numbers_of_links_and_lift_factors() -> None:
    """Wings of three links and a fin of two: all arrays follow, and rows of fewer links end in zeros."""
    aircraft: dict[str, Any] = {
        "fuselage": {"mass_kg": 60.0, "inertia_kg_m2": [30.0, 120.0, 140.0]},
        "surfaces": [*wings(), {**FIN, "flexible": True}],
    }
    flight = {"airspeed_m_s": 45.0, "air_density_kg_m3": 1.225}
    names = [surface["name"] for surface in aircraft["surfaces"]]
    links = {**dict.fromkeys(names[:2], 3), names[2]: 2}
    model = chain_model(aircraft_of(aircraft), flight_of(flight), links)
    batch = physical_guess(model, apart=(names[2],)).changed(lift_factor=np.array([[1.1, 0.9]]))
    known = {**parameters_document(batch), "lattice": COARSE, "step_s": 0.005, "start": "trim"}
    request = {"aircraft": aircraft, "flight": flight, "model": {"parameters": known}, "format": "npz"}
    found = np.load(io.BytesIO(Export(ExportRequest.parse(request)).data()))
    assert found["surfaces.links"].tolist() == [3, 3, 2]
    assert found["surfaces.lift_factor"].tolist() == [1.1, 1.1, 0.9]
    assert found["joints.stiffness_nm_rad"].shape == (5, 3)
    shares = found["parameters.division"]
    assert shares[2, 2] == 0.0
    np.testing.assert_allclose(shares.sum(axis=1), 1.0, rtol=1e-15)
