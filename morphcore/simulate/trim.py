"""Trim: steady flight with the wings in static aeroelastic equilibrium, in batches."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from morphcore.errors import InvalidInput, TrimNotFound
from morphcore.frames import quaternion_from_euler
from morphcore.geometry.aircraft import Flight, Start
from morphcore.geometry.propulsion import thrust_force_B, thrust_moment_B
from morphcore.models.equivalent import (
    ChainModel,
    LaneConstants,
    ParameterBatch,
    from_lanes,
    lane_constants,
    to_lanes,
)
from morphcore.models.kernels.layout import FORCE_C, JOINTS, OMEGA, VELOCITY
from morphcore.models.kinematics import link_poses
from morphcore.models.slopes import sloped_motion, sloped_turn
from morphcore.shown import Shown
from morphcore.simulate.batch import initial_state, state_rates
from morphcore.simulate.steady import air_velocity_B, described, first_bank, pitch, rates_B
from morphcore.simulate.trim_limits import chain_limit

if TYPE_CHECKING:  # a plan is made for a trim (see wake.py)
    from morphcore.simulate.plan import FlightPlan

Array = NDArray[np.float64]
StartMode = Literal["trim", "given"]

MAX_ITERATIONS = 25
FULL_STEPS = 2  # Newton steps that compute a Jacobian; later ones reuse it
ANGLE_TOLERANCE = 1e-11  # rad, limit of the last Newton step in angle of attack and joint angles
ANGLE_PROBE = 1e-6  # rad; balances truncation and round-off of a forward difference in double precision
FORCE_PROBE = 1.0  # N and N m; these enter linearly
LARGEST_STEP = 0.2  # rad in one Newton step: beyond that the linear model is meaningless
# shares of the joints' flexibility by which a trim that is not found at once is followed from stiff joints
SHARES = (0.01, 0.03, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
SLAB = 256  # particles at a time; bounds the memory of the Jacobian's probes


@dataclass(frozen=True, repr=False)
class Trim(Shown):
    """A start of flight for each parameter set p.

    alpha : (p,) rad; force_B : (p, 3) N and moment_B : (p, 3) N m, constant in flight, in B at the reference
    point;
    q_joint : (p, coordinates) rad; converged : (p,) whether Newton's iteration arrived; residual : (p,) the
    last step, rad; thrust_moment_B : (p, 3) N m, moment of the thrust about the reference point by the
    aircraft's line of thrust; moment_B acts beyond it; share : (p,) of the joints' flexibility up to which
    the equilibrium was followed. Without a trim, angles are those at that share, or where the iteration ended
    if that is none. bank : (p,) rad, roll angle.
    """

    alpha: Array
    force_B: Array
    moment_B: Array
    q_joint: Array
    converged: NDArray[np.bool_]
    residual: Array
    thrust_moment_B: Array
    share: Array = field(default_factory=lambda: np.ones(1))
    bank: Array = field(default_factory=lambda: np.zeros(1))

    @property
    def acting_B(self) -> tuple[Array, Array]:
        """Constant force (p, 3), N, and all of the constant moment (p, 3), N m, about the reference point."""
        return self.force_B, self.moment_B + self.thrust_moment_B

    def require(self, flight: Flight | None = None) -> Trim:
        """Return itself if every parameter set is trimmed; otherwise raise TrimNotFound.

        flight : whose steady flight the error names; None: level flight.
        """
        if not np.all(self.converged):
            lost = int(np.argmin(self.converged))
            limit = chain_limit(
                float(self.share[lost]), float(self.alpha[lost]), self.q_joint[lost], float(self.bank[lost])
            )
            raise TrimNotFound(
                residual=float(self.residual[lost]),
                iterations=MAX_ITERATIONS,
                limit=limit.found,
                hint=limit.hint,
                flight="level flight" if flight is None else described(flight),
            )
        return self


def trim(
    model: ChainModel,
    batch: ParameterBatch,
    plan: FlightPlan,
    *,
    start: StartMode = "trim",
    follow: bool = True,
) -> Trim:
    """Find the equilibrium at the plan's first hinge angles, with the hinges held.

    With ``start="trim"`` the unknowns are the angle of attack, a constant force along the flight path (in the
    plane of symmetry) and across it, a constant moment, and the joint angles: the aircraft then flies as its
    flight says, straight and level by default. In asymmetric flight no force acts across the path: the bank
    angle is unknown instead. If the aircraft has a line of thrust, the force along the path is a thrust along
    it instead. With
    ``"given"`` angle of attack, force and moment are those of the flight's start and only the joints settle
    (their accelerations vanish). Where Newton's method from straight joints does not arrive, the equilibrium
    is followed from stiff joints to their own stiffness, unless ``follow`` is False.

    Raises
    ------
    InvalidInput : ``start="given"`` and the flight has none.
    """
    if start == "given" and model.flight.start is None:
        raise InvalidInput(
            'start = "given", but the flight has no field `start`',
            pointer="/flight/start",
            hint="add start with alpha_rad, force_b_n and moment_b_n_m, or choose start = trim",
        )
    held = plan.at_rest()
    parts = [
        _trim_slab(model, batch.select(slice(i, i + SLAB)), held, start)
        for i in range(0, batch.particles, SLAB)
    ]
    found = Trim(
        *(np.concatenate([getattr(part, name) for part in parts]) for name in Trim.__dataclass_fields__)
    )
    lost = np.flatnonzero(~found.converged)
    for i in range(0, lost.size if model.coordinates and follow else 0, SLAB):
        _follow(model, batch, held, start, (found, lost[i : i + SLAB]))
    return found


def _follow(
    model: ChainModel,
    batch: ParameterBatch,
    held: FlightPlan,
    start: StartMode,
    lost: tuple[Trim, NDArray[np.int64]],
) -> None:
    """Follow the equilibrium of particles without a trim from stiff joints to their own, in place.

    A particle is followed as far as Newton's iteration arrives, each time from the straight line through its
    last two equilibria.
    """
    found, left = lost
    n = model.coordinates
    before, last = np.zeros((left.size, n + 1)), None
    shares = (0.0, *SHARES)
    for k in range(1, len(shares)):
        softer = batch.select(left)
        softer = softer.changed(stiffness_nm_rad=softer["stiffness_nm_rad"] / shares[k])
        begin = before
        if last is not None:
            ratio = (shares[k] - shares[k - 1]) / (shares[k - 1] - shares[k - 2])
            begin = last + ratio * (last - before)
        part = _trim_slab(model, softer, held, start, begin)
        ok = part.converged
        arrived = left[ok]
        at_end = k == len(shares) - 1
        for name in set(Trim.__dataclass_fields__) - (set() if at_end else {"converged", "residual"}):
            getattr(found, name)[arrived] = getattr(part, name)[ok]
        found.share[arrived] = shares[k]
        left = arrived
        if left.size == 0:
            return
        now = np.concatenate([part.q_joint, part.alpha[:, None]], axis=1)[ok]
        before, last = now if last is None else last[ok], now


def trimmed_state(
    model: ChainModel, batch: ParameterBatch, plan: FlightPlan, found: Trim, psi: float = 0.0
) -> Array:
    """State rows (p, state_rows) of the trimmed start, heading ``psi``, at the origin of N."""
    return _state(model, batch, plan, (found.alpha, found.bank), found.q_joint, psi)


def _state(
    model: ChainModel,
    batch: ParameterBatch,
    plan: FlightPlan,
    angles: tuple[Array, Array],
    q_joint: Array,
    psi: float = 0.0,
) -> Array:
    """The state of steady flight at angles of attack and bank angles, each (p,)."""
    (alpha, bank), flight = angles, model.flight
    theta = pitch(flight, alpha, bank)
    air_B, omega_B = air_velocity_B(flight, alpha), rates_B(flight, theta, bank)
    quaternion = quaternion_from_euler(bank, theta, np.zeros_like(alpha) + psi)
    # steady relative to the air: the wind carries the aircraft along
    wind_B = _to_body(quaternion, plan.wind_N[0])
    R_BL, r_B = link_poses(model, batch, plan.hinges[0], q_joint)
    if flight.rotates:
        lag_motion = sloped_turn(model, batch, (R_BL, r_B), air_B, omega_B)
    else:
        lag_motion = sloped_motion(model, batch, R_BL, air_B)
    return initial_state(
        quaternion=quaternion,
        omega_B=omega_B,
        velocity_B=air_B + wind_B,
        q_joint=q_joint,
        lag_motion=lag_motion,
    )


def _to_body(quaternion: Array, vector_N: Array) -> Array:
    w, xyz = quaternion[:, :1], -quaternion[:, 1:]
    cross = 2.0 * np.cross(xyz, vector_N)
    return np.asarray(vector_N + w * cross + np.cross(xyz, cross))


@dataclass(frozen=True)
class _Unknowns:
    """What the columns of the unknowns (..., coordinates + 6) of an iteration mean.

    Joint angles, angle of attack, force along and across the flight path (across it the bank angle instead
    where the flight banks), moment. From a given start only the joint angles are free.
    """

    model: ChainModel
    given: Start | None

    @property
    def banked(self) -> bool:
        """Whether the bank angle is one of them."""
        return self.model.flight.banks and self.given is None

    @property
    def free(self) -> int:
        """How many of them, the first ones, are unknown."""
        return self.model.coordinates + (0 if self.given else 6)

    @property
    def angles(self) -> list[int]:
        """Those whose steps are limited and end the iteration, among the free ones."""
        n = self.model.coordinates
        return [*range(min(n + 1, self.free)), *([n + 2] if self.banked else [])]

    @property
    def probes(self) -> Array:
        """Steps (free,) of forward differences."""
        n, probes = self.model.coordinates, np.full(self.free, ANGLE_PROBE)
        probes[n + 1 :] = FORCE_PROBE
        if self.banked:
            probes[n + 2] = ANGLE_PROBE
        return probes

    def first(self, particles: int, begin: Array | None) -> Array:
        """Where the iteration begins, (particles, coordinates + 6)."""
        n, x = self.model.coordinates, np.zeros((particles, self.model.coordinates + 6))
        if begin is not None:
            x[:, : n + 1] = begin
        if self.given is not None:
            x[:, n], x[:, n + 2] = self.given.alpha_rad, self.given.bank_rad
        elif self.banked:
            x[:, n + 2] = first_bank(self.model.flight)
        return x

    def bank(self, points: Array) -> Array:
        """Bank angle (k,) of each row, rad; zero where the flight does not bank."""
        banks = self.banked or self.given is not None
        return points[:, self.model.coordinates + 2] if banks else np.zeros(points.shape[0])

    def thrust(self, points: Array) -> tuple[Array, Array]:
        """Constant force in B, and moment beyond that of the thrust, (k, 3) each, of each row."""
        n, given = self.model.coordinates, self.given
        if given is not None:
            count = points.shape[0]
            return np.tile(given.force_B, (count, 1)), np.tile(given.moment_B, (count, 1))
        alpha, along = points[:, n], points[:, n + 1]
        across = np.zeros_like(along) if self.banked else points[:, n + 2]
        return thrust_force_B(self.model.aircraft.propulsion, alpha, along, across), points[:, n + 3 : n + 6]

    def acting(self, points: Array) -> Array:
        """Constant force and all of the constant moment (k, 6) in B of each row."""
        force_B, moment_B = self.thrust(points)
        of_thrust_B = thrust_moment_B(self.model.aircraft.propulsion, force_B)
        return np.concatenate([force_B, moment_B + of_thrust_B], axis=1)


def _trim_slab(
    model: ChainModel, batch: ParameterBatch, plan: FlightPlan, start: StartMode, begin: Array | None = None
) -> Trim:
    """Newton's iteration from joint angles and angle of attack, ``begin`` (p, coordinates + 1), or zero."""
    n, particles, flight = model.coordinates, batch.particles, model.flight
    given = flight.start if start == "given" else None
    unknowns = _Unknowns(model, given)
    free, probes = unknowns.free, unknowns.probes
    x = unknowns.first(particles, begin)
    constants = lane_constants(model, batch, plan.grid.step_s)
    everywhere = np.stack([model.surfaces[:, 3] * 0, model.surfaces[:, 3]], axis=1).repeat(
        model.surfaces[:, 1], axis=0
    )
    rows = from_lanes(constants.rows, particles)
    moved = np.zeros((free + 1, n + 6))
    moved[1:, :free] = np.diag(probes)

    def unbalance(points: Array) -> Array:
        """Imbalance (particles, k, free) that must vanish, at points (particles, k, n + 6)."""
        repeated = np.repeat(np.arange(particles), points.shape[1])
        flat = points.reshape(-1, n + 6)
        lane_rows = rows[repeated]
        lane_rows[:, FORCE_C : FORCE_C + 6] = unknowns.acting(flat)
        blocks = to_lanes(lane_rows)
        lanes = LaneConstants(blocks, np.tile(everywhere, (blocks.shape[0], 1, 1)), flat.shape[0])
        at = flat[:, n], unknowns.bank(flat)
        state = _state(model, batch.select(repeated), plan, at, flat[:, :n])
        rates = state_rates(model, plan, 0, lanes, state)
        if flight.rotates:  # steady relative to the air: the wind's components turn in B
            wind_B = _to_body(state[:, :OMEGA], plan.wind_N[0])
            rates[:, VELOCITY : VELOCITY + 3] += np.cross(state[:, OMEGA:VELOCITY], wind_B)
        joints = rates[:, JOINTS + n : JOINTS + 2 * n]
        wanted = joints if given else np.concatenate([joints, rates[:, OMEGA : OMEGA + 6]], axis=1)
        return wanted.reshape(particles, -1, free)

    residual = np.full(particles, np.inf if free else 0.0)
    moving = np.ones(particles, dtype=np.bool_)
    jacobian = np.empty((particles, free, free))
    for iteration in range(MAX_ITERATIONS if free else 0):
        if iteration < FULL_STEPS or iteration % 5 == 0:
            probed = unbalance(x[:, None, :] + moved)
            jacobian = ((probed[:, 1:] - probed[:, :1]) / probes[:, None]).transpose(0, 2, 1)
            off = probed[:, 0]
        # near the solution the Jacobian hardly changes, and it costs one evaluation per unknown
        else:
            off = unbalance(x[:, None, :])[:, 0]
        step = _solve(jacobian, -off)
        angles = np.abs(step[:, unknowns.angles]).max(axis=1)
        step *= np.minimum(1.0, LARGEST_STEP / np.maximum(angles, 1e-300))[:, None]
        # each particle stops on its own: its trim must not depend on the others in its slab
        x[moving, :free] += np.where(np.isfinite(step), step, 0.0)[moving]
        residual[moving] = np.where(np.isfinite(angles), angles, np.inf)[moving]
        moving &= (residual >= ANGLE_TOLERANCE) & np.isfinite(residual)
        if not np.any(moving):
            break
    force_B, moment_B = unknowns.thrust(x)
    # forward differences limit the last digits: nearly converged is good enough
    converged = residual < 1e3 * ANGLE_TOLERANCE
    of_thrust_B = thrust_moment_B(model.aircraft.propulsion, force_B)
    share, bank = converged.astype(np.float64), unknowns.bank(x)
    return Trim(x[:, n], force_B, moment_B, x[:, :n], converged, residual, of_thrust_B, share, bank)


def _solve(jacobian: Array, right: Array) -> Array:
    finite = np.all(np.isfinite(jacobian), axis=(1, 2))
    safe = np.where(finite[:, None, None], jacobian, np.eye(jacobian.shape[1]))
    try:
        step = np.linalg.solve(safe, right[..., None])[..., 0]
    except np.linalg.LinAlgError:  # one singular matrix among many: the others keep their own solution
        step = np.stack([_solve_one(*pair) for pair in zip(safe, right, strict=True)])
    return np.where(finite[:, None], step, np.nan)


def _solve_one(matrix: Array, right: Array) -> Array:
    try:
        return np.asarray(np.linalg.solve(matrix, right))
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.pinv(matrix) @ right)
