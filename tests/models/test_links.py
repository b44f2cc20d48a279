"""Links cut from a wing: they are the wing, whatever the division."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from morphcore.geometry.lattice import surface_lattice
from morphcore.models.links import (
    beam_division,
    drag_areas,
    joint_stiffness,
    link_edges,
    link_masses,
    strip_overlap,
)
from tests.models.chains import example_aircraft, odd_aircraft
from tests.oracles.chain_tree import slice_inertia

LAWS = settings(max_examples=30, deadline=None)
DIVISIONS = st.integers(1, 8).flatmap(lambda n: st.lists(st.floats(0.05, 1.0), min_size=n, max_size=n))


def wings():
    """A uniform wing, and tapered ones of both sides with axes off mid-chord."""
    return [example_aircraft().surfaces[0], *odd_aircraft(np.random.default_rng(5)).surfaces]


def cut(surface, shares):
    """Edges (1, n + 1) for shares of any sum."""
    return link_edges(np.array([shares]) / np.sum(shares), surface.span_m)


def spatial(row):
    """Spatial inertia (6, 6) of one of the lanes' rows of mass properties."""
    m, mx, my, xx, yy, zz, xy = row
    moment = np.array([[0.0, 0.0, my], [0.0, 0.0, -mx], [-my, mx, 0.0]])
    rotational = np.array([[xx, xy, 0.0], [xy, yy, 0.0], [0.0, 0.0, zz]])
    return np.block([[rotational, moment], [moment.T, m * np.eye(3)]])


def moved(inertia, y):
    """Spatial inertia seen from a point ``y`` metres further in: X^T I X, Featherstone (2008), eq. 2.66."""
    X = np.eye(6)
    X[3:, :3] = -np.array([[0.0, 0.0, y], [0.0, 0.0, 0.0], [-y, 0.0, 0.0]])
    return X.T @ inertia @ X


@LAWS
@given(shares=DIVISIONS, wing=st.integers(0, 5))
def test_links_weigh_what_the_wing_weighs(shares, wing):
    """Mass, moments and inertia of all links about the root are the whole wing's, tapered or not."""
    surface = wings()[wing]
    edges = cut(surface, shares)
    rows = link_masses(surface, edges)[0]
    total = sum(
        moved(spatial(row), surface.span_sign * start) for row, start in zip(rows, edges[0], strict=False)
    )
    whole = slice_inertia(surface, 0.0, surface.span_m, np.zeros(3))
    np.testing.assert_allclose(total, whole, rtol=1e-10, atol=1e-12 * np.abs(whole).max())


def test_uniform_wing_in_closed_form():
    """A box of 0.3 x 3 x 0.1 m and 500 kg/m^3: 45 kg, the inertia of a plate about its root."""
    surface = example_aircraft().surfaces[0]
    m, mx, my, xx, yy, zz, xy = link_masses(surface, cut(surface, [1.0]))[0, 0]
    assert m == pytest.approx(45.0)
    assert (mx, xy) == (0.0, 0.0)
    assert my == pytest.approx(67.5)
    assert xx == pytest.approx(45.0 * (3.0**2 / 3 + 0.1**2 / 12))
    assert yy == pytest.approx(45.0 * (0.3**2 + 0.1**2) / 12)
    assert zz == pytest.approx(45.0 * (3.0**2 / 3 + 0.3**2 / 12))


def test_linear_taper_in_closed_form():
    """Mass per length follows the chord: mass (a + b) / 2, first moment (a + 2 b) / 6 of the wing."""
    surface = odd_aircraft(np.random.default_rng(5)).surfaces[0]
    a, b, span = surface.root_chord_m, surface.tip_chord_m, surface.span_m
    density = surface.material.density_kg_m3 * surface.thickness_m
    m, mx, my, *_ = link_masses(surface, cut(surface, [1.0]))[0, 0]
    assert m == pytest.approx(density * span * (a + b) / 2)
    assert my == pytest.approx(density * span**2 * (a + 2 * b) / 6)
    aft = surface.mass_axis_offset_m - surface.elastic_axis_offset_m
    assert mx == pytest.approx(-m * aft)


