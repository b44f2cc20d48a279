"""Flights of the flexible model: generalised-alpha on SE(3), a fresh lattice on the bent wings each step.

Brüls, Cardona & Arnold (2012): velocities and positions advance with an algorithmic acceleration ``a`` that
averages the true one, A; positions move by the exponential of the increment in body axes. Each step's
equations hold at its end to `TOLERANCE`, air loads included: the lattice stands where the step's predictor
puts it (third order off), its circulations, lag and forces follow every iteration.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.moving_lattice import MovingLattice, acting_circulation, followed
from morphcore.errors import FlightDiverged
from morphcore.models.flexible import FlexibleModel
from morphcore.multibody.beam import (
    BeamTurnedTooFar,
    BeamWorkspace,
    NodePoses,
    carried,
    expand_solution,
    factor,
    node_forces,
    reduce_right,
    sections_of,
    subtract_section_forces,
)
from morphcore.multibody.kernels.hinge import H_ORIGIN, H_RATE, H_SUBSPACE
from morphcore.simulate.kernels.roots import (
    follow_fuselage,
    gather_root_matrices,
    gather_roots,
    spread_to_roots,
)
from morphcore.simulate.plan import TimeGrid, hinge_rows
from morphcore.simulate.schedule import Schedule

Array = NDArray[np.float64]

# s; holds attitude within 1e-5 rad of the converged solution on the example flights, a tenth of what the
# best equivalent models are off (tests/simulate/test_flexible.py)
FLEXIBLE_STEP_S = 0.001
SPECTRAL_RADIUS = 0.6  # of the stepper at infinite frequency: stretching waves die out in some ten steps
TOLERANCE = 1e-8  # rad/s and m/s, of the last Newton step's change of the velocities
START_TOLERANCE = 1e-9  # of the accelerations at the start, relative
SLOW = 0.1  # of the last iteration's change: then the matrix is formed anew
MOST_ITERATIONS = 50


@dataclass(frozen=True)
class HingePath:
    """Prescribed motion of all hinges along a time grid (k times, s surfaces).

    R_BW : (k, s, 3, 3); origin_B : (k, s, 3) root nodes, m; axis : (k, s, 6) twist in W for unit rate; angle,
    rate, acceleration : (k, s).
    """

    R_BW: Array
    origin_B: Array
    axis: Array
    angle: Array
    rate: Array
    acceleration: Array


def hinge_path(model: FlexibleModel, schedules: Sequence[Schedule], grid: TimeGrid) -> HingePath:
    """Hinge motion on a grid.

    Accelerations are central differences of the rates over two steps: where a sampled rate has a corner, the
    impulse of the hinge stays right and in time.
    """
    times, h = grid.times_s, grid.step_s
    rows, angle, rate, acceleration = [], [], [], []
    for surface, schedule in zip(model.aircraft.surfaces, schedules, strict=True):
        motion = schedule.motion(times)
        moves = 1.0 if surface.hinge is not None else 0.0
        rows.append(hinge_rows(surface, motion.angle, motion.rate))
        angle.append(motion.angle)
        rate.append(moves * motion.rate)
        late, early = schedule.motion(times + h).rate, schedule.motion(times - h).rate
        mean = (late - early) / (2.0 * h)
        mean[0] = (late[0] - motion.rate[0]) / h  # what went before the flight is not in it
        acceleration.append(moves * mean)
    hinges = np.stack(rows, axis=1)
    return HingePath(
        R_BW=np.ascontiguousarray(hinges[..., :9]).reshape(*hinges.shape[:2], 3, 3),
        origin_B=np.ascontiguousarray(hinges[..., H_ORIGIN : H_ORIGIN + 3]),
        axis=np.ascontiguousarray(hinges[..., H_SUBSPACE:H_RATE]),
        angle=np.stack(angle, axis=1),
        rate=np.stack(rate, axis=1),
        acceleration=np.stack(acceleration, axis=1),
    )


@dataclass(frozen=True)
class FlexibleState:
    """The state at one time (n nodes, r panels).

    poses : of all nodes. V, A, a : (n, 6) twists, their rates and the stepper's average of these, in node
    axes. lag : (2, r) and circulation : (r,), m^2/s.
    """

    poses: NodePoses
    V: Array
    A: Array
    a: Array
    lag: Array
    circulation: Array


class FlexibleFlight:
    """One aircraft with its scratch; forces and steps.

    Parameters
    ----------
    model : the aircraft. ``thrust`` (6,), constant moment and force on the fuselage in B, is set after trim.
    """

    def __init__(self, model: FlexibleModel) -> None:
        flight = model.flight
        self.model = model
        self.thrust: Array = np.zeros(6)
        self.work = BeamWorkspace(model.beams)
        self.gravity_N: Array = np.array([0.0, 0.0, flight.gravity_m_s2])
        self.lattice = MovingLattice(
            model.lattice.table,
            model.riders,
            model.lattice.settings.core,
            flight.air_density_kg_m3,
            flight.mach or 0.0,
        )
        self._v: Array = np.zeros((3, 6))
        self._m: Array = np.zeros((2, 6, 6))

    def follow(self, poses: NodePoses, V: Array, A: Array, path: HingePath, row: int) -> None:
        """Put the root nodes where fuselage and hinges say, in place."""
        follow_fuselage(
            self.model.roots, path.R_BW[row], path.origin_B[row], path.axis[row], path.rate[row],
            path.acceleration[row], poses.R, poses.x, V, A, self._v,
        )  # fmt: skip

    def structure(self, poses: NodePoses, V: Array, A: Array) -> Array:
        """What structure, inertia and weight ask of the nodes, (n, 6)."""
        return node_forces(self.model.beams, self.work, poses, V, A, self.gravity_N)

    def place_lattice(self, poses: NodePoses, V: Array, wind_N: Array) -> Array:
        """Put the lattice on the deformed wings; returns the sections' twists (k, 6)."""
        found, twists = self._sections(poses, V)
        R_NB, x_N = poses.R[0], poses.x[0]
        R_BS = np.ascontiguousarray(R_NB.T @ found.R)
        self.lattice.place(R_BS, (found.x - x_N) @ R_NB, wind_N @ R_NB - V[0, 3:])
        return twists

    def twists(self, poses: NodePoses, V: Array) -> Array:
        """The sections' twists (k, 6) in their axes."""
        return self._sections(poses, V)[1]

    def _sections(self, poses: NodePoses, V: Array) -> tuple[NodePoses, Array]:
        model = self.model
        return sections_of(model.beams, self.work, poses, V, model.element, model.fraction)

    def subtract_air(self, acting: Array, twists: Array, wind_B: Array, right: Array) -> None:
        """Subtract the air's forces from the nodes' demands (n, 6)."""
        model = self.model
        forces = self.lattice.section_forces(acting, twists, wind_B)
        subtract_section_forces(model.beams, self.work, model.element, model.fraction, forces, right)

    def total_on_fuselage(self, demands: Array, path: HingePath, row: int) -> Array:
        """Sum (6,) of forces at roots and fuselage about the reference point, in B."""
        out: Array = demands[0].copy()
        gather_roots(self.model.roots, path.R_BW[row], path.origin_B[row], demands, out)
        return out

    def solve(self, right: Array, path: HingePath, row: int) -> Array:
        """Solution (n, 6) of the factored iteration matrix, the roots tied to the fuselage; in place."""
        model, work = self.model, self.work
        hinge = (model.roots, path.R_BW[row], path.origin_B[row])
        reduce_right(model.beams, work, right)
        matrix = work.diagonals[0].copy()
        gather_root_matrices(*hinge, work.diagonals, self._v, self._m, matrix)
        right[0] = np.linalg.solve(matrix, self.total_on_fuselage(right, path, row))
        spread_to_roots(*hinge, right[0], right)
        expand_solution(model.beams, work, right)
        return right


