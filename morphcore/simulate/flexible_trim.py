"""Static aeroelastic trim of the flexible model: steady flight with bent wings in equilibrium."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.stall import record_of, stalls
from morphcore.errors import InvalidInput, TrimNotFound
from morphcore.frames import quaternion_from_euler, rotation_from_quaternion
from morphcore.geometry.propulsion import thrust_direction_B, thrust_moment_B
from morphcore.multibody.beam import BeamTurnedTooFar, NodePoses, carried
from morphcore.multibody.strain_poses import StrainPoses
from morphcore.simulate.continuation import Continued, Root, Rules, continue_root, find_root
from morphcore.simulate.flexible import FlexibleFlight, FlexibleState, HingePath
from morphcore.simulate.steady import air_velocity_B, described, first_bank, pitch, rates_B
from morphcore.simulate.trim import StartMode
from morphcore.simulate.trim_limits import STALL_RAD, Limit, is_sound, lost, no_lift, stalled

Array = NDArray[np.float64]

TOLERANCE = 1e-11  # rad and m, of the strains' and the angle's remaining imbalance
ACCEPTED = 1e-7  # rounding may leave more than the tolerance; this is far below what a flight shows
LONGEST_TURN = 0.3  # rad of an element or of the angle of attack, in one step of Newton's method
LIFT_SLOPE = 2.0 * np.pi  # 1/rad: scales the balance of lift and weight to an angle


@dataclass(frozen=True)
class FlexibleTrim:
    """A start: angle of attack (rad), constant force (N) and moment (N m) in B, and the state.

    residual : the remaining imbalance as a displacement, rad and m. thrust_moment_B, bank : as in
    `simulate.trim.Trim`.
    """

    alpha: float
    force_B: Array
    moment_B: Array
    state: FlexibleState
    residual: float
    thrust_moment_B: Array
    bank: float = 0.0


class _Balance:
    """The equations of trim: imbalance of all elements' strains and, in free trim, of lift and weight.

    Unknowns are the changes of the elements' logarithms d (e, 6) from those at rest, the angle of attack and,
    in asymmetric flight, the bank angle, which balances the forces along y of B. An element is in balance if
    they are its flexibility times the loads on d.
    """

    def __init__(self, flight: FlexibleFlight, path: HingePath, wind_N: Array, start: StartMode) -> None:
        self.flight, self.path, self.wind_N = flight, path, wind_N
        model = flight.model
        self.given = model.flight.start if start == "given" else None
        self.banked = model.flight.banks and self.given is None
        self.area = sum(surface.area_m2 for surface in model.aircraft.surfaces)
        first = np.zeros((model.beams.nodes, 6))
        self.unbent = NodePoses(np.tile(np.eye(3), (model.beams.nodes, 1, 1)), model.rest_W.copy())
        flight.follow(self.unbent, first, first.copy(), path, 0)
        flight.slide(path.angle[0])
        flight.lattice.deflect(path.deflection[0])
        self.chains = StrainPoses(model.beams, model.roots, model.tips)
        # without stiffness the nodes' forces are those of inertia and weight alone: the strains' own do not
        # cancel in the sums over whole wings
        loose = np.zeros_like(model.beams.stiffness)
        loose.setflags(write=False)
        self.loose = replace(model.beams, stiffness=loose)
        self.flexibility = np.linalg.inv(model.beams.stiffness)
        at_rest = self.unbent.copy()
        self.chains.place(model.beams.rest, at_rest)
        still = self.loads(at_rest, first, first)
        self.weight_n = float(np.linalg.norm(self.total(at_rest, still)[3:]))

    @property
    def unknowns(self) -> int:
        """Number of unknowns."""
        return self.flight.model.beams.rest.size + (0 if self.given else 1 + self.banked)

    @property
    def begin(self) -> Array:
        """Unknowns (n,) of unbent wings."""
        x = np.zeros(self.unknowns)
        if self.banked:
            x[-1] = first_bank(self.flight.model.flight)
        return x

    def angles(self, x: Array) -> tuple[float, float]:
        """Angle of attack and bank angle of unknowns (n,), rad."""
        if self.given is not None:
            return self.given.alpha_rad, self.given.bank_rad
        count = self.flight.model.beams.rest.size
        return float(x[count]), float(x[count + 1]) if self.banked else 0.0

    def loads(self, poses: NodePoses, V: Array, A: Array) -> Array:
        """Forces (n, 6) that inertia and weight require at the nodes."""
        return self.flight.structure(poses, V, A, self.wind_N, beams=self.loose)

    def longest(self, step: Array) -> float:
        """Share of a step of the unknowns that may be taken at once."""
        count = self.flight.model.beams.rest.size
        turns = np.abs(step[:count].reshape(-1, 6)[:, :3]).max(initial=0.0)
        turn = max(float(turns), float(np.abs(step[count:]).max(initial=0.0)))
        return min(1.0, LONGEST_TURN / max(turn, 1e-300))

    def _inertia(self, poses: NodePoses, at_rest: Array) -> Array:
        """Spatial inertia (6, 6) of the whole aircraft in this shape about the reference point.

        From the forces (n, 6) required at the nodes for unit accelerations, less those ``at_rest``.
        """
        zero, columns = np.zeros_like(at_rest), []
        for unit_B in np.eye(6):
            demands = self.loads(poses, zero, self._rigid(poses, unit_B))
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
        """The state for given unknowns, and the nodal forces that it requires besides the strains'."""
        flight, count = self.flight, self.flight.model.beams.rest.size
        steady, (alpha, bank) = flight.model.flight, (np.array(angle) for angle in self.angles(x))
        theta = pitch(steady, alpha, bank)
        R_NB = rotation_from_quaternion(quaternion_from_euler(bank, theta, 0.0))
        wind_B = self.wind_N @ R_NB
        V_B, A_B = np.zeros((2, 6))
        V_B[:3], V_B[3:] = rates_B(steady, theta, bank), air_velocity_B(steady, alpha) + wind_B
        # steady relative to the air: the wind's components turn in B
        A_B[3:] = -np.cross(V_B[:3], wind_B)
        poses = self.unbent.copy()
        self.chains.place(flight.model.beams.rest + x[:count].reshape(-1, 6), poses)
        poses.R, poses.x = np.ascontiguousarray(R_NB @ poses.R), poses.x @ R_NB.T
        V = self._rigid(poses, V_B)
        A = self._rigid(poses, A_B)
        demands = self.loads(poses, V, A)
        flight.place_lattice(poses, self.wind_N, V)
        twists = flight.sections.twists(V)
        circulation = flight.lattice.circulation(twists, wind_B)
        flight.subtract_air(circulation, twists, wind_B, demands)
        if self.given is not None:
            # the wings move with the fuselage as one: its acceleration follows from the sum of all forces
            at_rest = self.loads(poses, np.zeros_like(V), np.zeros_like(V))
            propulsion = flight.model.aircraft.propulsion
            acting_B = self.given.moment_B + thrust_moment_B(propulsion, self.given.force_B)
            thrust = np.concatenate([acting_B, self.given.force_B])
            defect, steady_A = thrust - self.total(poses, demands), A
            change_B = np.asarray(np.linalg.solve(self._inertia(poses, at_rest), defect))
            A = self._rigid(poses, A_B + change_B)
            demands += self.loads(poses, V, A) - self.loads(poses, V, steady_A)
        lag = np.stack([circulation, circulation])
        return FlexibleState(poses, V, A, A.copy(), lag, circulation), demands

    def lift_coefficients(self, alpha: float) -> tuple[float, float]:
        """Mean lift coefficient that the weight needs, and the unbent wings' at an angle of attack, rad."""
        x = self.begin
        x[self.flight.model.beams.rest.size] = alpha
        state, demands = self.state(x)
        weight = self.loads(state.poses, state.V, state.A)
        scale = self.flight.model.flight.dynamic_pressure_pa * self.area
        needed, missing = (
            float(np.array([np.sin(alpha), 0.0, -np.cos(alpha)]) @ self.total(state.poses, forces)[3:])
            / scale
            for forces in (weight, demands)
        )
        return needed, needed - missing

    def imbalance(self, x: Array, share: float = 1.0) -> Array:
        """Imbalance (n,) of the unknowns x (n,), rad and m, with ``share`` of the wings' flexibility.

        Not finite where an element is bent beyond the range of its logarithm.
        """
        model = self.flight.model
        try:
            state, demands = self.state(x)
        except BeamTurnedTooFar:
            return np.full(x.size, np.nan)
        count = model.beams.rest.size
        change = x[:count].reshape(-1, 6)
        required = self.chains.conjugate(model.beams.rest + change, state.poses, demands)
        strained = change + share * (self.flexibility @ required[..., None])[..., 0]
        if self.given is not None:
            return strained.ravel()
        line_B = thrust_direction_B(model.aircraft.propulsion, x[count])
        scale = model.flight.dynamic_pressure_pa * self.area * LIFT_SLOPE
        total = self.total(state.poses, demands)
        normal = -line_B[2] * total[3] + line_B[0] * total[5]
        if not self.banked:
            return np.append(strained, normal / scale)
        # banked further, the aircraft needs less force to the right
        return np.append(strained, [normal / scale, -total[4] / self.weight_n])