@LAWS
@given(shares=DIVISIONS, wing=st.integers(0, 5), strips=st.integers(1, 12))
def test_strip_shares_are_a_partition(shares, wing, strips):
    """Every strip is given away whole, and its shares' middles weighted with them make its own middle."""
    surface = wings()[wing]
    lattice = surface_lattice(surface, 2, strips)
    edges = cut(surface, shares)
    weight, middle = strip_overlap(surface, lattice, edges)
    np.testing.assert_allclose(weight.sum(axis=-1), 1.0, atol=1e-12)
    assert (weight >= 0.0).all()
    centres = np.sum(weight * (middle + surface.span_sign * edges[:, None, :-1]), axis=-1)[0]
    expected = 0.5 * surface.span_sign * (lattice.strip_edges_m[1:] + lattice.strip_edges_m[:-1])
    np.testing.assert_allclose(centres, expected, atol=1e-12)
    # and every link gets its own width
    width = np.diff(lattice.strip_edges_m)
    np.testing.assert_allclose(width @ weight[0], np.diff(edges[0]), atol=1e-12)


@LAWS
@given(shares=DIVISIONS, wing=st.integers(0, 5))
def test_drag_areas_are_the_planform(shares, wing):
    """Areas add up to the wing's, first moments to the trapezium's."""
    surface = wings()[wing]
    edges = cut(surface, shares)
    area, centroid = drag_areas(surface, edges)
    assert area.sum() == pytest.approx(surface.area_m2, rel=1e-12)
    a, b, span = surface.root_chord_m, surface.tip_chord_m, surface.span_m
    moment = np.sum(area * (centroid + surface.span_sign * edges[:, :-1]))
    assert moment == pytest.approx(surface.span_sign * span**2 * (a + 2 * b) / 6, rel=1e-12)


# What a chain owes the beam: statics of a cantilever, by virtual work. The chain's side sums over its joints,
# the beam's integrates over 20,001 stations.

LINKS = pytest.mark.parametrize("links", [2, 3, 4, 5, 6, 8])
FLAP, TORSION, EDGE = range(3)


def chain_statics(surface, division):
    """Slopes and deflections of a chain's tip, by load: joints turn by moment over stiffness."""
    edges = link_edges(np.asarray(division)[None], surface.span_m)
    lever = surface.span_m - edges[0, 1:-1]
    compliance = 1.0 / joint_stiffness(surface, edges)[0]
    return statics(lever, compliance.T, lambda values: values.sum(axis=-1))


def beam_statics(surface):
    """The same of the beam."""
    stations = np.linspace(0.0, surface.span_m, 20_001)
    section = surface.section_at(stations)
    flexibility = 1.0 / np.stack([section.ei_flap, section.gj, section.ei_edge])
    return statics(
        surface.span_m - stations, flexibility, lambda values: np.trapezoid(values, stations, axis=-1)
    )


def statics(lever, compliance, total):
    """Of each axis (3,): a unit force at the tip, a unit load or torque per length."""
    return {
        "force, slope": total(lever * compliance),
        "force, deflection": total(lever**2 * compliance),
        "load, slope": total(lever**2 / 2 * compliance),
        "load, deflection": total(lever**3 / 2 * compliance),
        "torque, twist": total(lever * compliance),
        "torque, mean twist": total(lever**2 * compliance),
    }


