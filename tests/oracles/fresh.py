"""A fresh lattice on the deformed wings at every instant: the slow oracle of the fast model's frozen one.

One flight of one parameter set. Nothing is shared with the lanes but the formulae of the physics:

- the structure is the tree of models/tree.py with the dense textbook dynamics;
- the ring corners ride on the links' true poses (near a joint on both links in proportion, so that strips
  bend), the wake follows the instantaneous free stream, the boundary condition takes the velocity of the
  structure at every control point, Kutta and Joukowski's law the one at every bound edge, and forces go to
  the links by virtual work;
- Jones' lag acts on the circulations instead of on the links' motion;
- time goes in steps of the implicit midpoint rule, solved to round-off of what matters.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.kernels.loads import JONES_A1, JONES_A2, JONES_B1, JONES_B2, JONES_MEAN_LAG
from morphcore.aero.vlm import influence
from morphcore.errors import FlightDiverged, TrimNotFound
from morphcore.frames import quaternion_from_euler, rotation_from_quaternion
from morphcore.models.equivalent import ChainModel, ParameterBatch
from morphcore.models.parameters import SHORTEST_LAG_S
from morphcore.simulate.schedule import Schedule
from morphcore.simulate.time_grid import TimeGrid
from morphcore.simulate.trim import StartMode
from tests.oracles.chain_tree import chain_tree, link_bodies, link_ends, tree_hinges
from tests.oracles.dynamics import Motion, bias, body_poses, body_twists, mass_matrix
from tests.oracles.lattice import edge_forces, edge_midpoints, panel_normals, solve_circulation
from tests.oracles.tree import Tree

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

MAX_ITERATIONS = 20
TRIM_TOLERANCE = 1e-10  # rad, of the last Newton step in angle of attack and joint angles
TRIM_PROBE = 1e-5  # rad, central differences
STEP_TOLERANCE = 1e-9  # rad/s and m/s, of the last correction to the velocities at the end of a step


@dataclass(frozen=True)
class FreshState:
    """State of one flight: motion but for the hinges', and lag states (2, r) of the circulations, m^2/s."""

    quaternion: Array
    twist_B: Array
    position_N: Array
    q_joint: Array
    v_joint: Array
    lag: Array


@dataclass(frozen=True)
class FreshLoads:
    """Air loads at one instant: wrench (b, 6) on the bodies, unlagged circulations (r,) in m^2/s."""

    wrench: Array
    circulation: Array


@dataclass(frozen=True)
class FreshTrim:
    """A steady start: angle of attack (rad), constant force (N) and moment (N m) in B, joint angles (rad)."""

    alpha: float
    force_B: Array
    moment_B: Array
    q_joint: Array


