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
