"""Air loads on rigid links: out of the lanes' kernels, and summed over a lattice's edges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.operator import BODY_AFT
from morphcore.aero.vlm import influence
from morphcore.geometry.lattice import surface_pose
from morphcore.lanes import ALONE, lane_type
from morphcore.models.equivalent import ChainModel, LaneConstants, ParameterBatch, lane_constants, to_lanes
from morphcore.models.kernels.layout import S_FREE
from morphcore.simulate.batch import shared_numbers
from morphcore.simulate.kernels.batch import rates_of_blocks
from morphcore.simulate.plan import FlightPlan
from tests.oracles.lattice import edge_forces, edge_midpoints, panel_normals, solve_circulation

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LinkLoads:
    """Twists [angular; linear] and wrenches [moment; force], (links, 6), in link axes at their origins."""

    twist: Array
    wrench: Array


def lane_loads(model: ChainModel, batch: ParameterBatch, plan: FlightPlan, state: Array) -> LinkLoads:
    """Wrenches at the start of a plan from the kernels, for one state row."""
    constants: LaneConstants = lane_constants(model, batch, plan.grid.step_s)
    operators, strips = plan.table.between(0, 1)
    rows, columns = model.lattice.operator_shape
    scratch = np.zeros((model.scratch_rows, ALONE))
    lanes = to_lanes(state[None])
    rates_of_blocks(
        lane_type(ALONE), 0, 1,
        model.surfaces, constants.ranges, shared_numbers(model), strips, plan.hinges[:1],
        plan.surface_accelerations[0], operators, plan.air(0, 1), constants.rows,
        np.zeros((model.state_rows, ALONE)), lanes,
        scratch, np.zeros((columns, ALONE)), np.zeros((rows, ALONE)), np.zeros_like(lanes),
    )  # fmt: skip
    twist = scratch[S_FREE : S_FREE + 6 * model.links, 0].reshape(-1, 6)
    wrench = scratch[S_FREE + 6 * model.links : S_FREE + 12 * model.links, 0].reshape(-1, 6)
    return LinkLoads(twist.copy(), wrench.copy())


def edge_loads(model: ChainModel, angles: Array, twist_B: Array) -> Array:
    """Wrenches (s, 6) on undeformed surfaces that move through still air with the aircraft, hinges at rest.

    In each surface's axes at its first link's origin. Lattice, wake and density are the model's; forces on
    all bound edges by Kutta and Joukowski's law with the local velocity, no lag, no drag.
    """
    surfaces, table = model.aircraft.surfaces, model.lattice.table
    corners, controls, poses = [], [], []
    for surface, part, own in zip(
        surfaces, model.lattice.lattices, model.aircraft.hinge_columns, strict=True
    ):
        R_BW, r_B = surface_pose(surface, angles[own])
        corners.append((part.ring_corners_W @ R_BW.T + r_B).reshape(-1, 3))
        controls.append((part.control_points_W @ R_BW.T + r_B).reshape(-1, 3))
        poses.append((R_BW, r_B + R_BW @ surface.elastic_axis_W))
    corners_B, controls_B = np.concatenate(corners), np.concatenate(controls)

    def flow(points: Array) -> Array:
        return np.asarray(-(twist_B[3:] + np.cross(twist_B[:3], points)))

    mach = model.flight.mach or 0.0
    circulation = solve_circulation(
        influence(controls_B, corners_B, table, BODY_AFT, mach=mach),
        panel_normals(corners_B, table),
        flow(controls_B),
    )
    middles = edge_midpoints(corners_B, table)
    induced = influence(middles, corners_B, table, BODY_AFT, mach=mach)
    density = model.flight.air_density_kg_m3
    forces = edge_forces(corners_B, table, circulation, flow(middles), induced, density)
    wrenches = []
    for s, (R_BW, origin_B) in enumerate(poses):
        mine = table.panel_surface[table.edge_panel[:, 0]] == s
        force_W = forces.force_B[mine] @ R_BW
        arm_W = (forces.points_B[mine] - origin_B) @ R_BW
        wrenches.append(np.concatenate([np.cross(arm_W, force_W).sum(axis=0), force_W.sum(axis=0)]))
    return np.array(wrenches)
