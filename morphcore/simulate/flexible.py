"""Flights of the flexible model: generalised-alpha on SE(3), a fresh lattice on the bent wings each step.

Brüls, Cardona & Arnold (2012): velocities and positions advance with an algorithmic acceleration ``a`` that
averages the true one, A; positions move by the exponential of the increment in body axes. Each step's
equations hold at its end to `kernels.flexible_step.TOLERANCE`, air loads included: the lattice stays where
the step's predictor puts it (an error of third order), its circulations, lag and forces are updated in every
iteration.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.moving_lattice import MovingLattice, acting_circulation
from morphcore.errors import FlightDiverged
from morphcore.geometry.hinge import hinged_pose
from morphcore.geometry.surface import Surface
from morphcore.models.flexible import FlexibleModel
from morphcore.multibody.beam import (
    GAUSS,
    GAUSS_SERIES,
    Beams,
    BeamWorkspace,
    NodePoses,
    Sections,
    carried,
    expand_solution,
    factor,
    node_forces,
    reduce_right,
)
from morphcore.multibody.hinges import hinge_screws, relative_motion
from morphcore.multibody.kernels.beam import apparent_forces
from morphcore.multibody.kernels.helix import helix_series
from morphcore.simulate.control_motion import control_angles, deflections
from morphcore.simulate.kernels.flexible_step import (
    FLOWN,
    INVERSE_WANTED,
    MATRIX_WANTED,
    MAX_ITERATIONS,
    RECORD,
    STILL,
    Path,
    Rule,
    Scratch,
    State,
    Structure,
    fly_steps,
)
from morphcore.simulate.kernels.roots import (
    follow_fuselage,
    gather_root_matrices,
    gather_roots,
    spread_to_roots,
)
from morphcore.simulate.schedule import Schedule
from morphcore.simulate.time_grid import TimeGrid

Array = NDArray[np.float64]

# s; holds attitude within 1e-5 rad of the converged solution on the example flights, a tenth of what the
# best equivalent models are off (tests/simulate/test_flexible.py)
FLEXIBLE_STEP_S = 0.001
STILL_AIR = np.zeros(3)
SPECTRAL_RADIUS = 0.6  # at infinite frequency: stretching waves die out in about ten steps
START_TOLERANCE = 1e-9  # relative, of the accelerations at the start


@dataclass(frozen=True)
class HingePath:
    """Prescribed motion of all hinges along a time grid (k times, s surfaces).

    R_BW : (k, s, 3, 3); origin_B : (k, s, 3) root nodes, m. The twist of a root relative to the fuselage is
    ``axis rate`` in W: for one hinge its screw (k, s, 6) and its rate (k, s), for several their sum and 1;
    acceleration : (k, s, 6) its time derivative. angle : (k, h) of all hinges, rad. controls, deflection :
    (k, c) angles of all controls' drives, and their deflections, trailing edge down, rad.
    """

    R_BW: Array
    origin_B: Array
    axis: Array
    rate: Array
    acceleration: Array
    angle: Array
    controls: Array = field(default_factory=lambda: np.zeros((1, 0)))
    deflection: Array = field(default_factory=lambda: np.zeros((1, 0)))


def hinge_path(model: FlexibleModel, schedules: Sequence[Schedule], grid: TimeGrid) -> HingePath:
    """Motion of all hinges on a grid, with one schedule for each in the order of `Aircraft.moved_parts`.

    Accelerations are central differences of the rates over two steps: at a corner of a sampled rate, the
    impulse of the hinge keeps its size and its time.
    """
    times, h, aircraft = grid.times_s, grid.step_s, model.aircraft
    angle, rate, acceleration = np.zeros((3, times.size, len(aircraft.hinges)))
    for column, schedule in enumerate(schedules[: len(aircraft.hinges)]):
        motion = schedule.motion(times)
        late, early = schedule.motion(times + h).rate, schedule.motion(times - h).rate
        angle[:, column], rate[:, column] = motion.angle, motion.rate
        acceleration[:, column] = (late - early) / (2.0 * h)
        acceleration[0, column] = (late[0] - motion.rate[0]) / h  # the time before the flight does not enter
    parts = [
        _root_path(surface, angle[:, own], rate[:, own], acceleration[:, own])
        for surface, own in zip(aircraft.surfaces, aircraft.hinge_columns, strict=True)
    ]
    R_BW, origin_B, axis, rates, changes = (np.stack(column, axis=1) for column in zip(*parts, strict=True))
    controls = control_angles(aircraft, schedules, times)
    deflection = deflections(aircraft, controls)
    return HingePath(R_BW, origin_B, axis, rates, changes, angle, controls, deflection)


def _root_path(
    surface: Surface, angles: Array, rates: Array, accelerations: Array
) -> tuple[Array, Array, Array, Array, Array]:
    """Pose, axis, rate and acceleration of one surface's root, see ``HingePath``, from its hinges (k, m)."""
    arms, rest = surface.root_arms_B, surface.rest_R_BW
    R_BW, origin_B = hinged_pose(surface.hinges, arms, angles, rest)
    twist, change = relative_motion(surface.hinges, arms, angles, rates, accelerations, rest)
    if len(surface.hinges) == 1:
        return R_BW, origin_B, hinge_screws(surface.hinges, arms, angles, rest)[:, 0], rates[:, 0], change
    return R_BW, origin_B, twist, np.ones(angles.shape[0]), change


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
        # a lattice that slides is written to, so it is the flight's own
        whole = model
        begin = np.array([hinge.angle_rad for hinge in model.aircraft.hinges])
        model = model.at(begin)
        if model.compliances.size:
            model = replace(model, beams=replace(model.beams, stiffness=model.held(begin)))
        self._whole, self.model = whole, model
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
        self.sections = Sections(model.beams, model.element, model.fraction)
        self._v: Array = np.zeros((3, 6))
        self._m: Array = np.zeros((2, 6, 6))

    @property
    def slides(self) -> bool:
        """Whether the lattice slides along surfaces that telescope."""
        return any(surface.mouth_m is not None for surface in self.model.aircraft.surfaces)

    def slide(self, angles: Array) -> Array:
        """Seat the lattice as at angles (h,) of all hinges; return its times of lag (2, r), s."""
        if not self.slides:
            return self.model.riders.lag_time
        seated = self.model.at(angles)
        self.model.element[:], self.model.fraction[:] = seated.element, seated.fraction
        self.sections.series[:] = helix_series(seated.fraction)
        if self.model.compliances.size:
            self.model.beams.stiffness[:] = self._whole.held(angles)
        self.lattice.reseat(seated.lattice.table, seated.riders, seated.lattice.settings.core)
        return seated.riders.lag_time

    def follow(self, poses: NodePoses, V: Array, A: Array, path: HingePath, row: int) -> None:
        """Put the root nodes where fuselage and hinges say, in place."""
        follow_fuselage(
            self.model.roots, path.R_BW[row], path.origin_B[row], path.axis[row], path.rate[row],
            path.acceleration[row], poses.R, poses.x, V, A, self._v,
        )  # fmt: skip

    def structure(
        self, poses: NodePoses, V: Array, A: Array, wind_N: Array = STILL_AIR, beams: Beams | None = None
    ) -> Array:
        """Forces (n, 6) that structure, inertia, apparent mass and weight require at the nodes.

        ``beams``: others than the model's, on the same nodes.
        """
        out = node_forces(beams or self.model.beams, self.work, poses, V, A, self.gravity_N)
        apparent_forces(self.model.apparent, poses.R, V, A, wind_N, self.work.v, out)
        return out

    def factor(self, of_rate: float = 0.0, of_pose: float = 0.0) -> None:
        """Factor the iteration matrix of the twist rates at the strains of the last `structure`."""
        apparent = self.model.apparent
        factor(self.model.beams, self.work, 1.0, of_rate, of_pose, apparent if apparent.size else None)

    def place_lattice(self, poses: NodePoses, wind_N: Array, V: Array) -> None:
        """Put sections and lattice on the deformed wings, at the strains of the last `structure`."""
        found = self.sections.place(self.work, poses)
        R_NB, x_N = poses.R[0], poses.x[0]
        self.lattice.place(R_NB.T @ found.R, (found.x - x_N) @ R_NB, wind_N @ R_NB - V[0, 3:])

    def subtract_air(self, acting: Array, twists: Array, wind_B: Array, right: Array) -> None:
        """Subtract the air's forces from the required forces (n, 6) of the nodes."""
        self.sections.subtract(self.lattice.section_forces(acting, twists, wind_B), right)

    def structure_arrays(self) -> Structure:
        """Beams, sections and scratch as the kernels take them."""
        model, beams, work, sections = self.model, self.model.beams, self.work, self.sections
        return Structure(
            ends=beams.ends,
            rest=beams.rest,
            stiffness=beams.stiffness,
            damping=beams.damping,
            mass=beams.mass,
            bodies=beams.bodies,
            inertia=beams.inertia,
            apparent=model.apparent,
            gauss=GAUSS,
            gauss_series=GAUSS_SERIES,
            roots=model.roots,
            tips=model.tips,
            gravity_N=self.gravity_N,
            thrust=self.thrust,
            section_element=model.element,
            section_fraction=model.fraction,
            section_series=sections.series,
            section_blocks=sections.blocks,
            strains=work.strains,
            rates=work.rates,
            tangents=work.tangents,
            inverses=work.inverses,
            couplings=work.couplings,
            diagonals=work.diagonals,
            v=work.v,
            m=work.m,
            poses=work.poses,
        )

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
        """Weight of the previous algorithmic acceleration."""
        return (2.0 * self.spectral_radius - 1.0) / (self.spectral_radius + 1.0)

    @property
    def alpha_f(self) -> float:
        """Weight of the previous true acceleration."""
        return self.spectral_radius / (self.spectral_radius + 1.0)

    @property
    def gamma(self) -> float:
        """Newmark's gamma for second order."""
        return 0.5 + self.alpha_f - self.alpha_m

    @property
    def beta(self) -> float:
        """Newmark's beta."""
        return 0.25 * (self.gamma + 0.5) ** 2

    def coefficients(self, lag_time: Array, still: float = STILL) -> Rule:
        """As the kernels take them.

        lag_time : (2, r) s. still : tolerance of the induced velocities, 0 for exact.
        """
        h = self.step_s
        share = (1.0 - self.alpha_f) / (1.0 - self.alpha_m)
        z = h / lag_time
        return Rule(
            step_s=h,
            gamma=self.gamma,
            beta=self.beta,
            of_new=share,
            of_old=self.alpha_f / (1.0 - self.alpha_m),
            of_average=self.alpha_m / (1.0 - self.alpha_m),
            of_rate=share * h * self.gamma,
            of_pose=share * h * h * self.beta,
            still=still,
            decay=np.exp(-z),
            mean=-np.expm1(-z) / z,
        )