class FreshModel:
    """One parameter set of a chain model with a lattice that follows it."""

    def __init__(self, model: ChainModel, batch: ParameterBatch, particle: int = 0) -> None:
        self.model = model
        self.tree: Tree = chain_tree(model, batch, particle)
        own = batch.select(slice(particle, particle + 1))
        values = [model.on_surface(own, s) for s in range(len(model.aircraft.surfaces))]
        self.lift_factor = float(own["lift_factor"][0])
        shift = np.array([value["ac_offset_m"][0] for value in values])
        self.ac_offset_L = np.outer(np.repeat(shift, model.surfaces[:, 1]), [1.0, 0.0, 0.0])
        self.bodies, self.origins = link_bodies(model)
        lag_s = np.array([value["lag_s"][0] for value in values])
        per_ring = lag_s[model.lattice.table.panel_surface] / JONES_MEAN_LAG
        self.lag_times = np.maximum(np.stack([per_ring / JONES_B1, per_ring / JONES_B2]), SHORTEST_LAG_S)
        self._carry_lattice(batch, particle)
        self._set_sections(batch, particle, values)
        self._cut_drag_areas(batch, particle, [float(value["profile_drag"][0]) for value in values])

    def _carry_lattice(self, batch: ParameterBatch, particle: int) -> None:
        """Tie corners, control points (midway between both edges of their strip) and edges to the links."""
        model, table = self.model, self.model.lattice.table
        corners, controls = [], []
        for s, (surface, part) in enumerate(
            zip(model.aircraft.surfaces, model.lattice.lattices, strict=True)
        ):
            ends = link_ends(model, batch, s, particle)
            links = slice(int(model.surfaces[s, 0]), int(model.surfaces[s, 0]) + ends.size - 1)
            # a station rides on what lies within half a strip on both sides of it
            half = 0.5 * np.diff(part.strip_edges_m).mean()
            low = np.maximum(part.strip_edges_m[:, None] - half, ends[:-1])
            high = np.minimum(part.strip_edges_m[:, None] + half, ends[1:])
            share = np.zeros((part.spanwise + 1, model.links))
            share[:, links] = np.maximum(high - low, 0.0)
            share /= share.sum(axis=1, keepdims=True)
            origin_W = np.zeros((model.links, 3))
            origin_W[:, 0] = surface.elastic_axis_x_m
            origin_W[links, 1] = surface.span_sign * ends[:-1]
            on_edges = np.zeros((part.chordwise, part.spanwise + 1, 3))
            middle_chord = surface.chord_at(np.abs(part.control_points_W[:, 0, 1]))
            # the control points' fraction of the chord, on the strips' edges
            on_edges[..., 0] = np.outer(
                part.control_points_W[:, 0, 0] / middle_chord, surface.chord_at(part.strip_edges_m)
            )
            on_edges[..., 1] = surface.span_sign * part.strip_edges_m
            corners.append(_riding(part.ring_corners_W, share, origin_W))
            edges = _riding(on_edges, share, origin_W)
            shape = (part.chordwise, part.spanwise + 1, model.links, 4)
            on_strips = 0.5 * (edges.reshape(shape)[:, 1:] + edges.reshape(shape)[:, :-1])
            controls.append(on_strips.reshape(-1, model.links, 4))
        self.corners: Array = np.concatenate(corners)
        self.controls: Array = np.concatenate(controls)
        self.edges: Array = 0.5 * (self.corners[table.edge_start] + self.corners[table.edge_end])

    def _cut_drag_areas(self, batch: ParameterBatch, particle: int, drag: Sequence[float]) -> None:
        """Drag area Cd A of each link, m^2, and its centroid in link axes, m: trapezia."""
        areas, centroids = [], []
        for s, surface in enumerate(self.model.aircraft.surfaces):
            ends = link_ends(self.model, batch, s, particle)
            length, inner, outer = np.diff(ends), surface.chord_at(ends[:-1]), surface.chord_at(ends[1:])
            areas.append(drag[s] * 0.5 * (inner + outer) * length)
            y = surface.span_sign * length * (inner + 2.0 * outer) / (3.0 * (inner + outer))
            centroids.append(np.stack([0.0 * y, y, 0.0 * y], axis=1))
        self.drag_area: Array = np.concatenate(areas)
        self.drag_centre_L: Array = np.concatenate(centroids)

    def _set_sections(self, batch: ParameterBatch, particle: int, values: Sequence[dict[str, Array]]) -> None:
        """Slope of the mean line at each control point; cm0 times the integral of c^2 and its y, by link."""
        slopes, areas, centres = [], [], []
        for s, (surface, part) in enumerate(
            zip(self.model.aircraft.surfaces, self.model.lattice.lattices, strict=True)
        ):
            share = np.abs(part.control_points_W[..., 1]).ravel() / surface.span_m
            slopes.append(surface.twist_rad * share - values[s]["zero_lift_rad"][0])
            ends = link_ends(self.model, batch, s, particle)
            length, inner, outer = np.diff(ends), surface.chord_at(ends[:-1]), surface.chord_at(ends[1:])
            squared = (inner**2 + inner * outer + outer**2) / 3.0
            areas.append(values[s]["cm0"][0] * length * squared)
            centres.append(
                surface.span_sign
                * length
                * (inner**2 + 2.0 * inner * outer + 3.0 * outer**2)
                / 12.0
                / squared
            )
        self.slope: Array = np.concatenate(slopes)
        self.moment_area: Array = np.concatenate(areas)
        self.moment_y: Array = np.concatenate(centres)

    def motion(self, state: FreshState, hinges: Array) -> Motion:
        """The tree's motion with angle, rate, acceleration (h, 3) of every hinge."""
        angle, rate, acceleration = tree_hinges(self.model, hinges).T
        return Motion(
            state.quaternion,
            state.twist_B,
            state.q_joint,
            state.v_joint,
            angle,
            rate,
            acceleration,
            state.position_N,
        )

    def loads(self, motion: Motion, lag: Array | None, blend: float = 0.0) -> FreshLoads:
        """Air loads of a motion with the lattice where the links are.

        Parameters ---------- lag : (2, r) both lag states of the circulations before the part of a step
        that ends here, m^2/s; None: settled. blend : that part's length, s; the lag states move over it by
        the implicit Euler rule.
        """
        flight, table = self.model.flight, self.model.lattice.table
        wind_B = motion.R_NB.T @ flight.wind_N
        R_NX, r_N = body_poses(self.tree, motion)
        R_BX, r_B = motion.R_NB.T @ R_NX, (r_N - motion.position_N) @ motion.R_NB
        twists = body_twists(self.tree, motion)
        R_BL = R_BX[self.bodies]
        r_L = r_B[self.bodies] + np.einsum("kab,kb->ka", R_BL, self.origins)
        omega_L = twists[self.bodies, :3]
        v_L = twists[self.bodies, 3:] + np.cross(omega_L, self.origins)

        def place(riding: Array) -> Array:
            return np.asarray(riding[..., 0] @ r_L + np.einsum("kab,mkb->ma", R_BL, riding[..., 1:]))

        def velocity(riding: Array) -> Array:
            velocity_L = riding[..., :1] * v_L + np.cross(omega_L, riding[..., 1:])
            return np.asarray(np.einsum("kab,mkb->ma", R_BL, velocity_L))

        corners = place(self.corners)
        stream_B, mach = wind_B - motion.twist_B[3:], flight.mach or 0.0
        core = self.model.lattice.settings.core
        at_controls = influence(place(self.controls), corners, table, stream_B, core, mach)
        normals, flow = panel_normals(corners, table), wind_B - velocity(self.controls)
        along = np.einsum("mk,kb,mb->m", self.controls[..., 0], R_BL[:, :, 0], flow)  # the chords
        flow = flow - normals * (self.slope * along)[:, None]
        circulation = solve_circulation(at_controls, normals, flow)
        lagged = circulation
        if lag is not None:
            slow, fast = self.lagged(circulation, lag, blend)
            lagged = (1.0 - JONES_A1 - JONES_A2) * circulation + JONES_A1 * slow + JONES_A2 * fast
        at_edges = influence(edge_midpoints(corners, table), corners, table, stream_B, core, mach)
        forces = edge_forces(
            corners,
            table,
            self.lift_factor * lagged,
            wind_B - velocity(self.edges),
            at_edges,
            flight.air_density_kg_m3,
        )
        on_links = np.einsum("kba,eb->eka", R_BL, forces.force_B)
        force_L = np.einsum("ek,eka->ka", self.edges[..., 0], on_links)
        moment_L = np.cross(self.edges[..., 1:], on_links).sum(axis=0)
        moment_L += np.cross(self.ac_offset_L, force_L)
        return FreshLoads(self._on_bodies(force_L, moment_L, v_L, omega_L, R_BL, wind_B), circulation)

    def lagged(self, circulation: Array, lag: Array, length_s: float) -> Array:
        """Lag states (2, r) after following ``circulation`` for some time, by the implicit Euler rule."""
        ratio = length_s / self.lag_times
        return np.asarray((lag + ratio * circulation) / (1.0 + ratio))

    def _on_bodies(
        self, force_L: Array, moment_L: Array, v_L: Array, omega_L: Array, R_BL: Array, wind_B: Array
    ) -> Array:
        """Wrenches (b, 6) at the bodies' origins, with the profile drag."""
        velocity = v_L + np.cross(omega_L, self.drag_centre_L) - np.einsum("kba,b->ka", R_BL, wind_B)
        speed = np.linalg.norm(velocity, axis=1)
        drag_L = -0.5 * self.model.flight.air_density_kg_m3 * (self.drag_area * speed)[:, None] * velocity
        moment_L = moment_L + np.cross(self.drag_centre_L, drag_L)
        at_centre = v_L + np.cross(omega_L, np.outer(self.moment_y, [0.0, 1.0, 0.0]))
        at_centre -= np.einsum("kba,b->ka", R_BL, wind_B)
        pressure = 0.5 * self.model.flight.air_density_kg_m3 * (at_centre[:, 0] ** 2 + at_centre[:, 2] ** 2)
        moment_L[:, 1] += pressure * self.moment_area
        force_L = force_L + drag_L
        wrench = np.zeros((self.tree.bodies, 6))
        np.add.at(wrench, self.bodies, np.hstack([moment_L + np.cross(self.origins, force_L), force_L]))
        return wrench

    def trimmed(self, hinge_rad: Array, start: StartMode = "trim") -> tuple[FreshTrim, FreshState]:
        """Equilibrium at hinge angles (s,), as in ``simulate.trim.trim``.

        Raises
        ------
        TrimNotFound : Newton's iteration did not arrive.
        """
        given = self.model.flight.start if start == "given" else None
        n = self.tree.coordinates
        hinges = np.stack([hinge_rad, 0.0 * hinge_rad, 0.0 * hinge_rad], axis=1)
        gravity_N = np.array([0.0, 0.0, self.model.flight.gravity_m_s2])
        x = np.zeros(n + 1)  # joint angles, angle of attack
        if given is not None:
            x[n] = given.alpha_rad

        def imbalance(x: Array) -> tuple[Array, FreshState]:
            """Bias forces (6 + n,) at rest in the free stream: what thrust and inertia have to bear."""
            state = self._level(x[n], x[:n])
            motion = self.motion(state, hinges)
            found = self.loads(motion, None)
            state = replace(state, lag=np.stack([found.circulation, found.circulation]))
            return bias(self.tree, motion, found.wrench, gravity_N), state

        def residual(x: Array) -> Array:
            """Joint accelerations, and in trim the specific force normal to the flight path."""
            h, state = imbalance(x)
            M = mass_matrix(self.tree, self.motion(state, hinges))
            if given is not None:
                h[:6] -= np.concatenate([given.moment_B, given.force_B])
                return np.asarray(np.linalg.solve(M, -h)[6:])
            # thrust bears all of the base's part but the one normal to the path
            normal = -np.sin(x[n]) * h[3] + np.cos(x[n]) * h[5]
            return np.append(np.linalg.solve(M[6:, 6:], -h[6:]), -normal / M[5, 5])

        free = n if given is not None else n + 1
        step: Array = np.zeros(free)
        for _ in range(MAX_ITERATIONS if free else 0):
            probes = TRIM_PROBE * np.eye(n + 1)[:free]
            jacobian = np.stack(
                [(residual(x + probe) - residual(x - probe)) / (2.0 * TRIM_PROBE) for probe in probes], axis=1
            )
            step = np.asarray(np.linalg.solve(jacobian, -residual(x)), dtype=np.float64)
            x[:free] += step
            if np.abs(step).max() < TRIM_TOLERANCE:
                break
        if free and not np.abs(step).max() < TRIM_TOLERANCE:
            raise TrimNotFound(residual=float(np.abs(step).max()), iterations=MAX_ITERATIONS)
        h, state = imbalance(x)
        if given is not None:
            return FreshTrim(float(x[n]), given.force_B, given.moment_B, x[:n]), state
        return FreshTrim(float(x[n]), h[3:6].copy(), h[:3].copy(), x[:n]), state

    def _level(self, alpha: float, q_joint: Array) -> FreshState:
        """Straight and level through the air; the wind carries the aircraft along."""
        quaternion = quaternion_from_euler(0.0, alpha, 0.0)
        air_B = self.model.flight.airspeed_m_s * np.array([np.cos(alpha), 0.0, np.sin(alpha)])
        wind_B = rotation_from_quaternion(quaternion).T @ self.model.flight.wind_N
        return FreshState(
            quaternion=quaternion,
            twist_B=np.concatenate([np.zeros(3), air_B + wind_B]),
            position_N=np.zeros(3),
            q_joint=q_joint.copy(),
            v_joint=np.zeros(q_joint.size),
            lag=np.zeros((2, self.model.lattice.table.rings)),
        )


