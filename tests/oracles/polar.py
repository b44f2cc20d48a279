"""Steady coefficients of an undeformed aircraft from its lattice: for tests, polars and first looks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.vlm import RingTable, influence, ring_table
from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Aircraft
from morphcore.geometry.lattice import surface_lattice, surface_pose
from morphdata.lattice import DEFAULT_CORE, DEFAULT_LATTICE, Lattice, VortexCore
from tests.oracles.lattice import EdgeForces, edge_forces, edge_midpoints, panel_normals, solve_circulation

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SteadyLoads:
    """Loads of an undeformed aircraft in steady flight.

    Attributes
    ----------
    force_B, moment_B : (3,) N and N m about the fuselage reference point.
    lift_n, drag_n, side_n : force across the stream in the plane of symmetry (up), along it (aft), and to the
        right.
    lift_coefficient, drag_coefficient : referred to the planform area of all surfaces.
    strip_lift_n : one array (spanwise,) a surface, root to tip, N.
    circulation : (r,) of the rings, m^2/s. edges : force by force.
    """

    force_B: Array
    moment_B: Array
    lift_n: float
    drag_n: float
    side_n: float
    lift_coefficient: float
    drag_coefficient: float
    strip_lift_n: tuple[Array, ...]
    circulation: Array
    edges: EdgeForces


def steady_polar(
    aircraft: Aircraft,
    airspeed: float,
    density: float,
    alpha_rad: float,
    *,
    beta_rad: float = 0.0,
    hinge_rad: Sequence[float] = (),
    lattice: Lattice = DEFAULT_LATTICE,
    mach: float = 0.0,
) -> SteadyLoads:
    """Loads at an angle of attack and of sideslip, without profile drag.

    Parameters
    ----------
    airspeed, density : m/s and kg/m^3.
    hinge_rad : angle of each hinge in the aircraft's order; empty for all at zero.
    lattice : panels of every surface and core of their vortices. mach : as in ``influence``.
    """
    angles = _hinge_angles(aircraft, hinge_rad)
    panels = (lattice.chordwise, lattice.spanwise)
    lattices = [surface_lattice(surface, *panels) for surface in aircraft.surfaces]
    corners, controls = [], []
    for surface, part, own in zip(aircraft.surfaces, lattices, aircraft.hinge_columns, strict=True):
        R_BW, r_B = surface_pose(surface, angles[own])
        corners.append(part.ring_corners_W.reshape(-1, 3) @ R_BW.T + r_B)
        controls.append(part.control_points_W.reshape(-1, 3) @ R_BW.T + r_B)
    corners_B, controls_B = np.concatenate(corners), np.concatenate(controls)
    table = ring_table(lattices)

    stream_B = -np.array(
        [np.cos(alpha_rad) * np.cos(beta_rad), np.sin(beta_rad), np.sin(alpha_rad) * np.cos(beta_rad)]
    )
    flow_B = airspeed * stream_B
    circulation, edges = steady_edges(
        corners_B, controls_B, table, flow_B, density, core=lattice.core, mach=mach
    )

    force_B = edges.force_B.sum(axis=0)
    up_B = np.array([np.sin(alpha_rad), 0.0, -np.cos(alpha_rad)])
    right_B = np.cross(stream_B, up_B)
    load_n = 0.5 * density * airspeed**2 * sum(part.area_m2 for part in lattices)
    panel_lift = edges.panel_force_B @ up_B
    strip_lift = tuple(
        panel_lift[table.panel_surface == index].reshape(panels).sum(axis=0) for index in range(len(lattices))
    )
    return SteadyLoads(
        force_B=force_B,
        moment_B=np.cross(edges.points_B, edges.force_B).sum(axis=0),
        lift_n=float(force_B @ up_B),
        drag_n=float(force_B @ stream_B),
        side_n=float(force_B @ right_B),
        lift_coefficient=float(force_B @ up_B / load_n),
        drag_coefficient=float(force_B @ stream_B / load_n),
        strip_lift_n=strip_lift,
        circulation=circulation,
        edges=edges,
    )


def steady_edges(
    corners_B: Array,
    controls_B: Array,
    table: RingTable,
    flow_B: Array,
    density: float,
    *,
    core: VortexCore = DEFAULT_CORE,
    mach: float = 0.0,
) -> tuple[Array, EdgeForces]:
    """Circulations (r,) and forces of a lattice at rest in a uniform stream, its wake along the stream.

    Parameters
    ----------
    corners_B : (c, 3) ring corners, m. controls_B : (r, 3) control points, m.
    flow_B : (3,) velocity of the air relative to the lattice, m/s. density : kg/m^3.
    """
    velocity_B = influence(controls_B, corners_B, table, flow_B, core, mach)
    flow_controls_B = np.broadcast_to(flow_B, controls_B.shape)
    circulation = solve_circulation(velocity_B, panel_normals(corners_B, table), flow_controls_B)
    points_B = edge_midpoints(corners_B, table)
    velocity_B = influence(points_B, corners_B, table, flow_B, core, mach)
    flow_points_B = np.broadcast_to(flow_B, points_B.shape)
    return circulation, edge_forces(corners_B, table, circulation, flow_points_B, velocity_B, density)


def _hinge_angles(aircraft: Aircraft, hinge_rad: Sequence[float]) -> Sequence[float]:
    count = len(aircraft.hinges)
    if len(hinge_rad) not in (0, count):
        raise InvalidInput(
            f"{len(hinge_rad)} hinge angles for {count} hinges",
            hint="give one for each hinge, or none",
        )
    return hinge_rad if len(hinge_rad) else [0.0] * count
