"""Sweep, dihedral and incidence of a surface: limits, axes, overlap, angle of attack, torque of hinges."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from morphcore.errors import InvalidInput
from morphcore.geometry.mirror import mirror_groups
from morphcore.geometry.obstacle import obstacle, too_little_air
from morphcore.geometry.overlap import overlapping_surfaces
from morphcore.validity import air_motion
from tests.aero.shaped import FINNED, SHAPES, aircraft, pair, surface
from tests.models.chains import SMALL_LATTICE, airless, example_flight
from tests.simulate.flights import fly

SHAPE = {"sweep_rad": 0.5, "dihedral_rad": 0.3, "incidence_rad": 0.1}


def wing(side: str = "right", **more: Any) -> dict[str, Any]:
    """One wing."""
    return surface("wing", side, 2.0, (0.5, 0.3), **more)


@pytest.mark.parametrize(
    ("field", "limit"), [("sweep_rad", 1.2), ("dihedral_rad", 1.5708), ("incidence_rad", 0.5)]
)
def test_limits(field: str, limit: float) -> None:
    """Both limits are accepted; beyond is refused, with the pointer of the field."""
    for sign in (1.0, -1.0):
        assert getattr(aircraft(wing(**{field: sign * limit})).surfaces[0], field) == sign * limit
        with pytest.raises(InvalidInput) as refused:
            aircraft(wing(**{field: sign * (limit + 0.001)}))
        assert refused.value.faults[0].pointer == f"/aircraft/surfaces/0/{field}"


@pytest.mark.parametrize("side", ["right", "left"])
def test_positive_is_aft_up_and_nose_up(side: str) -> None:
    """One angle at a time moves the tip aft, the tip up and the leading edge up, on both sides."""
    sign = 1.0 if side == "right" else -1.0
    turned = {
        name: aircraft(wing(side, **{name: angle})).surfaces[0].rest_R_BW for name, angle in SHAPE.items()
    }
    tip = np.array([0.0, sign, 0.0])
    np.testing.assert_allclose(turned["sweep_rad"] @ tip, [-np.sin(0.5), sign * np.cos(0.5), 0.0], atol=1e-15)
    np.testing.assert_allclose(
        turned["dihedral_rad"] @ tip, [0.0, sign * np.cos(0.3), -np.sin(0.3)], atol=1e-15
    )
    np.testing.assert_allclose(turned["incidence_rad"][:, 0], [np.cos(0.1), 0.0, -np.sin(0.1)], atol=1e-15)


def test_the_root_chord_has_the_incidence_in_the_plane_of_the_dihedral() -> None:
    """All three at once: normal and span of the dihedral, turned about the span by the incidence."""
    right = aircraft(wing(**SHAPE)).surfaces[0]
    chord_B = right.rest_R_BW @ right.chord_W
    across = np.array([0.0, np.cos(0.3), -np.sin(0.3)])
    assert chord_B @ across == pytest.approx(0.0, abs=1e-15)
    assert chord_B[0] == pytest.approx(np.cos(0.1), rel=1e-15)
    axis = right.rest_R_BW[:, 1]
    assert axis @ across == pytest.approx(np.cos(0.5), rel=1e-15)
    assert axis @ chord_B == pytest.approx(-np.sin(0.5), rel=1e-15)


def test_pairs_have_equal_shapes() -> None:
    """Surfaces are mirror images if all three angles agree; a fin on the centre line has no partner."""
    right, left = pair("wing", 2.0, (0.5, 0.3), **SHAPE)
    assert mirror_groups(aircraft(right, left).surfaces) == ((0, 1),)
    for name in SHAPE:
        assert mirror_groups(aircraft(right, left | {name: 0.0}).surfaces) == ((0,), (1,))
    assert mirror_groups(FINNED.surfaces) == ((0, 1), (2,))


@pytest.mark.parametrize("name", SHAPES)
def test_halves_meet_without_overlap(name: str) -> None:
    """Roots on the centre line touch; a fin that cuts through the wing overlaps."""
    shape = SHAPES[name]
    assert overlapping_surfaces(shape, np.zeros((1, 0))) == []
    fin = aircraft(surface("fin", "right", 1.0, (0.3, 0.3), dihedral_rad=1.5708, position_m=[-0.2, 0.5, 0.5]))
    through = replace(shape, surfaces=shape.surfaces[:2] + fin.surfaces)
    assert (0, 2, 0) in overlapping_surfaces(through, np.zeros((1, 0)))


def test_a_swept_tip_overlaps_where_it_is() -> None:
    """A tail behind an unswept wing's tip is free; the swept wing's tip lies on it."""
    tail = surface("tail", "right", 0.6, (0.4, 0.4), position_m=[-1.1, 1.6, 0.0])
    for sweep_rad, found in ((0.0, []), (0.5, [(0, 1, 0)])):
        assert overlapping_surfaces(aircraft(wing(sweep_rad=sweep_rad), tail), np.zeros((1, 0))) == found


def test_incidence_counts_in_the_angle_of_attack() -> None:
    """A surface's own incidence adds to the body's; a fin's does not."""
    at_rest = np.zeros((1, 3))
    for dihedral_rad, expected in ((0.0, 0.25), (0.5 * np.pi, 0.05)):
        found = air_motion(
            aircraft(wing(incidence_rad=0.2, dihedral_rad=dihedral_rad)),
            np.zeros(1),
            at_rest,
            np.array([[np.cos(0.05), 0.0, np.sin(0.05)]]),
            at_rest,
            np.zeros((1, 0)),
        )
        assert found.incidence[0] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("axis", ["x", "z"])
