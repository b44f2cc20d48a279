"""Vortex lattices of single surfaces and their place on the aircraft."""

import numpy as np
import pytest

from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Aircraft
from morphcore.geometry.lattice import surface_lattice, surface_pose
from morphdata.aircraft import load_aircraft
from morphdata.lattice import Lattice, VortexCore
from tests.aero.planforms import EXAMPLES, straight_wings


def test_panels_tile_the_planform():
    """Panel areas add up to the planform and equal the areas of the quadrilaterals between the corners."""
    right, left = straight_wings(2.0, 0.5, 0.2).surfaces
    for surface in (right, left):
        lattice = surface_lattice(surface, 3, 7)
        assert lattice.area_m2 == pytest.approx(surface.area_m2, rel=1e-14)
        diagonal = lattice.panel_corners_W[1:, 1:] - lattice.panel_corners_W[:-1, :-1]
        other = lattice.panel_corners_W[1:, :-1] - lattice.panel_corners_W[:-1, 1:]
        area = 0.5 * np.abs(np.cross(diagonal, other)[..., 2])
        np.testing.assert_allclose(area, lattice.panel_area_m2, rtol=1e-13)


def test_rings_start_at_a_quarter_and_end_at_the_trailing_edge():
    """Ring fronts lie at a quarter panel chord, control points at three quarters, the aft edge at 1."""
    lattice = surface_lattice(straight_wings(3.0, 0.3, 0.3).surfaces[0], 4, 10)
    fronts, controls = np.array([0.25, 1.25, 2.25, 3.25, 4.0]), np.array([0.75, 1.75, 2.75, 3.75])
    np.testing.assert_allclose(lattice.ring_corners_W[:, 0, 0], 0.15 - 0.075 * fronts, atol=1e-15)
    np.testing.assert_allclose(lattice.control_points_W[:, 0, 0], 0.15 - 0.075 * controls, atol=1e-15)
    np.testing.assert_allclose(lattice.control_points_W[0, :, 1], 0.15 + 0.3 * np.arange(10), rtol=1e-14)
    np.testing.assert_array_equal(lattice.ring_corners_W[-1], lattice.panel_corners_W[-1])


def test_left_is_the_mirror_of_right():
    """The left lattice is the right one mirrored in the x-z plane, its pose at the same hinge angle too."""
    right, left = Aircraft.of(load_aircraft(EXAMPLES / "aircraft.json")).surfaces
    mirror = np.array([1.0, -1.0, 1.0])
    points = []
    for surface in (right, left):
        R_BW, r_B = surface_pose(surface, [0.7])
        points.append(surface_lattice(surface).ring_corners_W @ R_BW.T + r_B)
    np.testing.assert_array_equal(points[0] * mirror, points[1])


def test_positive_sweep_moves_the_tip_aft():
    """A swept tip lies sin(sweep) spans behind its root; the root stays on the hinge."""
    right, _ = Aircraft.of(load_aircraft(EXAMPLES / "aircraft.json")).surfaces
    R_BW, r_B = surface_pose(right, [0.5])
    np.testing.assert_array_equal(r_B, right.position_m)
    np.testing.assert_allclose(R_BW @ [0, 3, 0], (-3 * np.sin(0.5), 3 * np.cos(0.5), 0), rtol=1e-15)


def test_settings_survive_their_document():
    """Settings read back from their document are the same, a default fraction as the number that it is."""
    chosen = Lattice(chordwise=2, spanwise=6, core=VortexCore(law="smoothed", fraction=0.07))
    assert Lattice.parse(chosen.to_document()) == chosen
    assert Lattice.parse({}) == Lattice()
    smoothed = Lattice.parse({"core": {"law": "smoothed"}})
    assert smoothed.core.radius_fraction == 0.05
    assert Lattice.parse(smoothed.to_document()).core == VortexCore(law="smoothed", fraction=0.05)
    assert Lattice.parse({"core": {"fraction": None}}).core.radius_fraction == 0.1


@pytest.mark.parametrize(
    ("document", "pointer"),
    [
        ({"chordwise": 9}, "/x/chordwise"),
        ({"spanwise": 3}, "/x/spanwise"),
        ({"core": {"law": "thick"}}, "/x/core/law"),
        ({"core": {"fraction": 0.0}}, "/x/core/fraction"),
        ({"core": {"fraction": 0.51}}, "/x/core/fraction"),
        ({"core": {"fracton": 0.1}}, "/x/core/fracton"),
        ({"panels": 4}, "/x/panels"),
    ],
)
def test_bad_settings_name_the_field(document, pointer):
    """What is wrong in a lattice's document is said with a pointer to it and a hint."""
    with pytest.raises(InvalidInput) as caught:
        Lattice.parse(document, "/x")
    assert caught.value.pointer == pointer
    assert caught.value.hint


def test_a_core_without_a_law_or_a_size_is_refused():
    """Laws that there are not, and radii that are not above zero, are errors."""
    with pytest.raises(InvalidInput, match="law"):
        VortexCore(law="thick")
    for fraction in (0.0, -0.1, float("nan")):
        with pytest.raises(InvalidInput, match="fraction"):
            VortexCore(fraction=fraction)
