"""Stations and point masses on surfaces with sweep, dihedral and incidence."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from morphcore.geometry.aircraft import Aircraft
from morphcore.geometry.lattice import surface_pose
from morphcore.models.equivalent import physical_guess
from morphdata.aircraft import load_aircraft
from tests.models.chains import EXAMPLES, aircraft_of, example_flight, random_batch, small_model
from tests.models.test_point_masses import of_beams, of_links
from tests.oracles.tree import spatial_inertia
from tests.simulate.flights import assert_mirrored

SHAPE = {"sweep_rad": 0.35, "dihedral_rad": 0.1, "incidence_rad": 0.02}


def swept() -> Aircraft:
    """The example with pods, its wings swept, raised and set; the elastic axis behind mid-chord."""
    document: dict[str, Any] = load_aircraft(EXAMPLES / "pods" / "aircraft.json").model_dump(
        exclude_none=True
    )
    for surface in document["surfaces"]:
        surface.update(SHAPE)
        for row in surface["stations"]:
            row["elastic_axis"] = 0.5 + 0.02 / row["chord_m"]
    return aircraft_of(document)


def test_mass_centre_and_inertia_of_swept_wings() -> None:
    """Chains and beams of any division have those of slices between the rows and of the pods: 1e-9."""
    aircraft = swept()
    fuselage = aircraft.fuselage
    expected = spatial_inertia(fuselage.mass_kg, fuselage.centre_of_mass_B, fuselage.inertia_B)
    points, weights = np.polynomial.legendre.leggauss(8)
    for surface in aircraft.surfaces:
        R_BW, r_B = surface_pose(surface)
        up = surface.span_sign * np.sin(0.1)
        # the root chord, at its incidence, tilted with the dihedral
        aft_B = -np.array([np.cos(0.02), -up * np.sin(0.02), -np.cos(0.1) * np.sin(0.02)])
        along_B = surface.span_sign * R_BW[:, 1]
        for a, b in pairwise(np.array([0.0, 0.45, 1.0]) * 3.0 / np.cos(0.35)):
            y = a + 0.5 * (b - a) * (points + 1.0)
            section = surface.section_at(y)
            chord = np.interp(y * np.cos(0.35) / 3.0, [0.0, 0.45, 1.0], [0.4, 0.36, 0.2])
            ends = np.interp(
                [a, b], [0.0, 0.45 * 3.0 / np.cos(0.35), 3.0 / np.cos(0.35)], [-0.02, -0.018, 0.0]
            )
            aft = ends[0] + (ends[1] - ends[0]) * (y - a) / (b - a)
            assert np.allclose(chord, surface.chord_at(y))
            for i in range(8):
                own = np.diag([section.inertia_x[i], section.inertia_y[i], section.inertia_z[i]])
                centre_B = r_B + y[i] * along_B + aft[i] * aft_B
                weight = 0.5 * (b - a) * weights[i]
                expected = expected + weight * spatial_inertia(
                    float(section.mass[i]), centre_B, R_BW @ own @ R_BW.T
                )
        down_B = R_BW[:, 2]
        pod_B = r_B + 0.7 * 3.0 / np.cos(0.35) * along_B - 0.1 * aft_B + 0.15 * down_B
        expected = expected + spatial_inertia(6.0, pod_B, np.zeros((3, 3)))
    scale = np.abs(expected).max()
    rng = np.random.default_rng(0)
    for links in (1, 3):
        model = small_model(aircraft, example_flight(), links)
        for batch in (physical_guess(model), random_batch(rng, model, 1)):
            np.testing.assert_allclose(of_links(model, batch), expected, rtol=0, atol=1e-9 * scale)
    for elements in (3, 10):
        np.testing.assert_allclose(of_beams(aircraft, elements), expected, rtol=0, atol=1e-9 * scale)


@pytest.mark.parametrize("kind", ["rigid", "equivalent", "flexible"])
def test_swept_mirror_images_fly_mirrored(kind: str) -> None:
    """A morph of the other side gives the mirrored flight, 1e-9 rad."""
    assert_mirrored(swept(), example_flight(), kind)
