"""Influence, circulation and forces of the lattice, law by law."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from morphcore.aero.vlm import influence
from morphcore.errors import InvalidInput, UnsupportedRegime
from morphdata.lattice import VortexCore
from tests.aero.planforms import Lattice, lattice, straight_wings
from tests.oracles.lattice import (
    edge_circulation,
    edge_forces,
    edge_midpoints,
    panel_normals,
    solve_circulation,
)

STREAM_B = np.array([-0.98, -0.05, -0.17])
RNG_SEED = 5


@pytest.fixture
def wing() -> Lattice:
    """Two small wings of 2 x 3 panels, crooked at random by millimetres in all directions."""
    rng = np.random.default_rng(RNG_SEED)
    plain = lattice(straight_wings(1.0, 0.4, 0.2, gap=0.3), (2, 3))
    return Lattice(
        plain.corners_B + 0.01 * rng.standard_normal(plain.corners_B.shape), plain.controls_B, plain.table
    )


def textbook_segment(point, start, end):
    """Katz & Plotkin (2001), equation 10.115, without core."""
    r1, r2, r0 = point - start, point - end, end - start
    cross = np.cross(r1, r2)
    return cross / (cross @ cross) * (r0 @ (r1 / np.linalg.norm(r1) - r2 / np.linalg.norm(r2))) / (4 * np.pi)


def product_segment(point, start, end, cut_off):
    """Product form with a cut-off (m) in its denominator (van Garrel 2003)."""
    r1, r2 = point - start, point - end
    d1, d2, length = np.linalg.norm(r1), np.linalg.norm(r2), np.linalg.norm(end - start)
    below = d1 * d2 * (d1 * d2 + r1 @ r2) + (cut_off * length) ** 2
    return (d1 + d2) / below * np.cross(r1, r2) / (4 * np.pi)


@pytest.mark.parametrize(
    ("core", "segment"),
    [
        (VortexCore(fraction=1e-3), textbook_segment),
        # of the mean chord, 0.3 m
        (VortexCore(law="smoothed"), lambda *line: product_segment(*line, 0.05 * 0.3)),
        (VortexCore(law="smoothed", fraction=0.3), lambda *line: product_segment(*line, 0.3 * 0.3)),
    ],
)
def test_rings_by_the_textbook(wing, core, segment):
    """Shared edges give what four separate segments a ring, with a long closed wake, give.

    The far end of the wake, cut at 1e7 m, is worth less than 1e-9 1/m; the core of the line (1e-3 of a panel)
    less than 1e-9. The trailing edge that the lattice leaves out cancels with any core. The wake's cores are
    kept from growing.
    """
    points = np.array([[0.3, 0.5, -0.4], [-0.5, -0.9, 0.3], [0.02, 0.4, 0.31]])
    table = replace(wing.table, leg_width_m=0.0 * wing.table.leg_width_m)
    velocity_B = influence(points, wing.corners_B, table, STREAM_B, core)
    wake = 1e7 * STREAM_B / np.linalg.norm(STREAM_B)
    for ring in range(table.rings):
        root_front, tip_front, root_aft, tip_aft = wing.corners_B[table.ring_corner[ring]]
        loops = [(root_front, tip_front, tip_aft, root_aft)]
        if table.panel_row[ring] == 1:  # the last of two rows feeds the wake
            loops.append((root_aft, tip_aft, tip_aft + wake, root_aft + wake))
        for p, point in enumerate(points):
            expected = sum(
                table.panel_side[ring] * segment(point, loop[k], loop[(k + 1) % 4])
                for loop in loops
                for k in range(4)
            )
            np.testing.assert_allclose(velocity_B[:, ring, p], expected, rtol=1e-7, atol=3e-9)


def test_induced_velocity_has_no_sources(wing):
    """Off the vortices the induced velocity is free of divergence and rotation, to second order."""
    step = 1e-4
    centre = np.array([0.05, 0.4, -0.15])
    points = np.concatenate([[centre + sign * step * np.eye(3)[a] for sign in (1, -1)] for a in range(3)])
    velocity_B = influence(points, wing.corners_B, wing.table, STREAM_B, core=VortexCore(fraction=1e-3)).sum(
        axis=1
    )
    gradient = np.stack([velocity_B[:, 2 * a] - velocity_B[:, 2 * a + 1] for a in range(3)], axis=1) / (
        2 * step
    )
    scale = np.abs(gradient).max()
    assert abs(np.trace(gradient)) < 1e-5 * scale
    np.testing.assert_allclose(gradient, gradient.T, atol=1e-5 * scale)


def test_no_air_passes_the_control_points(wing):
    """With the solved circulations no control point is passed, whatever the motion."""
    rng = np.random.default_rng(RNG_SEED)
    flow_B = 100 * STREAM_B + rng.standard_normal(wing.controls_B.shape)
    normals_B = panel_normals(wing.corners_B, wing.table)
    velocity_B = influence(wing.controls_B, wing.corners_B, wing.table, STREAM_B)
    circulation = solve_circulation(velocity_B, normals_B, flow_B)
    total_B = flow_B + np.einsum("arp,r->pa", velocity_B, circulation)
    assert np.abs(np.sum(normals_B * total_B, axis=1)).max() < 1e-11 * 100


def test_normals_point_up_on_both_wings():
    """The lifting side of a flat wing is up, right and left."""
    plain = lattice(straight_wings(1.0, 0.4, 0.2, gap=0.3), (2, 3))
    normals_B = panel_normals(plain.corners_B, plain.table)
    np.testing.assert_allclose(normals_B, np.tile((0.0, 0.0, -1.0), (plain.table.rings, 1)), atol=1e-15)


def test_closed_ring_in_uniform_flow_feels_no_force(wing):
    """A ring ahead of the last row is closed: rho V x gamma summed round it is zero; one with a wake is not.

    The sum for a last-row ring is rho gamma V x (its open edges), end to end from one wake leg to the other.
    """
    table, velocity_B = wing.table, np.zeros((3, wing.table.rings, wing.table.edges))
    flow_B = np.tile([-50.0, 3.0, -4.0], (table.edges, 1))
    for ring in range(table.rings):
        circulation = np.zeros(table.rings)
        circulation[ring] = 2.0
        force_B = edge_forces(wing.corners_B, table, circulation, flow_B, velocity_B, 1.2).force_B.sum(axis=0)
        _, _, root_aft, tip_aft = wing.corners_B[table.ring_corner[ring]]
        span_B = np.zeros(3) if table.panel_row[ring] == 0 else table.panel_side[ring] * (tip_aft - root_aft)
        np.testing.assert_allclose(force_B, 1.2 * 2.0 * np.cross(flow_B[0], span_B), atol=1e-12 * 100)


def test_panels_share_all_of_the_edges_load(wing):
    """Panel forces and moments add up to the edges', and every edge of a panel is its own or half its own."""
    rng = np.random.default_rng(RNG_SEED)
    table = wing.table
    points_B = edge_midpoints(wing.corners_B, table)
    velocity_B = influence(points_B, wing.corners_B, table, STREAM_B)
    flow_B = 50 * STREAM_B + rng.standard_normal(points_B.shape)
    loads = edge_forces(wing.corners_B, table, rng.standard_normal(table.rings), flow_B, velocity_B, 1.2)
    np.testing.assert_allclose(loads.panel_force_B.sum(axis=0), loads.force_B.sum(axis=0), atol=1e-11)
    moment_B = np.cross(loads.points_B, loads.force_B).sum(axis=0)
    np.testing.assert_allclose(loads.panel_moment_B.sum(axis=0), moment_B, atol=1e-11)
    sides = table.panel_surface[table.edge_panel]
    assert (sides[:, 0] == sides[:, 1]).all()


