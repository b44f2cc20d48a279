"""Loads, points and shape of the flexible model out of its states at output times.

The forces are evaluated again at each output time, by a second set of scratch arrays, so that the flight
itself is the same to the bit whether they are requested or not.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.kernels.gust_loads import GUST, GUST_COLUMNS
from morphcore.aero.moving_lattice import acting_circulation
from morphcore.models.flexible import FlexibleModel
from morphcore.multibody.beam import Sections
from morphcore.multibody.hinges import hinge_screws
from morphcore.multibody.kernels.beam import apparent_forces
from morphcore.simulate.flexible import FlexibleFlight, FlexibleState, HingePath
from morphcore.simulate.points import Point, specific_force
from morphcore.simulate.record import Outputs
from morphcore.simulate.shape import Shape, section_arms, surface_shape
from morphcore.simulate.surface_loads import SurfaceLoads, section_loads

Array = NDArray[np.float64]

NUDGE_S = 1e-4  # by which the strains go on to differentiate the twist of a section: second-order accurate


@dataclass
class Evaluation:
    """What was evaluated so far, a list entry for each output time (s surfaces, h hinges).

    root_W : (s, 6); air_B : (s, 3); circulation : (strips,) m^2/s; velocity : (strips, 2) m/s; torque : (h,).
    poses : R (k, 3, 3) and x (k, 3) of all sections in N. points : by name (3,).
    """

    root_W: list[Array] = field(default_factory=list)
    air_B: list[Array] = field(default_factory=list)
    circulation: list[Array] = field(default_factory=list)
    velocity: list[Array] = field(default_factory=list)
    torque: list[Array] = field(default_factory=list)
    poses: list[tuple[Array, Array]] = field(default_factory=list)
    points: dict[str, list[Array]] = field(default_factory=dict)


class FlexibleOutputs:
    """Evaluates states of a flight.

    Parameters
    ----------
    model : FlexibleModel
    path : HingePath
    wind_N : ndarray, shape (steps + 1, 3)
        At the grid's times, m/s.
    outputs : Outputs
    gusts : ndarray, shape (steps + 1, 6 t), optional
        Of all strips, as in `flexible.FlexibleRun`.
    """

    def __init__(
        self,
        model: FlexibleModel,
        path: HingePath,
        wind_N: Array,
        outputs: Outputs,
        gusts: Array | None = None,
    ) -> None:
        self.found = Evaluation()
        self._gusts = np.zeros((wind_N.shape[0], 0)) if gusts is None else gusts
        self._flight, self._path, self._wind_N, self._outputs = FlexibleFlight(model), path, wind_N, outputs
        self._shapes = set(outputs.shape_rows.tolist())
        self._points = [point for point in outputs.points if point.surface is not None]
        places = [_place(model, point) for point in self._points]
        self._carriers = Sections(
            model.beams,
            np.array([element for element, _, _ in places], dtype=np.int64),
            np.array([fraction for _, fraction, _ in places]),
        )
        self._arms = [arm for _, _, arm in places]

    def evaluate(self, state: FlexibleState, row: int, output_row: int) -> None:
        """Evaluate the state at a row of the grid, the ``output_row``-th that is reported."""
        if "surfaces" not in self._outputs.parts and output_row not in self._shapes:
            return
        flight, wind_N, poses = self._flight, self._wind_N[row], state.poses
        demands = flight.structure(poses, state.V, state.A, wind_N)
        if output_row in self._shapes:
            placed = flight.sections.place(flight.work, poses)
            self.found.poses.append((placed.R, placed.x))
        if "surfaces" not in self._outputs.parts:
            return
        flight.lattice.deflect(self._path.deflection[row])
        flight.place_lattice(poses, wind_N, state.V)
        twists, wind_B = flight.sections.twists(state.V), wind_N @ poses.R[0]
        gust, R_NB = self._gusts[row], poses.R[0]
        acting = acting_circulation(state.circulation, state.lag)
        forces = flight.lattice.section_forces(acting, twists, wind_B, gust, R_NB)
        flight.sections.subtract(forces, demands)
        root_W = self._at_roots(state, demands)
        self.found.root_W.append(root_W)
        self.found.air_B.append(self._air(state, forces, wind_N))
        self.found.torque.append(self._torque(root_W, row))
        held, _ = flight.lattice.limited(acting, twists, wind_B, gust, R_NB)
        self._sections(held, twists, wind_B, R_NB.T @ gust.reshape(-1, GUST_COLUMNS)[:, GUST : GUST + 3].T)
        if self._points:
            twist, rate = self._motion_of_points(state)
            for number, (point, arm) in enumerate(zip(self._points, self._arms, strict=True)):
                own = slice(number, number + 1)
                force = specific_force(arm, twist[own], rate[own])
                self.found.points.setdefault(point.name, []).append(force[0])

    def _at_roots(self, state: FlexibleState, demands: Array) -> Array:
        """Sum (s, 6) about the roots, in their axes, of what the nodes of each surface require."""
        model, poses = self._flight.model, state.poses
        out = np.empty((model.roots.size, 6))
        for number, (root, tip) in enumerate(zip(model.roots, model.tips, strict=True)):
            own = slice(root, tip + 1)
            moment_N = np.einsum("nij,nj->ni", poses.R[own], demands[own, :3])
            force_N = np.einsum("nij,nj->ni", poses.R[own], demands[own, 3:])
            moment_N = moment_N + np.cross(poses.x[own] - poses.x[root], force_N)
            out[number, :3] = moment_N.sum(axis=0) @ poses.R[root]
            out[number, 3:] = force_N.sum(axis=0) @ poses.R[root]
        return out

    def _air(self, state: FlexibleState, forces: Array, wind_N: Array) -> Array:
        """Force (s, 3) of the air on each surface in B, apparent mass included."""
        model, poses = self._flight.model, state.poses
        on_sections = np.einsum("kij,kj->ki", self._flight.lattice.at.R_BS, forces[:, 3:])
        moved = np.zeros_like(state.V)
        apparent_forces(model.apparent, poses.R, state.V, state.A, wind_N, self._flight.work.v, moved)
        on_nodes = -np.einsum("nij,nj->ni", poses.R, moved[:, 3:]) @ poses.R[0]
        out, first = np.empty((model.roots.size, 3)), 0
        for number, part in enumerate(model.lattice.lattices):
            end = first + 2 * part.spanwise + 1
            nodes = slice(model.roots[number], model.tips[number] + 1)
            out[number] = on_sections[first:end].sum(axis=0) + on_nodes[nodes].sum(axis=0)
            first = end
        return out

    def _torque(self, root_W: Array, row: int) -> Array:
        """Torque (h,) of the motors: the roots' wrenches on the screws of their hinges."""
        aircraft = self._flight.model.aircraft
        torque = np.empty(len(aircraft.hinges))
        for number, (surface, own) in enumerate(zip(aircraft.surfaces, aircraft.hinge_columns, strict=True)):
            angles = self._path.angle[row : row + 1, own]
            screws = hinge_screws(surface.hinges, surface.root_arms_B, angles, surface.rest_R_BW)
            torque[own] = screws[0] @ root_W[number]
        return torque

    def _sections(self, acting: Array, twists: Array, wind_B: Array, gust_B: Array) -> None:
        """Circulation of each strip, and the velocity of its middle through the air in its own plane.

        gust_B : (3, t) of all strips; (3, 0) without.
        """
        riders, lattice = self._flight.model.riders, self._flight.lattice
        circulation, ring = [], 0
        for part in self._flight.model.lattice.lattices:
            circulation.append(acting[ring + part.rings - part.spanwise : ring + part.rings])
            ring += part.rings
        own, middles = twists[riders.drag], lattice.at.R_BS[riders.drag]
        air_B = np.tile(wind_B[:, None], middles.shape[0]) + (gust_B if gust_B.size else 0.0)
        wind_S = np.einsum("tji,jt->ti", middles, air_B)
        velocity = own[:, 3:] - wind_S
        forward = np.einsum("tj,tj->t", riders.drag_chord, velocity[:, :2])
        self.found.circulation.append(np.concatenate(circulation))
        self.found.velocity.append(np.stack([forward, velocity[:, 2]], axis=1))

    def _motion_of_points(self, state: FlexibleState) -> tuple[Array, Array]:
        """Twists (q, 6) of the sections with points, and their rates relative to free fall, in their axes."""
        work, poses, carriers = self._flight.work, state.poses, self._carriers
        strains, ahead = work.strains.copy(), []
        for step_s in (NUDGE_S, -NUDGE_S):
            work.strains[:] = strains + step_s * work.rates
            carriers.place(work, poses)
            ahead.append(carriers.twists(state.V))
        work.strains[:] = strains
        carriers.place(work, poses)
        falling = state.A.copy()
        falling[:, 3:] -= np.einsum("nji,j->ni", poses.R, self._flight.gravity_N)
        rate = carriers.twists(falling) + (ahead[0] - ahead[1]) / (2.0 * NUDGE_S)
        return carriers.twists(state.V), rate

    def surfaces(self) -> SurfaceLoads:
        """Loads of the surfaces at all output times."""
        model, found = self._flight.model, self.found
        lift, coefficient = section_loads(
            model.lattice.lattices, np.array(found.circulation), np.array(found.velocity),
            model.flight.air_density_kg_m3,
        )  # fmt: skip
        return SurfaceLoads(np.array(found.root_W), np.array(found.air_B), lift, coefficient)

    def point_force(self) -> dict[str, Array]:
        """Specific force (k, 3) at the points on surfaces, by name."""
        return {name: np.array(values) for name, values in self.found.points.items()}

    def shape(self, times_s: Array, position_N: Array, R_NB: Array) -> Shape:
        """The shape at the requested rows, with the fuselage's position (t, 3) and attitude (t, 3, 3)."""
        model, first, shapes = self._flight.model, 0, []
        order = np.unique(self._outputs.shape_rows, return_inverse=True)[1]
        R = np.stack([R for R, _ in self.found.poses])[order]
        x = np.stack([x for _, x in self.found.poses])[order]
        for number, (surface, part) in enumerate(
            zip(model.aircraft.surfaces, model.lattice.lattices, strict=True)
        ):
            edges = part.strip_edges_m
            own = slice(first, first + edges.size)
            bends = model.tips[number] > model.roots[number]
            arms = section_arms(surface, edges, edges if bends else np.zeros_like(edges))
            shapes.append(surface_shape(surface, edges, arms, R[:, own], x[:, own]))
            first += 2 * part.spanwise + 1
        return Shape(times_s, position_N, R_NB, tuple(shapes))


def _place(model: FlexibleModel, point: Point) -> tuple[int, float, Array]:
    """Element and fraction of the section that carries a point, as in `Sections`, and the point's arm, m."""
    number = [surface.name for surface in model.aircraft.surfaces].index(point.surface or "")
    surface, root, tip = model.aircraft.surfaces[number], int(model.roots[number]), int(model.tips[number])
    elements = tip - root
    if elements == 0:
        return -1 - root, 0.0, point.arm_W(surface, 0.0)
    inside = min(int(point.at * elements), elements - 1)
    first = int(np.flatnonzero(model.beams.ends[:, 0] == root)[0])
    arm = point.arm_W(surface, point.at * surface.length_m)
    return first + inside, point.at * elements - inside, arm