def fly_fresh(
    fresh: FreshModel, schedules: Sequence[Schedule], grid: TimeGrid, thrust: FreshTrim, state: FreshState
) -> Iterator[FreshState]:
    """Fly with a new lattice in every evaluation; yields the state at each grid time, the first included.

    Implicit midpoint rule: A-stable, of second order, the attitude moved by the exponential of the mean
    rates. The stiff joints are in the iteration matrix M + h/2 C + (h/2)^2 K, the air loads follow by fixed
    point (a few per mille a pass).

    Raises
    ------
    FlightDiverged : the iteration does not settle.
    """
    n, h = fresh.tree.coordinates, grid.step_s
    constant = np.concatenate([thrust.moment_B, thrust.force_B])
    times = grid.times_s
    middles = [schedule.motion(times[:-1] + 0.5 * h) for schedule in schedules]
    rates = [schedule.motion(times).rate for schedule in schedules]
    yield state
    a = np.zeros(6 + n)
    for i in range(grid.steps):
        hinges = np.array(
            [
                [m.angle[i], m.rate[i], (rate[i + 1] - rate[i]) / h]
                for m, rate in zip(middles, rates, strict=True)
            ]
        )
        a, circulation = _settled(fresh, state, a, hinges, constant, h, float(times[i]))
        lag = 2.0 * fresh.lagged(circulation, state.lag, 0.5 * h) - state.lag
        state = replace(_moved(state, a, h, h), lag=lag)
        yield state


