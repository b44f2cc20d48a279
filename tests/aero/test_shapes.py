"""Swept, inclined and upright surfaces against AeroSandbox's vortex lattice and against all edges of ours."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from morphcore.aero.operator import BODY_AFT
from morphcore.aero.vlm import influence, ring_table
from morphcore.geometry.aircraft import Aircraft
from morphcore.geometry.lattice import surface_lattice, surface_pose
from morphcore.models.equivalent import chain_model
from morphdata.lattice import DEFAULT_LATTICE
from tests.aero.link_loads import edge_loads, lane_loads
from tests.aero.shaped import SHAPES, aircraft, of_aerosandbox, pair, surface
from tests.aero.test_loads import dragless, settled
from tests.models.chains import example_flight
from tests.oracles.lattice import edge_forces, edge_midpoints, panel_normals, solve_circulation

Array = NDArray[np.float64]

FLIGHT = replace(example_flight(), air_density_kg_m3=1.0)
# angle of attack and of sideslip, rad
STRAIGHT, SLIPPING = (0.08, 0.0), (0.05, 0.1)
CASES = [(name, *case) for name in SHAPES for case in (STRAIGHT, SLIPPING)]


@dataclass(frozen=True)
class Loads:
    """Force and moment (3,) about the reference point in B, and the force along the stream."""

    force: Array
    moment: Array
    drag: float


def velocity(alpha_rad: float, beta_rad: float) -> Array:
    """Velocity of the aircraft in B at 1 m/s."""
    return np.array(
        [np.cos(alpha_rad) * np.cos(beta_rad), np.sin(beta_rad), np.sin(alpha_rad) * np.cos(beta_rad)]
    )


def loads_of(force: Array, moment: Array, alpha_rad: float, beta_rad: float) -> Loads:
    """The same with the drag."""
    return Loads(force, moment, -float(force @ velocity(alpha_rad, beta_rad)))


def other_program(shape: Aircraft, alpha_rad: float, beta_rad: float) -> Loads:
    """AeroSandbox's, which has no force on chordwise bound vortices (see `of_edges`)."""
    found = of_aerosandbox(shape, alpha_rad, beta_rad)
    force, moment = (np.array(found[name], dtype=np.float64).ravel() for name in ("F_b", "M_b"))
    return loads_of(force, moment, alpha_rad, beta_rad)


def of_edges(shape: Aircraft, alpha_rad: float, beta_rad: float, *, chordwise: bool = True) -> Loads:
    """Ours, edge by edge, with or without the chordwise edges.

    In sideslip these meet the air at an angle and bear lift wherever the circulation changes along the span.
    AeroSandbox, like AVL, leaves that out.
    """
    parts = [surface_lattice(each) for each in shape.surfaces]
    table = ring_table(parts)
    corners, controls = [], []
    for part, each in zip(parts, shape.surfaces, strict=True):
        R_BW, r_B = surface_pose(each)
        corners.append(part.ring_corners_W.reshape(-1, 3) @ R_BW.T + r_B)
        controls.append(part.control_points_W.reshape(-1, 3) @ R_BW.T + r_B)
    corners_B, controls_B = np.concatenate(corners), np.concatenate(controls)
    flow = -velocity(alpha_rad, beta_rad)
    gamma = solve_circulation(
        influence(controls_B, corners_B, table, BODY_AFT),
        panel_normals(corners_B, table),
        np.broadcast_to(flow, controls_B.shape),
    )
    middles = edge_midpoints(corners_B, table)
    induced = influence(middles, corners_B, table, BODY_AFT)
    edges = edge_forces(corners_B, table, gamma, np.broadcast_to(flow, middles.shape), induced, 1.0)
    # neighbouring corners are one apart along the span and spanwise + 1 along the chord
    kept = (table.edge_end - table.edge_start == 1) | chordwise
    force = edges.force_B[kept].sum(axis=0)
    moment = np.cross(edges.points_B, edges.force_B)[kept].sum(axis=0)
    return loads_of(force, moment, alpha_rad, beta_rad)