@dataclass(frozen=True)
class Stepper:
    """Coefficients of the generalised-alpha rule for one step length, s."""

    step_s: float
    spectral_radius: float = SPECTRAL_RADIUS

    @property
    def alpha_m(self) -> float:
        """Weight of the old algorithmic acceleration."""
        return (2.0 * self.spectral_radius - 1.0) / (self.spectral_radius + 1.0)

    @property
    def alpha_f(self) -> float:
        """Weight of the old true acceleration."""
        return self.spectral_radius / (self.spectral_radius + 1.0)

    @property
    def gamma(self) -> float:
        """Newmark's gamma for second order."""
        return 0.5 + self.alpha_f - self.alpha_m

    @property
    def beta(self) -> float:
        """Newmark's beta."""
        return 0.25 * (self.gamma + 0.5) ** 2

    def averaged(self, before: FlexibleState, A: Array) -> Array:
        """The algorithmic acceleration (n, 6) of a step whose true one at its end is A."""
        new = (1.0 - self.alpha_f) * A + self.alpha_f * before.A - self.alpha_m * before.a
        return np.asarray(new / (1.0 - self.alpha_m))

    def velocity(self, before: FlexibleState, a: Array) -> Array:
        """Twists (n, 6) at the end of the step."""
        return np.asarray(before.V + self.step_s * ((1.0 - self.gamma) * before.a + self.gamma * a))

    def increment(self, before: FlexibleState, a: Array) -> Array:
        """Increments (n, 6) of the poses."""
        h = self.step_s
        return np.asarray(h * before.V + h * h * ((0.5 - self.beta) * before.a + self.beta * a))


