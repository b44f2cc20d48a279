"""The flexible model's parts against the aircraft they are made of."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from morphcore.aero.moving_lattice import MovingLattice
from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Aircraft
from morphcore.geometry.lattice import surface_pose
from morphcore.models.flexible import FlexibleModel, flexible_model
from morphcore.multibody.beam import BeamWorkspace, NodePoses, node_forces
from tests.models.chains import EXAMPLES, aircraft_of, example_aircraft, example_flight
from tests.oracles.clamped_beams import sections_of
from tests.oracles.polar import steady_polar

NO_GRAVITY = np.zeros(3)


def odd_aircraft() -> Aircraft:
    """Tapered wings with offset axes, and a fixed rigid tail."""
    document = json.loads((EXAMPLES / "aircraft.json").read_text())
    for surface in document["surfaces"]:
        surface.pop("chord_m")
        surface |= {"root_chord_m": 0.4, "tip_chord_m": 0.2, "elastic_axis_offset_m": 0.02}
        surface |= {"mass_axis_offset_m": -0.01}
    tail = dict(document["surfaces"][0])
    tail.pop("hinge")
    tail |= {"name": "tail", "flexible": False, "position_m": [-2.0, 0.1, -0.2], "span_m": 0.8}
    document["surfaces"].append(tail)
    return aircraft_of(document)


def unbent(model: FlexibleModel) -> NodePoses:
    """Nodes of the unbent wings at zero hinge angles, the fuselage at the origin along N."""
    poses = NodePoses(np.tile(np.eye(3), (model.beams.nodes, 1, 1)), model.rest_W.copy())
    for surface, root, tip in zip(model.aircraft.surfaces, model.roots, model.tips, strict=True):
        axis = np.array([-surface.elastic_axis_offset_m, 0.0, 0.0])  # aft
        poses.x[root : tip + 1] += surface_pose(surface)[1] + axis
    return poses


def test_mass_is_that_of_the_aircraft() -> None:
    """A unit rigid acceleration requires the mass as force and, in rotation, the inertia by quadrature."""
    model = flexible_model(odd_aircraft(), example_flight(), elements=4)
    poses, zero = unbent(model), np.zeros((model.beams.nodes, 6))
    lifted = zero.copy()
    lifted[:, 5] = 1.0
    demands = node_forces(model.beams, BeamWorkspace(model.beams), poses, zero, lifted, NO_GRAVITY)
    mass, moment_x = model.aircraft.fuselage.mass_kg, 0.0
    for surface in model.aircraft.surfaces:
        edges = np.linspace(0.0, surface.span_m, 4001)
        y = 0.5 * (edges[1:] + edges[:-1])
        lumps = surface.section_at(y).mass * np.diff(edges)
        mass += lumps.sum()
        moment_x += float(lumps @ (surface_pose(surface)[1][1] + surface.span_sign * y))
    assert demands[:, 5].sum() == pytest.approx(mass, rel=1e-6)
    about_x = np.sum(demands[:, 0] + poses.x[:, 1] * demands[:, 5] - poses.x[:, 2] * demands[:, 4])
    assert about_x == pytest.approx(moment_x, abs=1e-5 * mass)


def test_lattice_rides_where_the_surfaces_are() -> None:
    """Corners and control points on unbent wings are the surface lattice's, moved to its place."""
    model = flexible_model(odd_aircraft(), example_flight(), elements=7)
    poses, work = unbent(model), BeamWorkspace(model.beams)
    zero = np.zeros((model.beams.nodes, 6))
    node_forces(model.beams, work, poses, zero, zero, NO_GRAVITY)
    found, _ = sections_of(model.beams, work, poses, zero, model.element, model.fraction)
    riders = model.riders
    corners = found.x[riders.corner] + np.einsum("mij,mj->mi", found.R[riders.corner], riders.corner_arm)
    controls = found.x[riders.control] + np.einsum("mij,mj->mi", found.R[riders.control], riders.control_arm)
    places = [surface_pose(surface)[1] for surface in model.aircraft.surfaces]
    parts = model.lattice.lattices
    expected = [part.ring_corners_W.reshape(-1, 3) + r for part, r in zip(parts, places, strict=True)]
    np.testing.assert_allclose(corners, np.concatenate(expected), atol=1e-12)
    expected = [part.control_points_W.reshape(-1, 3) + r for part, r in zip(parts, places, strict=True)]
    np.testing.assert_allclose(controls, np.concatenate(expected), atol=1e-12)


def test_steady_loads_are_the_polars() -> None:
    """On unbent wings in steady flight the riding lattice gives force and moment of `steady_polar`."""
    aircraft = example_aircraft()
    no_drag = replace(aircraft, surfaces=tuple(replace(s, profile_drag=0.0) for s in aircraft.surfaces))
    flight, alpha = example_flight(), 0.05
    model = flexible_model(no_drag, flight, elements=3)
    poses, work = unbent(model), BeamWorkspace(model.beams)
    V = np.zeros((model.beams.nodes, 6))
    V[:, 3], V[:, 5] = 150.0 * np.cos(alpha), 150.0 * np.sin(alpha)
    node_forces(model.beams, work, poses, V, np.zeros_like(V), NO_GRAVITY)
    found, twists = sections_of(model.beams, work, poses, V, model.element, model.fraction)
    core = model.lattice.settings.core
    lattice = MovingLattice(model.lattice.table, model.riders, core, flight.air_density_kg_m3, 0.0)
    lattice.place(found.R, found.x, -V[0, 3:])
    gamma = lattice.circulation(twists, np.zeros(3))
    forces = lattice.section_forces(gamma, twists, np.zeros(3))
    total = np.einsum("kij,kj->ki", found.R, forces[:, 3:])
    moment = np.einsum("kij,kj->ki", found.R, forces[:, :3]) + np.cross(found.x, total)
    steady = steady_polar(no_drag, 150.0, flight.air_density_kg_m3, alpha)
    np.testing.assert_allclose(total.sum(axis=0), steady.force_B, atol=1e-9 * steady.lift_n)
    np.testing.assert_allclose(moment.sum(axis=0), steady.moment_B, atol=1e-9 * steady.lift_n)


def test_number_of_elements_is_checked() -> None:
    """An absurd number of elements is an error that names the field."""
    with pytest.raises(InvalidInput, match="elements") as caught:
        flexible_model(example_aircraft(), example_flight(), elements=0)
    assert caught.value.pointer == "/model/elements"
