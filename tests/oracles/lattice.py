"""A steady vortex-ring lattice edge by edge: circulation by a dense solve, forces by Kutta and Joukowski."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from morphcore.aero.vlm import RingTable

Array = NDArray[np.float64]


@dataclass(frozen=True)
class EdgeForces:
    """Forces of the air on the bound edges and on the panels.

    Attributes (e edges, r panels)
    ----------
    points_B : (e, 3) midpoints of the edges, m. force_B : (e, 3) N.
    panel_force_B : (r, 3) N, every edge's force in equal parts on the panels it borders.
    panel_moment_B : (r, 3) N m, moment of that share about the origin of B.
    """

    points_B: Array
    force_B: Array
    panel_force_B: Array
    panel_moment_B: Array


def panel_normals(corners_B: ArrayLike, table: RingTable) -> Array:
    """Unit normals (r, 3) of the rings in B, on the lifting side (-z of a wing), across the diagonals."""
    corners = np.asarray(corners_B, dtype=np.float64).reshape(-1, 3)
    root_front, tip_front, root_aft, tip_aft = corners[table.ring_corner.T]
    # this sense is up on a right wing; on a left one strips run the other way
    normal = table.panel_side[:, None] * np.cross(tip_front - root_aft, root_front - tip_aft)
    return np.asarray(normal / np.sqrt(np.sum(normal**2, axis=1))[:, None])


def solve_circulation(velocity_B: Array, normals_B: Array, flow_B: Array) -> Array:
    """Circulations (r,) in m^2/s for which no air passes through the control points.

    Parameters
    ----------
    velocity_B : (3, r, r) of ``influence`` at the control points.
    normals_B : (r, 3) unit normals there; their sense does not matter.
    flow_B : (r, 3) air velocity relative to the structure there, m/s.
    """
    matrix = np.einsum("pa,arp->pr", normals_B, velocity_B)
    return np.asarray(np.linalg.solve(matrix, -np.sum(normals_B * flow_B, axis=1)))


def edge_midpoints(corners_B: ArrayLike, table: RingTable) -> Array:
    """Midpoints (e, 3) of the bound edges, m."""
    corners = np.asarray(corners_B, dtype=np.float64).reshape(-1, 3)
    return np.asarray(0.5 * (corners[table.edge_start] + corners[table.edge_end]))


def edge_circulation(circulation: Array, table: RingTable) -> Array:
    """Net circulation (e,) along every bound edge from the circulations (r,) of the rings, m^2/s."""
    padded = np.append(circulation, 0.0)  # index -1: no ring
    return np.asarray(padded[table.edge_plus] - padded[table.edge_minus])


def edge_forces(
    corners_B: ArrayLike,
    table: RingTable,
    circulation: Array,
    flow_B: Array,
    velocity_B: Array,
    density: float,
) -> EdgeForces:
    """Force of the air on all bound edges: density * gamma * velocity x edge (Kutta and Joukowski).

    The trailing edge carries none: wake and last ring cancel there.

    Parameters
    ----------
    corners_B : (c, 3) ring corners, m. circulation : (r,) m^2/s. density : kg/m^3.
    flow_B : (e, 3) air velocity relative to the structure at the edges' midpoints, m/s.
    velocity_B : (3, r, e) of ``influence`` at the midpoints.
    """
    corners = np.asarray(corners_B, dtype=np.float64).reshape(-1, 3)
    edge_B = corners[table.edge_end] - corners[table.edge_start]
    points_B = edge_midpoints(corners, table)
    local_B = flow_B + np.einsum("are,r->ea", velocity_B, circulation)
    force_B = density * edge_circulation(circulation, table)[:, None] * np.cross(local_B, edge_B)
    moment_B = np.cross(points_B, force_B)
    panel_force_B = np.zeros((table.rings, 3))
    panel_moment_B = np.zeros((table.rings, 3))
    for side in range(2):
        np.add.at(panel_force_B, table.edge_panel[:, side], 0.5 * force_B)
        np.add.at(panel_moment_B, table.edge_panel[:, side], 0.5 * moment_B)
    return EdgeForces(points_B, force_B, panel_force_B, panel_moment_B)