def stepped(
    flight: FlexibleFlight, before: FlexibleState, path: HingePath, row: int, wind_N: Array, rule: Stepper
) -> FlexibleState:
    """The state one step on, at row ``row`` of the hinges' path.

    Raises
    ------
    _Lost : Newton's iteration does not arrive. BeamTurnedTooFar : an element is bent too far.
    """
    h, model = rule.step_s, flight.model
    share = (1.0 - rule.alpha_f) / (1.0 - rule.alpha_m)
    A = before.A.copy()
    lag, circulation = before.lag, before.circulation
    slow, last = True, np.inf
    for iteration in range(MOST_ITERATIONS):
        a, V, poses = _moved(flight, before, A, path, row, rule)
        demands = flight.structure(poses, V, A)
        twists = flight.place_lattice(poses, V, wind_N) if iteration == 0 else flight.twists(poses, V)
        wind_B = wind_N @ poses.R[0]
        circulation = flight.lattice.circulation(twists, wind_B)
        lag = followed(before.lag, before.circulation, circulation, model.riders.lag_time, h)
        flight.subtract_air(acting_circulation(circulation, lag), twists, wind_B, demands)
        demands[0] -= flight.thrust
        if slow:
            factor(model.beams, flight.work, 1.0, share * h * rule.gamma, share * h * h * rule.beta)
        change = flight.solve(-demands, path, row)
        A += change
        largest = h * float(np.abs(change).max())
        if largest < TOLERANCE:
            a, V, poses = _moved(flight, before, A, path, row, rule)
            return FlexibleState(poses, V, A, a, lag, circulation)
        if not np.isfinite(largest):
            break
        slow, last = largest > SLOW * last, largest
    raise _Lost


def _moved(
    flight: FlexibleFlight, before: FlexibleState, A: Array, path: HingePath, row: int, rule: Stepper
) -> tuple[Array, Array, NodePoses]:
    """Where twist rates A (n, 6) at the end of a step lead: a, V and poses; the roots' part of A is set."""
    a = rule.averaged(before, A)
    V, poses = rule.velocity(before, a), before.poses.copy()
    poses.move(rule.increment(before, a))
    flight.follow(poses, V, A, path, row)
    return a, V, poses


class _Lost(Exception):
    """A step without a solution; `fly_flexible` says when."""


def fly_flexible(
    flight: FlexibleFlight, path: HingePath, grid: TimeGrid, wind_N: Array, state: FlexibleState
) -> Iterator[FlexibleState]:
    """States at all grid times, the first included; wind_N (steps + 1, 3), m/s.

    Raises
    ------
    FlightDiverged : the flight leaves what the model can follow.
    """
    rule = Stepper(grid.step_s)
    yield state
    for step in range(grid.steps):
        try:
            with np.errstate(over="ignore", invalid="ignore"):
                state = stepped(flight, state, path, step + 1, wind_N[step + 1], rule)
        except (_Lost, BeamTurnedTooFar):
            raise FlightDiverged(time_s=float(grid.times_s[step])) from None
        yield state


def set_in_motion(
    flight: FlexibleFlight, path: HingePath, wind_N: Array, state: FlexibleState
) -> FlexibleState:
    """A trimmed state with its hinges moving as the path begins, the wings turning with them as one.

    Accelerations are those that the forces then ask for. A path that begins at rest changes nothing.
    """
    if not (path.rate[0].any() or path.acceleration[0].any()):
        return state
    model, poses = flight.model, state.poses
    V, A = state.V.copy(), np.zeros_like(state.A)
    flight.follow(poses, V, A, path, 0)
    for root, tip in zip(model.roots, model.tips, strict=True):
        wing = slice(root, tip + 1)
        V[wing] = carried(poses, root, V[root], wing)
    circulation = state.circulation
    for iteration in range(MOST_ITERATIONS):
        flight.follow(poses, V, A, path, 0)
        demands = flight.structure(poses, V, A)
        twists = flight.place_lattice(poses, V, wind_N) if iteration == 0 else flight.twists(poses, V)
        wind_B = wind_N @ poses.R[0]
        circulation = flight.lattice.circulation(twists, wind_B)
        flight.subtract_air(acting_circulation(circulation, state.lag), twists, wind_B, demands)
        demands[0] -= flight.thrust
        factor(model.beams, flight.work, 1.0, 0.0, 0.0)
        change = flight.solve(-demands, path, 0)
        A += change
        if np.abs(change).max() < START_TOLERANCE * max(1.0, float(np.abs(A).max())):
            break
    flight.follow(poses, V, A, path, 0)
    return FlexibleState(poses, V, A, A.copy(), state.lag, circulation)