class FlexibleRun:
    """A flight in progress: its state, advanced step by step by `kernels.flexible_step`.

    Parameters
    ----------
    wind_N : (steps + 1, 3) at the grid's times, m/s. state : at the first of them. gusts : (steps + 1, 6 t)
    of all strips (`gust_table.GustTable`); None without.

    Attributes
    ----------
    records : (steps + 1, RECORD + 2 s) of the steps flown, `kernels.flexible_step`; three more if
    sections stall. row : the last one.
    """

    def __init__(
        self,
        flight: FlexibleFlight,
        path: HingePath,
        grid: TimeGrid,
        wind_N: Array,
        state: FlexibleState,
        gusts: Array | None = None,
    ) -> None:
        model, rule = flight.model, Stepper(grid.step_s)
        self.grid, self.row = grid, 0
        self._flight, self._angles = flight, path.angle
        self._structure = flight.structure_arrays()
        self._path = Path(
            R_BW=path.R_BW,
            origin_B=path.origin_B,
            axis=path.axis,
            rate=path.rate,
            acceleration=path.acceleration,
            wind_N=np.array(wind_N, dtype=np.float64),
            deflection=path.deflection,
            gusts=np.zeros((grid.steps + 1, 0)) if gusts is None else gusts,
        )
        self._rule = rule.coefficients(model.riders.lag_time)
        self._state, self._trial = _state_arrays(state), _state_arrays(state)
        sections, rings = model.element.size, state.circulation.size
        self._scratch = Scratch(
            R_NS=np.zeros((sections, 3, 3)),
            x_N=np.zeros((sections, 3)),
            twists=np.zeros((sections, 6)),
            forces=np.zeros((sections, 6)),
            right=np.zeros((model.beams.nodes, 6)),
            blocked=np.zeros(rings),
            residual=np.zeros(rings),
            acting=np.zeros(rings),
            inverse=np.zeros((rings, rings)),  # none yet: the first step requests one
            small=np.zeros((2, 6, 6)),
            pace=np.zeros(1),
            turn=np.zeros((7, 3)),
            vector=np.zeros((3, 6)),
            stall=np.zeros(3),
        )
        stalls = 3 * int(flight.lattice.parts.limits.size > 0)
        self.records: Array = np.zeros((grid.steps + 1, RECORD + 2 * model.roots.size + stalls))
        flight.structure(state.poses, state.V, state.A)
        self._form_matrix()

    @property
    def state(self) -> FlexibleState:
        """The state at the last row, which the next step overwrites."""
        now = self._state
        return FlexibleState(NodePoses(now.R, now.x), now.V, now.A, now.a, now.lag, now.circulation)

    def fly_to(self, row: int) -> None:
        """Continue the flight to a row of the grid.

        Raises
        ------
        FlightDiverged : the flight leaves the model's domain.
        """
        inverted = -1
        while self.row < row:
            end = row
            if self._flight.slides:
                end = self.row + 1
                seated = Stepper(self.grid.step_s).coefficients(self._flight.slide(self._angles[end]))
                self._rule.decay[:], self._rule.mean[:] = seated.decay, seated.mean
            self.row, status = fly_steps(
                self._structure, self._flight.lattice.parts, self._flight.lattice.at, self._path, self._rule,
                self._state, self._trial, self._scratch, self.records, self.row, end,
                self._formed == self.row,
            )  # fmt: skip
            if status == MATRIX_WANTED:
                self._form_matrix()
            elif status == INVERSE_WANTED and inverted != self.row and self._renew_inverse():
                inverted = self.row
            elif status != FLOWN:
                raise FlightDiverged(time_s=float(self.grid.times_s[self.row]))

    def _form_matrix(self) -> None:
        """Factor the iteration matrix at the strains of the last `structure`."""
        self._flight.factor(self._rule.of_rate, self._rule.of_pose)
        self._formed = self.row

    def _renew_inverse(self) -> bool:
        """Invert the influence at the lattice's present place; False if it is singular."""
        matrix = self._flight.lattice.at.influence[:-1]
        if not np.isfinite(matrix).all():
            return False
        try:
            self._scratch.inverse[:] = np.linalg.inv(matrix)
        except np.linalg.LinAlgError:
            return False
        return True