def on_fuselage(shape: Aircraft, wrenches: Array) -> tuple[Array, Array]:
    """Sum of the wrenches (s, 6) on fixed surfaces as force and moment about the reference point in B."""
    force, moment = np.zeros((2, 3))
    for each, wrench in zip(shape.surfaces, wrenches, strict=True):
        R_BW, r_B = surface_pose(each)
        own = R_BW @ wrench[3:]
        force += own
        moment += R_BW @ wrench[:3] + np.cross(r_B + R_BW @ each.elastic_axis_W, own)
    return force, moment


def of_links(shape: Aircraft, twist_B: Array) -> Array:
    """Wrenches (s, 6) on the links of the rigid model in steady motion."""
    model = chain_model(shape, FLIGHT, 1)
    batch = dragless(model)
    return lane_loads(model, batch, *settled(model, batch, np.zeros(0), twist_B)).wrench


def assert_close(found: Loads, expected: Loads, share: float) -> None:
    """Each force and moment within a share of itself; what should vanish within a hundredth of lift's."""
    tiny = 0.01 * share * abs(expected.force[2])
    np.testing.assert_allclose(found.force, expected.force, rtol=share, atol=tiny)
    np.testing.assert_allclose(found.moment, expected.moment, rtol=share, atol=tiny)
    assert found.drag == pytest.approx(expected.drag, rel=share)


@pytest.mark.parametrize(("name", "alpha", "beta"), CASES)
def test_lattice_against_aerosandbox(name: str, alpha: float, beta: float) -> None:
    """Forces, moments and induced drag of the same vortices agree within half a per cent (required: 2).

    A swept tapered wing with incidence, a wing with dihedral, wing and tail, wing and fin. The fin's root is
    in the wing's wake, whose cores grow here and not there: one per cent.
    """
    found = of_edges(SHAPES[name], alpha, beta, chordwise=False)
    assert_close(found, other_program(SHAPES[name], alpha, beta), 0.01 if name == "finned" else 0.005)


@pytest.mark.parametrize(("name", "alpha", "beta"), CASES)
def test_links_against_aerosandbox(name: str, alpha: float, beta: float) -> None:
    """The rigid model's links have these loads in steady motion, within 2 per cent: all forces and moments.

    From the moments that of the chordwise vortices is subtracted, which the links have and AeroSandbox has
    not: in sideslip a twentieth of the roll moment of the wing with dihedral, a quarter of the swept wing's.
    """
    shape = SHAPES[name]
    twist = np.concatenate([np.zeros(3), velocity(alpha, beta)])
    force, moment = on_fuselage(shape, of_links(shape, twist))
    spanwise = of_edges(shape, alpha, beta, chordwise=False).moment
    chordwise = of_edges(shape, alpha, beta).moment - spanwise
    if beta == 0.0:
        np.testing.assert_allclose(chordwise, 0.0, atol=1e-3 * abs(force[2]))
    expected = other_program(shape, alpha, beta)
    assert_close(loads_of(force, moment - chordwise, alpha, beta), expected, 0.02)


CLOSE = aircraft(
    *pair("wing", 2.0, (0.6, 0.3), sweep_rad=-0.4, dihedral_rad=0.5, elastic_axis_offset_m=0.06),
    *pair(
        "tail",
        1.2,
        (0.4, 0.4),
        sweep_rad=0.6,
        dihedral_rad=-0.6,
        incidence_rad=0.1,
        position_m=[-1.2, 0.0, 0.2],
    ),
    surface("fin", "left", 0.8, (0.5, 0.2), sweep_rad=0.7, dihedral_rad=1.4, position_m=[-0.8, 0.1, -0.3]),
)


@pytest.mark.parametrize("name", [*SHAPES, "close"])
@pytest.mark.parametrize("omega", [(0.0, 0.0, 0.0), (0.02, 0.0, 0.0), (0.0, 0.02, 0.0), (-0.01, 0.01, 0.02)])
def test_links_against_all_edges(name: str, omega: tuple[float, float, float]) -> None:
    """Every surface's six loads are those of all edges of the lattice, in sideslip, with rates.

    Within 0.03 per cent of the lift (moments: times a metre) without rates, 0.3 per cent at a roll, pitch,
    yaw rate of 0.02 V a metre; a V tail and a fin close behind a V wing, in its wake: 0.15 per cent.
    """
    shape = CLOSE if name == "close" else SHAPES[name]
    twist = np.concatenate([omega, velocity(0.08, 0.05)])
    found = of_links(shape, twist)
    expected = edge_loads(chain_model(shape, FLIGHT, 1), np.zeros(0), twist)
    lift = np.abs(expected[:, 5]).max()
    share = 3e-3 if any(omega) else 1.5e-3 if name == "close" else 3e-4
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=share * lift)