def test_hinges_hold_the_weight_of_a_shaped_wing(axis: str) -> None:
    """The torque of a hinge at rest is that of the wing's weight about its axis, summed over strips.

    In a vacuum, the thrust of the start holds the aircraft; nose up, so that the weight acts along x as well.
    """
    wings = pair("wing", 2.0, (0.5, 0.3), **SHAPE, elastic_axis_offset_m=0.05, mass_axis_offset_m=-0.02)
    for each in wings:
        y = 0.3 if each["side"] == "right" else -0.3
        each["position_m"], each["hinge"] = [0.1, y, 0.0], {"position_m": [0.2, y, 0.1], "axis": axis}
    shape = aircraft(*wings)
    # weight of the wings by strips, in B: mass at its fraction of each chord
    distance, torque, mass, alpha = (np.arange(2000) + 0.5) / 2000, {}, 0.0, 0.3
    gravity_B = 9.81 * np.array([-np.sin(alpha), 0.0, np.cos(alpha)])
    pull = np.zeros(3)
    for each in shape.surfaces:
        chord = 0.5 - 0.2 * distance
        lumps = 500.0 * 0.05 * chord * 2.0 / 2000
        along_W = np.outer(distance * each.span_sign * 2.0 / np.cos(0.5), [0.0, 1.0, 0.0])
        centre = each.position_m + (along_W + 0.02 * each.chord_W) @ each.rest_R_BW.T
        hinge = each.hinges[0]
        about = np.cross(centre - hinge.position_m, lumps[:, None] * gravity_B).sum(axis=0)
        torque[hinge.drive] = -float(about @ hinge.axis_B)
        pull += np.cross(centre, lumps[:, None] * gravity_B).sum(axis=0)
        mass += lumps.sum()
    flight = airless(example_flight(), gravity=9.81)
    assert flight.start is not None
    start = replace(flight.start, alpha_rad=alpha, force_B=-(60.0 + mass) * gravity_B, moment_B=-pull)
    found = fly(
        shape, replace(flight, start=start), {}, model="rigid", duration_s=0.02, step_s=0.005,
        output_step_s=0.01, start="given", channels=["hinge_torque"], lattice=SMALL_LATTICE,
    ).trajectory  # fmt: skip
    for drive, expected in torque.items():
        assert abs(expected) > 1.0
        np.testing.assert_allclose(found.extra[f"hinge_torque_{drive}"], expected, rtol=1e-5)


def test_fins_carry_no_weight_and_wings_swept_aft_do_not_diverge() -> None:
    """The same area flies as a wing and falls as a fin; sweep aft takes away the fear of divergence."""
    flight = replace(example_flight(), airspeed_m_s=40.0)
    flat, upright = (aircraft(wing(dihedral_rad=angle)) for angle in (0.0, 0.5 * np.pi))
    assert too_little_air(flat, flight) is None
    found = too_little_air(upright, flight)
    assert found is not None
    assert found.pointer == "/flight/airspeed_m_s"
    soft = wing(flexible=True, elastic_axis_offset_m=0.1)
    soft["section"] = {
        "ei_flap_n_m2": 1e5, "ei_edge_n_m2": 1e6, "gj_n_m2": 20.0, "mass_per_length_kg_m": 1.0,
        "inertia_per_length_kg_m": [0.01, 0.01, 0.02],
    }  # fmt: skip
    straight, swept = (obstacle(aircraft(soft | {"sweep_rad": angle}), flight) for angle in (0.0, 0.5))
    assert straight is not None
    assert "divergence" in straight.hint
    assert swept is None