def trim_flexible(
    flight: FlexibleFlight, path: HingePath, wind_N: Array, *, start: StartMode = "trim"
) -> FlexibleTrim:
    """Equilibrium at the path's first hinge angles, as `simulate.trim.trim` defines it.

    Unknowns are the strains of all elements, the angle of attack and perhaps the bank angle; thrust along the
    flight path, side force and moment follow. With ``start="given"`` they are the flight's, the unknowns are
    the strains, and the wings share the fuselage's acceleration, which follows from the sum of all forces.
    Newton's method with Krylov steps (`simulate.continuation`) from unbent wings; if it does not arrive
    straight away, the equilibrium is followed from rigid wings to the wings' own stiffness.

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
    root = _attached(balance)
    state, demands = balance.state(root.x)
    given, propulsion = balance.given, flight.model.aircraft.propulsion
    if given is not None:
        of_thrust_B = thrust_moment_B(propulsion, given.force_B)
        at = given.alpha_rad, given.force_B, given.moment_B
        return FlexibleTrim(*at, state, root.size, of_thrust_B, given.bank_rad)
    (alpha, bank), total = balance.angles(root.x), balance.total(state.poses, demands)
    of_thrust_B = thrust_moment_B(propulsion, total[3:])
    moment_B = total[:3] - of_thrust_B
    return FlexibleTrim(alpha, total[3:].copy(), moment_B, state, root.size, of_thrust_B, bank)


def _attached(balance: _Balance) -> Root:
    """The equilibrium, in which no section may stall unless the start is given.

    Where sections stall, there may be none. Then it is sought without their limits, to state the lift
    coefficient that it would need.
    """
    flight, model = balance.flight, balance.flight.model
    lattice, surfaces = flight.lattice, model.aircraft.surfaces
    with np.errstate(over="ignore", invalid="ignore"):
        if balance.given is not None or not stalls(surfaces):
            return _equilibrium(balance)
        parts, failure = lattice.parts, None
        try:
            root = _equilibrium(balance)
        except TrimNotFound as error:
            failure = error
            lattice.parts = parts._replace(limits=np.zeros((0, 2)))
            try:
                root = _equilibrium(balance)
            except TrimNotFound:
                raise failure from None
            finally:
                lattice.parts = parts
        state, _ = balance.state(root.x)
        twists, wind_B = flight.sections.twists(state.V), balance.wind_N @ state.poses.R[0]
        _, (ratio, strip, upper) = lattice.limited(state.circulation, twists, wind_B)
    if ratio > 1.0:
        at, lattices = np.array([int(strip)]), model.lattice.lattices
        record = record_of(np.array([ratio]), at, np.array([upper > 0.0]), surfaces, lattices)
        limit = stalled(*record.worst(0), model.flight.airspeed_m_s)
        raise TrimNotFound(
            residual=0.0, iterations=0, limit=limit.found, hint=limit.hint, flight=described(model.flight)
        )
    if failure is not None:
        raise failure
    return root


def _equilibrium(balance: _Balance) -> Root:
    """The equilibrium on the branch that begins with rigid wings."""
    begin = balance.begin
    rules = Rules(TOLERANCE, ACCEPTED, balance.longest)
    root = find_root(balance.imbalance, begin, rules)
    if root.straight:
        return root

    found = continue_root(balance.imbalance, begin, rules)
    if not found.arrived:
        limit = _limit(balance, found)
        left = float(np.abs(balance.imbalance(found.root.x)).max())
        raise TrimNotFound(
            residual=left if np.isfinite(left) else float("inf"),
            iterations=found.solves,
            limit=limit.found,
            hint=limit.hint,
            flight=described(balance.flight.model.flight),
        )
    return found.root


def _limit(balance: _Balance, found: Continued) -> Limit:
    """What limits a trim that ended on the way from rigid wings."""
    model = balance.flight.model
    if not found.root.arrived:
        steady, coefficients = model.flight, balance.lift_coefficients(STALL_RAD)
        return no_lift(*coefficients, steady.airspeed_m_s, steady.load_factor)
    alpha, turns = _shape(balance, found.root.x)
    most = int(np.argmax(turns))
    sound = [share for share, x in found.path if _is_sound(balance, x)]
    bent = f"the tip of {model.aircraft.surfaces[most].name!r}"
    bank = balance.angles(found.root.x)[1]
    return lost(found.share, alpha, (bent, turns[most]), max(sound, default=0.0), bank)


def _is_sound(balance: _Balance, x: Array) -> bool:
    alpha, turns = _shape(balance, x)
    return is_sound(alpha, max(turns))


def _shape(balance: _Balance, x: Array) -> tuple[float, list[float]]:
    """Angle of attack and the turn of each surface's tip against its root, rad."""
    state, model = balance.state(x)[0], balance.flight.model
    turned = [state.poses.R[a].T @ state.poses.R[b] for a, b in zip(model.roots, model.tips, strict=True)]
    return balance.angles(x)[0], [
        float(np.arccos(np.clip(0.5 * (np.trace(R) - 1.0), -1.0, 1.0))) for R in turned
    ]
