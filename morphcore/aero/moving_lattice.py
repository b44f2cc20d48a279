"""Air loads of a lattice that rides on moving sections, with Jones' lag on every circulation.

The lattice is placed where the sections are (`place`), which computes its influence afresh, and then answers
to any velocities of the sections (`section_forces`): within the iterations of one time step they change, the
place does not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lu_factor, lu_solve

from morphcore.aero.kernels.lattice_forces import (
    add_rider_forces,
    corner_forces,
    normal_influence,
    rider_velocities,
)
from morphcore.aero.kernels.loads import JONES_A1, JONES_A2
from morphcore.aero.vlm import RingTable, edge_midpoints, influence, panel_normals
from morphcore.geometry.lattice import VortexCore

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True)
class Riders:
    """What of a lattice rides on which section (k sections, c ring corners, r panels, t strips).

    corner, control, drag : (c,), (r,), (t,) the section that each ring corner, control point and strip's drag
    rides on. corner_arm, control_arm, drag_arm : (.., 3) their place in section axes, m. drag_area : (t,)
    profile drag coefficient times area, m^2. lag_time : (2, r) both time constants of Jones' function, s.
    """

    sections: int
    corner: IntArray
    corner_arm: Array
    control: IntArray
    control_arm: Array
    drag: IntArray
    drag_arm: Array
    drag_area: Array
    lag_time: Array


class MovingLattice:
    """A lattice on its sections; keeps the influence of its last place.

    Parameters
    ----------
    table, riders, core : the lattice. density : kg/m^3. mach : of the free stream.
    """

    def __init__(
        self, table: RingTable, riders: Riders, core: VortexCore, density: float, mach: float
    ) -> None:
        self.table, self.riders = table, riders
        self._core, self._density, self._mach = core, density, mach
        self._matrix: Array = np.empty((table.rings, table.rings))
        self._local: Array = np.empty((3, table.edges))
        self._corner_velocity: Array = np.empty((table.corners, 3))
        self._control_velocity: Array = np.empty((table.rings, 3))
        self._drag_velocity: Array = np.empty((riders.drag.size, 3))
        self._force: Array = np.empty((table.corners, 3))

    def place(self, R_BS: Array, x_B: Array, stream_B: Array) -> None:
        """Put the lattice on its sections: R_BS (k, 3, 3) to B, x_B (k, 3) m; wake along stream_B (3,)."""
        riders, table = self.riders, self.table
        self._R_BS = R_BS
        self._corners = _placed(R_BS, x_B, riders.corner, riders.corner_arm)
        controls = _placed(R_BS, x_B, riders.control, riders.control_arm)
        points = np.concatenate([controls, edge_midpoints(self._corners, table)])
        self._velocity = influence(points, self._corners, table, stream_B, self._core, self._mach)
        self._normals = panel_normals(self._corners, table)
        normal_influence(self._normals, self._velocity, self._matrix)
        self._factors = lu_factor(self._matrix, check_finite=False)

    def circulation(self, twists: Array, wind_B: Array) -> Array:
        """Circulations (r,), m^2/s, without lag, for twists (k, 6) of the sections in their own axes."""
        riders = self.riders
        rider_velocities(riders.control, riders.control_arm, self._R_BS, twists, self._control_velocity)
        flow = wind_B - self._control_velocity
        return np.asarray(lu_solve(self._factors, -np.sum(self._normals * flow, axis=1), check_finite=False))

    def section_forces(self, lagged: Array, twists: Array, wind_B: Array) -> Array:
        """Force vectors (k, 6) on the sections, in their axes, for circulations as they act (r,)."""
        riders, table = self.riders, self.table
        out = np.zeros((self._R_BS.shape[0], 6))
        rider_velocities(riders.corner, riders.corner_arm, self._R_BS, twists, self._corner_velocity)
        corner_forces(
            self._velocity, table.rings, lagged, wind_B, self._corner_velocity, self._corners,
            table.edge_start, table.edge_end, table.edge_plus, table.edge_minus, self._density,
            self._local, self._force,
        )  # fmt: skip
        add_rider_forces(riders.corner, riders.corner_arm, self._R_BS, self._force, out)
        # profile drag of each strip, along the velocity of its middle
        rider_velocities(riders.drag, riders.drag_arm, self._R_BS, twists, self._drag_velocity)
        flow = wind_B - self._drag_velocity
        speed = np.sqrt(np.sum(flow**2, axis=1))
        drag = 0.5 * self._density * (riders.drag_area * speed)[:, None] * flow
        add_rider_forces(riders.drag, riders.drag_arm, self._R_BS, drag, out)
        return out


def acting_circulation(circulation: Array, lag: Array) -> Array:
    """Circulations (r,) after Jones' lag, with both lag states (2, r)."""
    return np.asarray((1.0 - JONES_A1 - JONES_A2) * circulation + JONES_A1 * lag[0] + JONES_A2 * lag[1])


def followed(lag: Array, before: Array, after: Array, lag_time: Array, step_s: float) -> Array:
    """Lag states (2, r) after a step over which the circulation runs straight from ``before`` to ``after``.

    The exact solution of T dz/dt = circulation - z.
    """
    z = step_s / lag_time
    decay, mean = np.exp(-z), -np.expm1(-z) / z
    return np.asarray(decay * lag + (mean - decay) * before + (1.0 - mean) * after)


def _placed(R_BS: Array, x_B: Array, section: IntArray, arm: Array) -> Array:
    return np.asarray(x_B[section] + np.einsum("mij,mj->mi", R_BS[section], arm))
