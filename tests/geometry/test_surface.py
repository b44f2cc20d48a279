"""Lifting surfaces: which way hinges turn, and planform geometry."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from scipy.integrate import quad

from morphcore.geometry.lattice import surface_pose
from morphcore.geometry.surface import Surface
from morphdata.aircraft import Material
from morphdata.aircraft import Surface as SurfaceDocument
from morphdata.drives import Hinge

WOOD = Material(density_kg_m3=500.0, youngs_modulus_pa=2.1e9, poisson_ratio=0.3, stiffness_damping_s=0.004)
SIDES: tuple[Literal["right", "left"], ...] = ("right", "left")


def surface(side: Literal["right", "left"], axis: Literal["x", "y", "z"]) -> Surface:
    """A tapered surface hinged about one axis."""
    document = SurfaceDocument(
        name="wing",
        side=side,
        span_m=3.0,
        root_chord_m=0.4,
        tip_chord_m=0.2,
        thickness_m=0.1,
        material=WOOD,
        hinge=Hinge(position_m=[0.0, 0.35, 0.0], axis=axis),
    )
    return Surface.of(document)


def turned(wing: Surface, direction: np.ndarray) -> np.ndarray:
    """A direction of the wing's, in B, after a positive hinge motion."""
    R_BW, _ = surface_pose(wing, [0.3])
    return np.asarray(R_BW @ direction)


@pytest.mark.parametrize("side", SIDES)
def test_positive_hinge_motion_goes_the_same_way_on_both_sides(side: Literal["right", "left"]) -> None:
    """Sweep takes the tip aft (-x), fold takes it up (-z), incidence takes the leading edge up (-z)."""
    span = np.array([0.0, surface(side, "z").span_sign, 0.0])
    leading = np.array([1.0, 0.0, 0.0])
    assert turned(surface(side, "z"), span)[0] < -0.2
    assert turned(surface(side, "x"), span)[2] < -0.2
    assert turned(surface(side, "y"), leading)[2] < -0.2


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_sides_are_mirror_images(axis: Literal["x", "y", "z"]) -> None:
    """Equal hinge motion left and right is symmetric about the plane x-z."""
    reflect = np.array([1.0, -1.0, 1.0])
    direction = np.array([0.2, 1.0, 0.1])
    right = turned(surface("right", axis), direction)
    left = turned(surface("left", axis), direction * reflect)
    np.testing.assert_allclose(left, right * reflect, atol=1e-16)


def test_a_fixed_surface_stays_where_it_is() -> None:
    """Without a hinge nothing turns."""
    wing = replace(surface("left", "z"), hinges=())
    R_BW, r_B = surface_pose(wing)
    np.testing.assert_array_equal(R_BW, np.eye(3))
    np.testing.assert_array_equal(r_B, wing.position_m)


def test_area_is_the_integral_of_the_chord() -> None:
    """Area and mean chord against quadrature of the chord along the span."""
    wing = surface("right", "z")
    area, _ = quad(lambda y: float(wing.chord_at(y)), 0.0, wing.span_m)
    assert wing.area_m2 == pytest.approx(area)
    assert wing.mean_chord_m == pytest.approx(area / wing.span_m)
    np.testing.assert_allclose(wing.chord_at([0.0, 1.5, 3.0]), [0.4, 0.3, 0.2])


def test_sections_follow_the_taper() -> None:
    """Bending stiffness of a box goes with chord, lag stiffness with its cube; one station, one value."""
    wing = surface("right", "z")
    section = wing.section_at([0.0, 3.0])
    assert section.ei_flap[0] / section.ei_flap[1] == pytest.approx(2.0)
    assert section.ei_edge[0] / section.ei_edge[1] == pytest.approx(8.0)
    assert wing.section_at(1.0).mass.shape == (1,)


def test_a_chord_that_is_not_said_is_the_uniform_one() -> None:
    """Root or tip chord may be given in addition to the chord; the root is at the hinge by default."""
    document = {"name": "w", "side": "left", "span_m": 2.0, "thickness_m": 0.1, "material": WOOD}
    hinge = Hinge(position_m=[0.1, -0.35, 0.2], axis="z")
    for given, chords in (
        ({}, (0.3, 0.3)),
        ({"root_chord_m": 0.4}, (0.4, 0.3)),
        ({"tip_chord_m": 0.2}, (0.3, 0.2)),
    ):
        wing = Surface.of(SurfaceDocument.parse({**document, "chord_m": 0.3, "hinge": hinge, **given}))
        assert (wing.root_chord_m, wing.tip_chord_m) == chords
        assert wing.position_m == (0.1, -0.35, 0.2)