def _state_arrays(state: FlexibleState) -> State:
    """A copy of a state, as arrays that the kernels advance."""
    return State(
        R=state.poses.R.copy(),
        x=state.poses.x.copy(),
        V=state.V.copy(),
        A=state.A.copy(),
        a=state.a.copy(),
        A_before=state.A.copy(),
        lag=state.lag.copy(),
        circulation=state.circulation.copy(),
    )


def set_in_motion(
    flight: FlexibleFlight, path: HingePath, wind_N: Array, state: FlexibleState
) -> FlexibleState:
    """A trimmed state with hinges moving as at the start of the path, the wings turning rigidly with them.

    Accelerations are those that the forces then require. A path that starts at rest changes nothing.
    """
    if not ((path.axis[0] * path.rate[0, :, None]).any() or path.acceleration[0].any()):
        return state
    model, poses = flight.model, state.poses
    V, A = state.V.copy(), np.zeros_like(state.A)
    flight.follow(poses, V, A, path, 0)
    for root, tip in zip(model.roots, model.tips, strict=True):
        wing = slice(root, tip + 1)
        V[wing] = carried(poses, root, V[root], wing)
    circulation = state.circulation
    flight.slide(path.angle[0])
    flight.lattice.deflect(path.deflection[0])
    for iteration in range(MAX_ITERATIONS):
        flight.follow(poses, V, A, path, 0)
        demands = flight.structure(poses, V, A, wind_N)
        if iteration == 0:
            flight.place_lattice(poses, wind_N, V)
        twists = flight.sections.twists(V)
        wind_B = wind_N @ poses.R[0]
        circulation = flight.lattice.circulation(twists, wind_B)
        flight.subtract_air(acting_circulation(circulation, state.lag), twists, wind_B, demands)
        demands[0] -= flight.thrust
        flight.factor()
        change = flight.solve(-demands, path, 0)
        A += change
        if np.abs(change).max() < START_TOLERANCE * max(1.0, float(np.abs(A).max())):
            break
    flight.follow(poses, V, A, path, 0)
    return FlexibleState(poses, V, A, A.copy(), state.lag, circulation)