def _settled(
    fresh: FreshModel, state: FreshState, a: Array, hinges: Array, constant: Array, h: float, time_s: float
) -> tuple[Array, Array]:
    """Mean accelerations (6 + n,) of a step and the circulations (r,) amid it, from a guess ``a``."""
    tree, gravity_N = fresh.tree, np.array([0.0, 0.0, fresh.model.flight.gravity_m_s2])
    for _ in range(MAX_ITERATIONS):
        motion = fresh.motion(_moved(state, a, h, 0.5 * h), hinges)
        found = fresh.loads(motion, state.lag, 0.5 * h)
        found.wrench[0] += constant
        M = mass_matrix(tree, motion)
        residual = M @ a + bias(tree, motion, found.wrench, gravity_N)
        M[6:, 6:] += np.diag(0.5 * h * (tree.damping + 0.5 * h * tree.stiffness))
        correction = np.linalg.solve(M, residual)
        a = a - correction
        if h * float(np.abs(correction).max()) < STEP_TOLERANCE:
            return a, found.circulation
    raise FlightDiverged(time_s=time_s)


def _moved(state: FreshState, a: Array, step_s: float, part_s: float) -> FreshState:
    """The state after a part of a step with accelerations ``a`` (6 + n,), by the midpoint rule."""
    n = state.q_joint.size
    twist_B, v_joint = state.twist_B + 0.5 * step_s * a[:6], state.v_joint + 0.5 * step_s * a[6:]
    R_NB = rotation_from_quaternion(_turned(state.quaternion, twist_B[:3], 0.5 * step_s))
    return replace(
        state,
        quaternion=_turned(state.quaternion, twist_B[:3], part_s),
        twist_B=state.twist_B + part_s * a[:6],
        position_N=state.position_N + part_s * R_NB @ twist_B[3:],
        q_joint=state.q_joint + part_s * v_joint[:n],
        v_joint=state.v_joint + part_s * a[6:],
    )


def _turned(quaternion: Array, omega_B: Array, time_s: float) -> Array:
    """Attitude after some time of constant body rates."""
    half = 0.5 * time_s * omega_B
    angle = float(np.sqrt(half @ half))
    w, x = quaternion[0], quaternion[1:]
    c, v = np.cos(angle), np.sinc(angle / np.pi) * half
    return np.concatenate([[w * c - x @ v], w * v + c * x + np.cross(x, v)])


def _riding(points_W: Array, share: Array, origin_W: Array) -> Array:
    """How points (rows, stations, 3) of the undeformed surface ride on the links: (points, links, 4).

    The share of each link, (stations, links), and that share times the point in link axes: place and
    velocity of the point are linear in both.
    """
    arms = points_W[:, :, None, :] - origin_W
    weights = np.broadcast_to(share[..., None], (*arms.shape[:3], 1))
    return np.concatenate([weights, weights * arms], axis=-1).reshape(-1, share.shape[1], 4)
