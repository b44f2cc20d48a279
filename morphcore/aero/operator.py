r"""The lattice of a whole aircraft, reduced to an operator on the links' motion.

With the lattice frozen on the undeformed surfaces (at their hinge angles), or on those bent as in trim
(`bent_shape`), and its wake along a fixed direction, the circulations are linear in the normal velocity of
the structure, and on a flat link that velocity is ``w(x) = D0 + D1 x`` along each strip. So the whole lattice
is one matrix from (D0, D1) of the strips to five numbers for each strip (rows as listed in
aero/kernels/loads.py), from which the forces on all bound edges follow. On swept surfaces x is measured along
the chord, which is oblique in the axes of the link.

Kutta-Joukowski on a ring of circulation G in the flow U = induced velocity - velocity of the structure:

- In the flow of a rigid motion, a *closed* ring experiences no net force, only the moment rho G A (n x U).
  Only the rings at the trailing edge are open (wake and last edge cancel), which leaves the force rho G_te U
x l at the trailing edge. Hence normal force and moments from ``g = G_te dy``, ``S = sum G_i A_i`` and ``X =
  sum G_i A_i x_i``.
- The normal velocity on the edges gives the forces in the plane of the surface. They are products of
  circulation and induced velocity, both distributed along the chord; here the induced velocity of a strip is
  averaged with the chordwise distribution of the circulation in uniform incidence, which is exact there and
  of second order elsewhere.
- The velocity induced in the plane of the surface gives a normal force. It vanishes if all surfaces and their
  wakes lie in one plane. Otherwise, or with sweep or taper, three more numbers for each strip hold it, its
  moment about y, and the moment of the forces in the plane about the strip's point on the axis; its moment
  about x takes the place of X. So the force of every edge, spanwise or chordwise, acts at its middle: where
  surfaces touch at different angles their last edges attract each other, and arms matter more than forces.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.bent_shape import BentShape
from morphcore.aero.kernels.loads import (
    AREA_CHORD,
    CENTRE_X,
    CHORD_SLOPE,
    CHORD_X,
    CHORD_Y,
    EDGE_DX,
    EDGE_DY,
    EDGE_X,
    EDGE_Y,
    INBOARD,
    MORE_OUTPUTS,
    OUTPUTS,
    SLIDING_COLUMNS,
    STRIP_COLUMNS,
    VORTEX_X,
)
from morphcore.aero.vlm import RingTable, influence, ring_table
from morphcore.geometry.aircraft import Aircraft
from morphcore.geometry.control_slopes import ControlSlopes, control_slopes
from morphcore.geometry.lattice import SurfaceLattice, strip_areas, surface_lattice, surface_pose
from morphcore.geometry.mirror import mirror_groups
from morphcore.geometry.surface import Surface
from morphdata.lattice import DEFAULT_LATTICE, Lattice

Array = NDArray[np.float64]

ROW_MULTIPLE, COLUMN_MULTIPLE = 8, 4  # the lane product runs over tiles of this size
ACROSS = np.array([1.0, -1.0, 1.0])  # reflection about the x-z plane
BODY_AFT = (-1.0, 0.0, 0.0)  # direction of the frozen wake in B: the free stream at zero incidence


@dataclass(frozen=True)
class AircraftLattice:
    """The undeformed lattices of all surfaces, their settings and their numbering.

    images : mirror images of the surfaces if these are one half of a symmetric aircraft. They induce
    velocities but have no outputs of their own. table : rings of the surfaces, then of the images. slopes :
    of the control surfaces. steep : the wake leaves the surfaces at such an angle that the velocity it
    induces along them matters.
    """

    aircraft: Aircraft
    settings: Lattice
    lattices: tuple[SurfaceLattice, ...]
    images: tuple[Surface, ...]
    table: RingTable
    strip0: tuple[int, ...]
    strips: int
    slopes: ControlSlopes
    steep: bool = False

    @property
    def control_inputs(self) -> tuple[tuple[int, int, int], ...]:
        """By surface: what to add to the number of its strip for the input u_x, first such strip, and end.

        The strips are those from the first to the last that a control moves; none without controls.
        """
        first, out = 2 * self.strips, []
        for strip0, part in zip(self.strip0, self.lattices, strict=True):
            own = self.slopes.strip[
                (self.slopes.strip >= strip0) & (self.slopes.strip < strip0 + part.spanwise)
            ]
            low, high = (int(own.min()) - strip0, int(own.max()) - strip0 + 1) if own.size else (0, 0)
            out.append((first - low, low, high))
            first += high - low
        return tuple(out)

    @property
    def control_columns(self) -> NDArray[np.int64]:
        """(m,) input that the loads of each part of the controls multiply: u_x of its strip."""
        shift = np.concatenate(
            [
                np.full(part.spanwise, control0 - strip0)
                for (control0, _, _), strip0, part in zip(
                    self.control_inputs, self.strip0, self.lattices, strict=True
                )
            ]
        )
        return np.asarray(self.slopes.strip + shift[self.slopes.strip], dtype=np.int64)

    @property
    def rings(self) -> int:
        """Rings of the surfaces, without their images."""
        return sum(lattice.rings for lattice in self.lattices)

    @property
    def has_more_outputs(self) -> bool:
        """Whether strips need `MORE_OUTPUTS`: unless all surfaces are unbent oblongs in a plane, wake too."""
        surfaces = self.aircraft.surfaces
        turns = any(
            hinge.axis_B[2] if hinge.prismatic else hinge.axis_B[0] or hinge.axis_B[1]
            for hinge in self.aircraft.hinges
        )
        heights = {surface.position_m[2] for surface in surfaces}
        oblong = all(s.is_upright and s.root_chord_m == s.tip_chord_m for s in surfaces)
        bent = self.settings.shape == "trimmed"
        return self.steep or bent or turns or len(heights) > 1 or not oblong

    @cached_property
    def paired(self) -> NDArray[np.bool_]:
        """Whether each surface has a mirror image, (s,)."""
        surfaces = self.aircraft.surfaces
        if self.images:
            return np.ones(len(surfaces), dtype=np.bool_)
        pairs = [group for group in mirror_groups(surfaces) if len(group) > 1]
        return np.isin(np.arange(len(surfaces)), [number for group in pairs for number in group])

    def more_rows(self, strip: int) -> int:
        """First of the further rows of a strip; -1 if there are none."""
        return OUTPUTS * self.strips + MORE_OUTPUTS * strip if self.has_more_outputs else -1

    def at(self, angles: Array) -> AircraftLattice:
        """The lattice at angles (h,) of all hinges: panels that telescope have one on their visible part."""
        surfaces = self.aircraft.surfaces
        if all(surface.mouth_m is None for surface in surfaces):
            return self
        hidden = [
            s.hidden_m(angles[own]) for s, own in zip(surfaces, self.aircraft.hinge_columns, strict=True)
        ]
        panels = (self.settings.chordwise, self.settings.spanwise)
        seen, reflected = (
            tuple(surface_lattice(each, *panels, inside) for each, inside in zip(of, hidden, strict=False))
            for of in (surfaces, self.images)
        )
        return replace(self, lattices=seen, table=ring_table(seen + reflected))

    @property
    def operator_shape(self) -> tuple[int, int]:
        """Rows and columns of the operator, padded to whole tiles."""
        chordwise = sum(end - low for _, low, end in self.control_inputs)
        return (
            -(-(OUTPUTS + MORE_OUTPUTS * self.has_more_outputs) * self.strips // ROW_MULTIPLE) * ROW_MULTIPLE,
            -(-(2 * self.strips + chordwise) // COLUMN_MULTIPLE) * COLUMN_MULTIPLE,
        )


@dataclass(frozen=True)
class LatticeOperator:
    """One reduced operator.

    matrix : (rows, columns) as ``operator_shape``. strips : (strips, STRIP_COLUMNS) or, where a surface
    telescopes, SLIDING_COLUMNS more, as listed in aero/kernels/loads.py. controls : (rows, m) columns of the
    parts of the controls, `ControlSlopes`, for unit deflection; see `AircraftLattice.control_columns`.
    """

    matrix: Array
    strips: Array
    controls: Array


def aircraft_lattice(
    aircraft: Aircraft,
    settings: Lattice = DEFAULT_LATTICE,
    images: Sequence[Surface] = (),
    *,
    steep: bool = False,
) -> AircraftLattice:
    """Lattices of the same settings on every surface; ``images`` of all of them or none."""
    panels = (settings.chordwise, settings.spanwise)
    lattices = tuple(surface_lattice(surface, *panels) for surface in aircraft.surfaces)
    reflected = tuple(surface_lattice(surface, *panels) for surface in images)
    strip0 = tuple(int(n) for n in np.cumsum([0] + [lattice.spanwise for lattice in lattices[:-1]]))
    return AircraftLattice(
        aircraft,
        settings,
        lattices,
        tuple(images),
        ring_table(lattices + reflected),
        strip0,
        sum(lattice.spanwise for lattice in lattices),
        control_slopes([surface.controls for surface in aircraft.surfaces], lattices, strip0),
        steep,
    )


def lattice_operator(
    lattice: AircraftLattice,
    hinge_rad: Sequence[float],
    *,
    mach: float = 0.0,
    wake_direction_B: Sequence[float] = BODY_AFT,
    shape: BentShape | None = None,
) -> LatticeOperator:
    """The reduced operator for given angles (h,) of all hinges, rad.

    ``shape`` of the surfaces, on which they induce velocities on each other; None: unbent. Strips' own axes
    and edges are those of the links on which they ride.
    """
    aircraft, angles = lattice.aircraft, np.asarray(hinge_rad, dtype=np.float64)
    if angles.shape != (len(aircraft.hinges),):
        raise ValueError(f"{angles.size} angles for {len(aircraft.hinges)} hinges")
    lattice = lattice.at(angles)
    poses = [
        surface_pose(surface, angles[own])
        for surface, own in zip(aircraft.surfaces, aircraft.hinge_columns, strict=True)
    ]
    corners, controls, fronts, sides, axes = [], [], [], [], []
    for surface, bent, (R_BW, r_B), part in zip(
        aircraft.surfaces, shape or [None] * len(poses), poses, lattice.lattices, strict=True
    ):
        ring_W, control_W, own = part.ring_corners_W, part.control_points_W, R_BW[None]
        if bent is not None:
            ring_W, control_W, R_WS = bent.placed(part, surface.elastic_axis_W)
            own = R_BW @ R_WS
        ring = ring_W @ R_BW.T + r_B
        axes.append(own)
        corners.append(ring.reshape(-1, 3))
        controls.append((control_W @ R_BW.T + r_B).reshape(-1, 3))
        fronts.append((0.5 * (ring[:-1, :-1] + ring[:-1, 1:])).reshape(-1, 3))
        sides.append((0.5 * (ring[:-1] + ring[1:])).reshape(-1, 3))
    corners += [ring * ACROSS for ring in corners if lattice.images]
    points = np.concatenate([part for group in (controls, fronts, sides) for part in group])
    velocity = influence(
        points, np.concatenate(corners), lattice.table, wake_direction_B, lattice.settings.core, mach
    )
    rings = lattice.rings

    def along(axis: int, neighbour: int = 0) -> Array:
        """Induced velocity (points, rings) along an axis of the strips; ``neighbour`` as in `_at_points`."""
        direction = _at_points(lattice, axes, axis, neighbour)
        induced = np.einsum("pa,arp->pr", direction, velocity)
        # an image has the circulation of its original
        return np.asarray(induced[:, :rings] + induced[:, rings:] if lattice.images else induced)

    induced = along(2)
    circulation = np.asarray(np.linalg.solve(induced[:rings], _boundary(lattice)), np.float64)
    rootward = [induced[rings:] @ circulation]
    if lattice.has_more_outputs:
        rootward += [along(axis)[rings:] @ circulation for axis in (0, 1)]
    tipward = rootward
    if shape is not None:
        tipward = [along(axis, 1)[rings:] @ circulation for axis in (2, 0, 1)]
    flow = list(zip(rootward, tipward, strict=True))
    return _reduced(lattice, circulation, flow, _uniform_flows(lattice, axes))


def _at_points(lattice: AircraftLattice, axes: Sequence[Array], axis: int, neighbour: int) -> Array:
    """One axis (points, 3) of the strips in B at control points, fronts and sides of all surfaces.

    axes : (strips, 3, 3) of each surface's strips, or (1, 3, 3) of a straight one. neighbour : 0, at a side
    the axes of the strip whose root side it is; 1, of the one whose tip side it is.
    """
    panels, sides = [], []
    for own, part in zip(axes, lattice.lattices, strict=True):
        beside = np.clip(np.arange(part.spanwise + 1) - neighbour, 0, part.spanwise - 1)
        direction = np.broadcast_to(own[:, :, axis], (part.spanwise, 3))
        panels.append(np.tile(direction, (part.chordwise, 1)))
        sides.append(np.tile(direction[beside], (part.chordwise, 1)))
    return np.concatenate([*panels, *panels, *sides])


def _uniform_flows(lattice: AircraftLattice, axes: Sequence[Array]) -> list[Array]:
    """Normal velocities (strips,) of all strips, for each surface, in a uniform flow normal to it.

    Other surfaces, and a bent one's own strips, meet that flow by the cosine between the normals. Mirror
    images meet it alike, as in an aircraft of which only one half is computed. axes : as in `_at_points`.
    """
    rows = [len(own) for own in axes]
    counts = [part.spanwise // count for part, count in zip(lattice.lattices, rows, strict=True)]
    normals, alike = np.concatenate([own[:, :, 2] for own in axes]), np.repeat(lattice.paired, rows)
    flows = []
    for own, paired in zip(axes, lattice.paired, strict=True):
        normal = own[0, :, 2]
        met = normals @ normal
        if paired:
            met = np.where(alike, np.maximum(met, (normals * ACROSS) @ normal), met)
        flows.append(np.repeat(met, np.repeat(counts, rows)))
    return flows


def _boundary(lattice: AircraftLattice) -> Array:
    """Normal velocity at the control points (rings, inputs) for unit inputs.

    These are D0 and D1 of every strip, then u_x of every part of the controls.
    """
    slopes, motions = lattice.slopes, 2 * lattice.strips
    out = np.zeros((lattice.rings, motions + slopes.parts))
    ring = 0
    for surface, part, strip0 in zip(
        lattice.aircraft.surfaces, lattice.lattices, lattice.strip0, strict=True
    ):
        x = part.control_points_W[..., 0] / part.cos_sweep - surface.elastic_axis_x_m
        for k in np.flatnonzero((slopes.strip >= strip0) & (slopes.strip < strip0 + part.spanwise)):
            rings = ring + slopes.strip[k] - strip0 + part.spanwise * np.arange(part.chordwise)
            out[rings, motions + k] = slopes.slope[k]
        for i in range(part.chordwise):
            for j in range(part.spanwise):
                out[ring, 2 * (strip0 + j)] = 1.0
                out[ring, 2 * (strip0 + j) + 1] = x[i, j]
                ring += 1
    return out


def _reduced(
    lattice: AircraftLattice,
    circulation: Array,
    flow: Sequence[tuple[Array, Array]],
    uniform_flows: Sequence[Array],
) -> LatticeOperator:
    """The operator from circulations (rings, inputs) and what they induce at fronts and sides.

    flow : normal velocity (points, inputs); if it has further outputs, also those along x and y. In the axes
    of the strip whose root side a side is, and in those of the one whose tip side it is.
    uniform_flows : of `_uniform_flows`, in which a surface has its chordwise distribution of circulation.
    """
    motions = 2 * lattice.strips
    slides = any(surface.mouth_m is not None for surface in lattice.aircraft.surfaces)
    strips = np.zeros((lattice.strips, STRIP_COLUMNS + SLIDING_COLUMNS * slides))
    inputs = circulation.shape[1]
    loads = np.zeros((lattice.operator_shape[0], inputs))
    ring, side0 = 0, lattice.rings
    for surface, part, strip0, uniform in zip(
        lattice.aircraft.surfaces, lattice.lattices, lattice.strip0, uniform_flows, strict=True
    ):
        shape = (part.chordwise, part.spanwise)
        fronts = slice(ring, ring + part.rings)
        sides = slice(side0, side0 + part.chordwise * (part.spanwise + 1))
        gamma = circulation[fronts].reshape(*shape, inputs)
        reference = (circulation[fronts, :motions:2] * uniform).sum(axis=1).reshape(shape)
        on_edges = [
            (
                root[fronts].reshape(*shape, inputs),
                root[sides].reshape(part.chordwise, -1, inputs)[:, :-1],
                tip[sides].reshape(part.chordwise, -1, inputs)[:, 1:],
            )
            for root, tip in flow
        ]
        ring, side0 = fronts.stop, sides.stop
        edges = _edges(surface, part, reference / reference[-1])

        row = OUTPUTS * strip0 + OUTPUTS * np.arange(part.spanwise)
        loads[row] = gamma[-1] * edges.width[:, None]
        loads[row + 1] = np.einsum("ijn,ij->jn", gamma, edges.area)
        loads[row + 2] = np.einsum("ijn,ij->jn", gamma, edges.area * edges.centre_x)
        loads[row + 3] = edges.summed(on_edges[0], edges.front[..., 1], edges.side[..., 1])
        loads[row + 4] = -edges.summed(on_edges[0], edges.front[..., 0], edges.side[..., 0])
        if lattice.slopes.parts:
            loads[row + 3, motions:] += _exchanged(
                gamma[..., motions:], on_edges[0][0][..., :motions:2] @ uniform, edges, reference
            )
        if lattice.has_more_outputs:
            more = lattice.more_rows(strip0) + MORE_OUTPUTS * np.arange(part.spanwise)
            for place, (front, side) in (
                (more, (1.0, 1.0)),
                (more + 2, edges.middles(0)),
                (row + 2, edges.middles(1)),
            ):
                loads[place] = edges.summed(
                    on_edges[1], front * edges.front[..., 1], side * edges.side[..., 1]
                ) - edges.summed(on_edges[2], front * edges.front[..., 0], side * edges.side[..., 0])
            loads[more + 1] = edges.moment(on_edges[0])
        own = strips[strip0 : strip0 + part.spanwise]
        own[:, :STRIP_COLUMNS] = edges.columns(surface.chord_W)
        if surface.mouth_m is not None:
            own[:, INBOARD : AREA_CHORD + 1] = strip_areas(surface, part)
    matrix = np.zeros(lattice.operator_shape)
    matrix[:, :motions] = loads[:, :motions]
    return LatticeOperator(matrix, strips, loads[:, motions:].copy())


@dataclass(frozen=True)
class _Edges:
    """Bound edges of a surface's strips in link axes, each strip about its own point on the axis (m, m^2).

    corners : (chordwise + 1, spanwise, 2, 3) of the rings, at the root and tip side of each strip. front :
    (chordwise, spanwise, 3) and side : (chordwise, spanwise, 2, 3) edges, in the sense of the lifting
    circulation but for the root side. area, centre_x : (chordwise, spanwise) of the rings. share : the same,
    of each ring's circulation in that of the strip's last ring, and bound : on each front. width :
    (spanwise,) along the axis. sign : of the span.
    """

    corners: Array
    front: Array
    side: Array
    area: Array
    centre_x: Array
    share: Array
    bound: Array
    width: Array
    sign: float

    def summed(self, flow: tuple[Array, Array, Array], front: Array, side: Array) -> Array:
        """Sum (spanwise, inputs) over a strip's edges of velocity times weight, by their circulation.

        flow : velocities on fronts, root and tip sides, (chordwise, spanwise, inputs); front, side : weights,
        (chordwise, spanwise) and (chordwise, spanwise, 2). Per width of the strip.
        """
        on_fronts, on_roots, on_tips = flow
        total = np.einsum("ijn,ij->jn", on_fronts, self.bound * front)
        total += np.einsum("ijn,ij->jn", on_tips, self.share * side[..., 1])
        total -= np.einsum("ijn,ij->jn", on_roots, self.share * side[..., 0])
        return np.asarray(total / self.width[:, None])

    def middles(self, axis: int) -> tuple[Array, Array]:
        """Along an axis of the link, the middles of the fronts and of the sides."""
        front = 0.5 * (self.corners[:-1, :, 0, axis] + self.corners[:-1, :, 1, axis])
        return front, 0.5 * (self.corners[:-1, :, :, axis] + self.corners[1:, :, :, axis])

    def moment(self, flow: tuple[Array, Array, Array]) -> Array:
        """Moment about z (spanwise, inputs) of the forces that a normal velocity makes in the plane."""
        front = 0.5 * (self.corners[:-1, :, 0] + self.corners[:-1, :, 1])
        side = 0.5 * (self.corners[:-1] + self.corners[1:])
        return self.summed(flow, np.sum(front * self.front, axis=-1), np.sum(side * self.side, axis=-1))

    def columns(self, chord_W: Array) -> Array:
        """Columns (spanwise, STRIP_COLUMNS) of the strips."""
        out = np.empty((self.width.size, STRIP_COLUMNS))
        middle_x = 0.5 * (self.corners[:, :, 0, 0] + self.corners[:, :, 1, 0])
        trailing = self.sign * (self.corners[-1, :, 1] - self.corners[-1, :, 0]) / self.width[:, None]
        out[:, EDGE_X] = middle_x[-1]
        out[:, EDGE_Y] = 0.5 * (self.corners[-1, :, 0, 1] + self.corners[-1, :, 1, 1])
        out[:, CENTRE_X] = np.sum(self.bound * middle_x[:-1], axis=0)
        out[:, EDGE_DX], out[:, EDGE_DY] = trailing[:, 0], trailing[:, 1]
        out[:, CHORD_X], out[:, CHORD_Y] = chord_W[0], chord_W[1]
        out[:, CHORD_SLOPE] = chord_W[1] / chord_W[0]
        vortex = self.share * self.area
        out[:, VORTEX_X] = np.sum(vortex * self.centre_x, axis=0) / np.sum(vortex, axis=0)
        return out


def _edges(surface: Surface, part: SurfaceLattice, share: Array) -> _Edges:
    """The bound edges of a surface; ``share`` (chordwise, spanwise) of its circulation on each ring."""
    corners_W = part.ring_corners_W - surface.elastic_axis_W
    own_y = 0.5 * part.span_sign * (part.strip_edges_m[1:] + part.strip_edges_m[:-1])
    corners = np.stack([corners_W[:, :-1], corners_W[:, 1:]], axis=2)
    corners[..., 1] -= own_y[:, None]
    width = np.diff(part.strip_edges_m)
    middle_x = 0.5 * (corners[:, :, 1, 0] + corners[:, :, 0, 0])
    return _Edges(
        corners=corners,
        front=part.span_sign * (corners[:-1, :, 1] - corners[:-1, :, 0]),
        side=part.span_sign * np.diff(corners, axis=0),
        area=(middle_x[:-1] - middle_x[1:]) * width,  # trapezia between straight strip edges
        centre_x=0.5 * (middle_x[:-1] + middle_x[1:]),
        share=share,
        bound=np.diff(share, axis=0, prepend=0.0),
        width=width,
        sign=part.span_sign,
    )


def _exchanged(gamma: Array, induced: Array, edges: _Edges, reference: Array) -> Array:
    """What the induced velocity (strips, m) of controls lacks for the right force along the chord.

    A flap's circulation is distributed along the chord unlike that of uniform incidence (the weights
    ``bound``), and meets other velocities of it than the mean: without this a deflection in two dimensions
    would have a drag or thrust in proportion to the incidence. gamma : (rows, strips, m) of the controls;
    induced : (rows, strips) velocities that a uniform flow induces at the fronts; reference : its rings.
    """
    induced = induced * edges.front[..., 1] / edges.width
    mean = np.sum(edges.bound * induced, axis=0)
    of_edges = np.diff(gamma, axis=0, prepend=0.0)
    met = np.einsum("ijm,ij->jm", of_edges, induced) - gamma[-1] * mean[:, None]
    return np.asarray(met / reference[-1][:, None])