@LINKS
def test_a_uniform_chain_stands_for_the_whole_beam(links):
    """Tip of the chain against Euler and Bernoulli's cantilever, in closed form: P L^2 / 2 EI and so on.

    Exact but for the deflection under a distributed load: joints miss how the curvature spreads over their
    segments. That is 11 per cent with two links, below 4 with three, and falls as one over (n - 1)^2.
    """
    surface = example_aircraft().surfaces[0]
    L, found = surface.span_m, chain_statics(surface, beam_division(surface, links))
    EI, GJ = 2.1e9 * 0.3 * 0.1**3 / 12, 2.1e9 / 2.6 * 0.2633 * 0.3 * 0.1**3  # Saint-Venant, 3 : 1
    assert found["force, slope"][FLAP] == pytest.approx(L**2 / (2 * EI), rel=1e-12)
    assert found["force, deflection"][FLAP] == pytest.approx(L**3 / (3 * EI), rel=1e-12)
    assert found["load, slope"][FLAP] == pytest.approx(L**3 / (6 * EI), rel=1e-12)
    assert found["torque, twist"][TORSION] == pytest.approx(L**2 / (2 * GJ), rel=2e-4)
    assert found["torque, mean twist"][TORSION] == pytest.approx(L**3 / (3 * GJ), rel=2e-4)
    missing = 1.0 - found["load, deflection"][FLAP] / (L**4 / (8 * EI))
    assert 0.0 < missing <= 0.17 / (links - 1) ** 2
    assert missing <= (1 / 9 + 1e-12 if links == 2 else 0.04)


@LINKS
@pytest.mark.parametrize("wing", range(1, 6))
def test_a_tapered_chain_stands_for_the_whole_beam(links, wing):
    """The same laws of wings with half the chord at the tip, against quadrature.

    Joints lie where flap requires them: its laws are exact as on a uniform wing. Torsion and edgewise
    stiffness fall by other powers of the chord; their slope (twist) is exact all the same, and the rest
    within 1.3 and 18 per cent over the square of n - 1.
    """
    surface = wings()[wing]
    found, expected = chain_statics(surface, beam_division(surface, links)), beam_statics(surface)
    short = {name: 1.0 - value / expected[name] for name, value in found.items()}
    square = (links - 1) ** 2
    np.testing.assert_allclose(short["force, slope"], 0.0, atol=1e-6)
    for exact in ("force, deflection", "load, slope"):
        assert abs(short[exact][FLAP]) < 1e-6
        assert abs(short[exact][EDGE]) * square < 0.18
    assert 0.0 < short["load, deflection"][FLAP] * square < 0.18
    np.testing.assert_allclose(short["torque, twist"], 0.0, atol=1e-6)
    assert abs(short["torque, mean twist"][TORSION]) * square < 0.013


@LAWS
@given(shares=DIVISIONS, wing=st.integers(0, 5))
def test_no_division_loses_compliance(shares, wing):
    """Wherever a search puts the joints, slope and twist of the tip are the beam's: no part is left out."""
    surface, division = wings()[wing], np.array(shares) / np.sum(shares)
    found, expected = chain_statics(surface, division), beam_statics(surface)
    assert joint_stiffness(surface, cut(surface, shares)).shape == (1, len(shares) - 1, 3)
    if len(shares) > 1:
        np.testing.assert_allclose(found["force, slope"], expected["force, slope"], rtol=1e-5)


@LINKS
def test_joints_lie_in_equal_segments(links):
    """Division of a uniform wing: each joint at the centroid of the trapezium of moment over its segment."""
    division = beam_division(example_aircraft().surfaces[0], links)
    ends = 1.0 - np.linspace(0.0, 1.0, links)
    inner, outer = ends[:-1], ends[1:]
    joints = 1.0 - 2 / 3 * (inner**2 + inner * outer + outer**2) / (inner + outer)
    np.testing.assert_allclose(np.cumsum(division)[:-1], joints, rtol=1e-12)
    assert division.sum() == pytest.approx(1.0, rel=1e-15)


def test_one_link_has_no_joint():
    """A rigid wing is one share, without stiffness."""
    surface = example_aircraft().surfaces[0]
    np.testing.assert_array_equal(beam_division(surface, 1), [1.0])
    assert joint_stiffness(surface, cut(surface, [1.0])).shape == (1, 0, 3)