def test_cutting_a_swept_wing_changes_nothing() -> None:
    """The loads on a straight chain of links of a swept wing add up to those on one link."""
    shape = SHAPES["swept"]
    supple = replace(shape, surfaces=tuple(replace(each, flexible=True) for each in shape.surfaces))
    twist = np.concatenate([np.zeros(3), velocity(0.08, 0.1)])
    whole = of_links(shape, twist)
    model = chain_model(supple, FLIGHT, 3)
    division = np.random.default_rng(0).dirichlet(np.full(3, 5.0), size=(1, 1))
    batch = dragless(model, division=division)
    cut = lane_loads(model, batch, *settled(model, batch, np.zeros(0), twist)).wrench.reshape(2, 3, 6)
    for each, links, expected in zip(supple.surfaces, cut, whole, strict=True):
        start = each.span_sign * each.length_m * (np.cumsum(division[0, 0]) - division[0, 0])
        arms = np.stack([0.0 * start, start, 0.0 * start], axis=1)
        moment = (links[:, :3] + np.cross(arms, links[:, 3:])).sum(axis=0)
        found = np.concatenate([moment, links[:, 3:].sum(axis=0)])
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-11 * np.abs(expected).max())


def test_aerodynamic_centre_moves_along_the_chord() -> None:
    """A shift of the centre moves the force along the oblique chord of a swept link."""
    model = chain_model(SHAPES["swept"], FLIGHT, 1)
    twist = np.concatenate([np.zeros(3), velocity(0.08, 0.1)])
    plain, shifted = dragless(model), dragless(model, ac_offset_m=np.array([0.02]))
    base, moved = (
        lane_loads(model, b, *settled(model, b, np.zeros(0), twist)).wrench for b in (plain, shifted)
    )
    for each, before, after in zip(model.aircraft.surfaces, base, moved, strict=True):
        expected = np.cross(0.02 * each.chord_W, before[3:])
        np.testing.assert_allclose(after[:3] - before[:3], expected, rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(after[3:], before[3:], rtol=1e-14)


def test_lattice_of_a_swept_surface() -> None:
    """Chords lie along the root's, the area is span times mean chord, its mid line span / cos(sweep)."""
    for each in SHAPES["swept"].surfaces:
        part = surface_lattice(each, DEFAULT_LATTICE.chordwise, DEFAULT_LATTICE.spanwise)
        R_BW, r_B = surface_pose(each)
        corners_B = part.panel_corners_W @ R_BW.T + r_B
        chords = corners_B[0] - corners_B[-1]
        root = chords[0] / np.linalg.norm(chords[0])
        np.testing.assert_allclose(root, [np.cos(0.05), 0.0, -np.sin(0.05)], atol=1e-15)
        np.testing.assert_allclose(np.cross(chords, root), 0.0, atol=1e-15)
        np.testing.assert_allclose(
            np.linalg.norm(chords, axis=1), each.chord_at(part.strip_edges_m), rtol=1e-14
        )
        tip = 0.5 * (corners_B[0, -1] + corners_B[-1, -1])
        assert tip[1] == pytest.approx(each.span_sign * 3.0, rel=1e-14)
        assert np.linalg.norm(tip) == pytest.approx(3.0 / np.cos(0.5), rel=1e-14)
        assert part.area_m2 == pytest.approx(3.0 * 0.4, rel=1e-14)
        across = np.cross(corners_B[1:, 1:] - corners_B[:-1, :-1], corners_B[1:, :-1] - corners_B[:-1, 1:])
        np.testing.assert_allclose(0.5 * np.linalg.norm(across, axis=-1), part.panel_area_m2, rtol=1e-12)