def test_circulation_is_solenoidal(wing):
    """At every corner the net circulation of the edges and legs that end there is zero (Helmholtz).

    The trailing edge's own edges carry none, so they do not count.
    """
    table = wing.table
    circulation = np.random.default_rng(RNG_SEED).standard_normal(table.rings)
    edge = edge_circulation(circulation, table)
    padded = np.append(circulation, 0.0)
    leg = padded[table.leg_plus] - padded[table.leg_minus]
    balance = np.zeros(table.corners)
    np.add.at(balance, table.edge_start, -edge)
    np.add.at(balance, table.edge_end, edge)
    np.add.at(balance, table.leg_start, -leg)
    assert np.abs(balance).max() < 1e-14


def test_force_does_not_depend_on_where_the_aircraft_is(wing):
    """Moved and turned together with the stream, the lattice makes the same loads, turned."""
    angle = 0.7
    R = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    shift = np.array([3.0, -2.0, 1.0])
    one = influence(wing.controls_B, wing.corners_B, wing.table, STREAM_B, mach=0.5)
    points_B, corners_B = wing.controls_B @ R.T + shift, wing.corners_B @ R.T + shift
    other = influence(points_B, corners_B, wing.table, R @ STREAM_B, mach=0.5)
    np.testing.assert_allclose(np.einsum("ab,brp->arp", R, one), other, atol=1e-12 * np.abs(one).max())


def test_what_has_no_meaning_is_refused(wing):
    """Mach beyond 0.7, a vanishing core and corners of another lattice are errors."""
    with pytest.raises(UnsupportedRegime, match=r"Mach 0\.75"):
        influence(wing.controls_B, wing.corners_B, wing.table, STREAM_B, mach=0.75)
    with pytest.raises(InvalidInput, match="fraction"):
        influence(wing.controls_B, wing.corners_B, wing.table, STREAM_B, core=VortexCore(fraction=0.0))
    with pytest.raises(InvalidInput, match="corners"):
        influence(wing.controls_B, wing.corners_B[:-1], wing.table, STREAM_B)


@pytest.mark.parametrize("height", [0.0, 0.1, 0.5])
@pytest.mark.parametrize("chords", [2.0, 5.0])
def test_wake_is_a_sheet_to_what_is_behind_it(height, chords):
    """Behind ten strips of elliptic circulation the downwash is G / b within 8 per cent, spread 4 per cent.

    Elliptic circulation induces the same velocity everywhere in its wake (Munk), G / b far behind. Heights
    are in strips; single vortices with the core of a panel would spread it by 60 per cent in their own plane.
    """
    span, strips = 2.0, 10
    plain = lattice(straight_wings(span / 2, 0.4, 0.4), (1, strips))
    circulation = np.sqrt(1.0 - (plain.controls_B[:, 1] / (span / 2)) ** 2)
    y = np.linspace(0.1, 0.7, 61) * span / 2
    behind = np.full(y.size, plain.corners_B[:, 0].min() - 0.4 * chords)
    points = np.stack([behind, y, np.full(y.size, -height * span / 2 / strips)], axis=1)
    velocity_B = influence(points, plain.corners_B, plain.table, (-1.0, 0.0, 0.0))
    downwash = span * np.einsum("rp,r->p", velocity_B[2], circulation)
    assert downwash.mean() == pytest.approx(1.0, abs=0.081)
    assert downwash.std() < 0.04
