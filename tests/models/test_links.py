"""Links cut from a wing: they are the wing, whatever the division."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from morphcore.geometry.lattice import surface_lattice
from morphcore.models.links import drag_areas, joint_stiffness, link_edges, link_masses, strip_overlap
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


@pytest.mark.parametrize("links", [2, 3, 5])
def test_uniform_joints_are_ei_over_l(links):
    """Beam theory's guess on a uniform wing: EI / l and GJ / l, l between the links' centres."""
    surface = example_aircraft().surfaces[0]
    shares = np.random.default_rng(links).uniform(0.5, 1.5, links)
    edges = cut(surface, shares)
    between = np.diff(0.5 * (edges[0, 1:] + edges[0, :-1]))
    stiffness = joint_stiffness(surface, edges)[0]
    flap = 2.1e9 * 0.3 * 0.1**3 / 12
    lag = 2.1e9 * 0.1 * 0.3**3 / 12
    gj = 2.1e9 / 2.6 * 0.2633 * 0.3 * 0.1**3  # Saint-Venant's rectangle of 3 : 1
    np.testing.assert_allclose(stiffness, np.outer(1.0 / between, [flap, gj, lag]), rtol=2e-4)


def test_tapered_joints_add_compliances():
    """On a tapered wing a joint gives way as much as the beam between the centres: the integral of 1 / EI."""
    surface = odd_aircraft(np.random.default_rng(5)).surfaces[0]
    edges = cut(surface, [1.0, 2.0])
    centres = 0.5 * (edges[0, 1:] + edges[0, :-1])
    stations = np.linspace(*centres, 20_001)
    section = surface.section_at(stations)
    for axis, value in enumerate((section.ei_flap, section.gj, section.ei_edge)):
        compliance = np.trapezoid(1.0 / value, stations)
        # four Gauss points: 1e-5 on this taper
        assert joint_stiffness(surface, edges)[0, 0, axis] == pytest.approx(1.0 / compliance, rel=1e-4)
