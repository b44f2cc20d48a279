"""Static aeroelastic trim of the flexible model: level flight with bent wings in equilibrium."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import NoConvergence, newton_krylov

from morphcore.errors import InvalidInput, TrimNotFound
from morphcore.frames import quaternion_from_euler, rotation_from_quaternion
from morphcore.multibody.beam import (
    BeamTurnedTooFar,
    NodePoses,
    carried,
    expand_solution,
    factor,
    reduce_right,
)
from morphcore.simulate.flexible import FlexibleFlight, FlexibleState, HingePath
from morphcore.simulate.trim import StartMode

Array = NDArray[np.float64]

TOLERANCE = 1e-10  # rad and m, limit of the displacement that the remaining imbalance would cause
ACCEPTED = 1e3 * TOLERANCE  # Krylov steps may stall in the last digits; this is far below what a flight shows
MAX_ITERATIONS = 40
LIFT_SLOPE = 2.0 * np.pi  # 1/rad: scales the balance of lift and weight to an angle


@dataclass(frozen=True)
class FlexibleTrim:
    """A start: angle of attack (rad), constant force (N) and moment (N m) in B, and the state.

    residual : the remaining imbalance as a displacement, rad and m.
    """

    alpha: float
    force_B: Array
    moment_B: Array
    state: FlexibleState
    residual: float


class _Balance:
    """The equations of trim: scaled imbalance for displacements of all nodes and, in free trim, alpha."""

    def __init__(self, flight: FlexibleFlight, path: HingePath, wind_N: Array, start: StartMode) -> None:
        self.flight, self.path, self.wind_N = flight, path, wind_N
        model = flight.model
        self.given = model.flight.start if start == "given" else None
        self.free = np.setdiff1d(np.arange(model.beams.nodes), np.concatenate([[0], model.roots]))
        surfaces = model.aircraft.surfaces
        self.area = sum(surface.area_m2 for surface in surfaces)
        first = np.zeros((model.beams.nodes, 6))
        self.rest = NodePoses(np.tile(np.eye(3), (model.beams.nodes, 1, 1)), model.rest_W.copy())
        poses, V, A = self.rest.copy(), first, first.copy()
        flight.follow(poses, V, A, path, 0)
        flight.lattice.deflect(path.deflection[0])
        for root, tip in zip(model.roots, model.tips, strict=True):
            poses.R[root : tip + 1] = poses.R[root]
            poses.x[root : tip + 1] = poses.x[root] + model.rest_W[root : tip + 1] @ poses.R[root].T
        self.unbent = poses

    @property
    def unknowns(self) -> int:
        """Number of unknowns."""
        return 6 * self.free.size + (1 if self.given is None else 0)

    def _inertia(self, poses: NodePoses, at_rest: Array) -> Array:
        """Spatial inertia (6, 6) of the whole aircraft in this shape about the reference point.

        From the forces (n, 6) required at the nodes for unit accelerations, less those ``at_rest``.
        """
        zero, columns = np.zeros_like(at_rest), []
        for unit_B in np.eye(6):
            demands = self.flight.structure(poses, zero, self._rigid(poses, unit_B))
            columns.append(self.total(poses, demands - at_rest))
        return np.stack(columns, axis=1)

    def _rigid(self, poses: NodePoses, motion_B: Array) -> Array:
        """Motion vector of the fuselage carried rigidly to all nodes, (n, 6)."""
        return carried(poses, 0, motion_B, slice(None))

    def total(self, poses: NodePoses, forces: Array) -> Array:
        """Sum (6,) of force vectors (n, 6) on all nodes, about the reference point in B."""
        R_BX = poses.R[0].T @ poses.R
        x_B = (poses.x - poses.x[0]) @ poses.R[0]
        force = np.einsum("nij,nj->ni", R_BX, forces[:, 3:])
        moment = np.einsum("nij,nj->ni", R_BX, forces[:, :3]) + np.cross(x_B, force)
        return np.concatenate([moment.sum(axis=0), force.sum(axis=0)])

    def state(self, x: Array) -> tuple[FlexibleState, Array]:
        """The state for given unknowns, and the nodal forces it requires in addition to the constant ones."""
        flight, count = self.flight, 6 * self.free.size
        alpha = self.given.alpha_rad if self.given is not None else float(x[count])
        airspeed = flight.model.flight.airspeed_m_s
        R_NB = rotation_from_quaternion(quaternion_from_euler(0.0, alpha, 0.0))
        V_B = np.zeros(6)
        V_B[3:] = airspeed * np.array([np.cos(alpha), 0.0, np.sin(alpha)]) + self.wind_N @ R_NB
        increments = np.zeros((self.unbent.x.shape[0], 6))
        increments[self.free] = x[:count].reshape(-1, 6)
        poses = self.unbent.copy()
        poses.move(increments)
        poses.R, poses.x = np.ascontiguousarray(R_NB @ poses.R), poses.x @ R_NB.T
        V = self._rigid(poses, V_B)
        A = np.zeros_like(V)
        demands = flight.structure(poses, V, A)
        flight.place_lattice(poses, self.wind_N, V)
        twists = flight.sections.twists(V)
        wind_B = self.wind_N @ R_NB
        circulation = flight.lattice.circulation(twists, wind_B)
        flight.subtract_air(circulation, twists, wind_B, demands)
        if self.given is not None:
            # the wings move with the fuselage as one: its acceleration follows from the sum of all forces
            at_rest = flight.structure(poses, np.zeros_like(V), A)
            thrust = np.concatenate([self.given.moment_B, self.given.force_B])
            defect = thrust - self.total(poses, demands)
            A = self._rigid(poses, np.asarray(np.linalg.solve(self._inertia(poses, at_rest), defect)))
            demands += flight.structure(poses, V, A) - flight.structure(poses, V, np.zeros_like(V))
        lag = np.stack([circulation, circulation])
        return FlexibleState(poses, V, A, A.copy(), lag, circulation), demands

    def imbalance(self, x: Array) -> Array:
        """Displacements that would remove the imbalance and, in free trim, the lift deficit as an angle."""
        flight, model = self.flight, self.flight.model
        state, demands = self.state(x)
        total = self.total(state.poses, demands)
        factor(model.beams, flight.work, 0.0, 0.0, 1.0)
        reduce_right(model.beams, flight.work, demands)
        demands[model.roots] = 0.0
        expand_solution(model.beams, flight.work, demands)
        bent = demands[self.free].ravel()
        if self.given is not None:
            return np.asarray(bent)
        alpha = x[-1]
        normal = -np.sin(alpha) * total[3] + np.cos(alpha) * total[5]
        return np.append(bent, normal / (model.flight.dynamic_pressure_pa * self.area * LIFT_SLOPE))


def trim_flexible(
    flight: FlexibleFlight, path: HingePath, wind_N: Array, *, start: StartMode = "trim"
) -> FlexibleTrim:
    """Equilibrium at the path's first hinge angles, as `simulate.trim.trim` defines it.

    Unknowns are the poses of all free nodes and the angle of attack; thrust along the flight path, side force
    and moment follow. With ``start="given"`` they are the flight's, the unknowns are the nodes, and the wings
    share the fuselage's acceleration, which follows from the sum of all forces. Newton's method with Krylov
    steps (`scipy.optimize.newton_krylov`), on the imbalance divided by the structure's stiffness.

    Raises
    ------
    InvalidInput : ``start="given"`` and the flight has none. TrimNotFound : no equilibrium was found.
    """
    if start == "given" and flight.model.flight.start is None:
        raise InvalidInput(
            'start = "given", but the flight has no field `start`',
            pointer="/flight/start",
            hint='give alpha_rad, force_b_n and moment_b_n_m, or use start = "trim"',
        )
    balance = _Balance(flight, path, wind_N, start)
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            x = _newton(balance)
        residual = float(np.abs(balance.imbalance(x)).max())
    except (BeamTurnedTooFar, ValueError):
        raise TrimNotFound(residual=float("inf"), iterations=MAX_ITERATIONS) from None
    if not residual < ACCEPTED:
        raise TrimNotFound(residual=residual, iterations=MAX_ITERATIONS)
    state, demands = balance.state(x)
    given = balance.given
    if given is not None:
        return FlexibleTrim(given.alpha_rad, given.force_B, given.moment_B, state, residual)
    total = balance.total(state.poses, demands)
    return FlexibleTrim(float(x[-1]), total[3:].copy(), total[:3].copy(), state, residual)


def _newton(balance: _Balance) -> Array:
    """Where Newton's method ends, converged or not."""
    try:
        return np.asarray(
            newton_krylov(
                balance.imbalance,  # type: ignore[arg-type]
                np.zeros(balance.unknowns),
                f_tol=TOLERANCE,
                maxiter=MAX_ITERATIONS,
                method="lgmres",
            )
        )
    except NoConvergence as stalled:
        return np.asarray(stalled.args[0])
