r"""The lattice of a whole aircraft, reduced to an operator on the links' motion.

With the lattice frozen on the undeformed surfaces (at their hinge angles) and its wake along a fixed
direction, the circulations are linear in the normal velocity of the structure, and on a flat link that
velocity is ``w(x) = D0 + D1 x`` along each strip. So the whole lattice is one matrix from (D0, D1) of the
strips to five numbers for each strip (rows as listed in aero/kernels/loads.py), from which the forces on all
bound edges follow.

Kutta-Joukowski on a ring of circulation G in the flow U = induced velocity - velocity of the structure:

- In the flow of a rigid motion, a *closed* ring experiences no net force, only the moment rho G A (n x U).
  Only the rings at the trailing edge are open (wake and last edge cancel), which leaves the force rho G_te U
x l at the trailing edge. Hence normal force and moments from ``g = G_te dy``, ``S = sum G_i A_i`` and ``X =
  sum G_i A_i x_i``.
- The normal velocity on the edges gives the forces in the plane of the surface. They are products of
  circulation and induced velocity, both distributed along the chord; here the induced velocity of a strip is
  averaged with the chordwise distribution of the circulation in uniform incidence, which is exact there and
  of second order elsewhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.kernels.loads import OUTPUTS
from morphcore.aero.vlm import RingTable, influence, ring_table
from morphcore.geometry.aircraft import Aircraft
from morphcore.geometry.control_slopes import ControlSlopes, control_slopes
from morphcore.geometry.lattice import SurfaceLattice, surface_lattice, surface_pose
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
    velocities but have no outputs of their own. table : rings of the surfaces, then of the images.
    slopes : of the control surfaces.
    """

    aircraft: Aircraft
    settings: Lattice
    lattices: tuple[SurfaceLattice, ...]
    images: tuple[Surface, ...]
    table: RingTable
    strip0: tuple[int, ...]
    strips: int
    slopes: ControlSlopes

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
    def operator_shape(self) -> tuple[int, int]:
        """Rows and columns of the operator, padded to whole tiles."""
        chordwise = sum(end - low for _, low, end in self.control_inputs)
        return (
            -(-OUTPUTS * self.strips // ROW_MULTIPLE) * ROW_MULTIPLE,
            -(-(2 * self.strips + chordwise) // COLUMN_MULTIPLE) * COLUMN_MULTIPLE,
        )


@dataclass(frozen=True)
class LatticeOperator:
    """One reduced operator.

    matrix : (rows, columns) as ``operator_shape``. strips : (strips, 3): x of the trailing edge and of the
    centre of circulation of each strip from the link axis (the elastic axis), m; slope dx/dy of its trailing
    edge in link axes. controls : (rows, m) columns of the parts of the controls, `ControlSlopes`, for unit
    deflection; see `AircraftLattice.control_columns`.
    """

    matrix: Array
    strips: Array
    controls: Array


def aircraft_lattice(
    aircraft: Aircraft, settings: Lattice = DEFAULT_LATTICE, images: Sequence[Surface] = ()
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
    )


def lattice_operator(
    lattice: AircraftLattice,
    hinge_rad: Sequence[float],
    *,
    mach: float = 0.0,
    wake_direction_B: Sequence[float] = BODY_AFT,
) -> LatticeOperator:
    """The reduced operator for given angles (h,) of all hinges, rad."""
    aircraft, angles = lattice.aircraft, np.asarray(hinge_rad, dtype=np.float64)
    if angles.shape != (len(aircraft.hinges),):
        raise ValueError(f"{angles.size} angles for {len(aircraft.hinges)} hinges")
    poses = [
        surface_pose(surface, angles[own])
        for surface, own in zip(aircraft.surfaces, aircraft.hinge_columns, strict=True)
    ]
    corners, controls, fronts, sides, normals = [], [], [], [], []
    for (R_BW, r_B), part in zip(poses, lattice.lattices, strict=True):
        ring = part.ring_corners_W @ R_BW.T + r_B
        corners.append(ring.reshape(-1, 3))
        controls.append((part.control_points_W @ R_BW.T + r_B).reshape(-1, 3))
        fronts.append((0.5 * (ring[:-1, :-1] + ring[:-1, 1:])).reshape(-1, 3))
        sides.append((0.5 * (ring[:-1] + ring[1:])).reshape(-1, 3))
        normals.append(R_BW[:, 2])
    corners += [ring * ACROSS for ring in corners if lattice.images]
    groups = (controls, fronts, sides)
    points = np.concatenate([part for group in groups for part in group])
    velocity = influence(
        points, np.concatenate(corners), lattice.table, wake_direction_B, lattice.settings.core, mach
    )
    normal = np.concatenate(
        [
            np.repeat(n[None, :], part.shape[0], axis=0)
            for group in groups
            for n, part in zip(normals, group, strict=True)
        ]
    )
    induced = np.einsum("pa,arp->pr", normal, velocity)  # normal velocity, (points, rings)
    rings = lattice.rings
    if lattice.images:  # an image has the circulation of its original
        induced = induced[:, :rings] + induced[:, rings:]
    circulation = np.linalg.solve(induced[:rings], _boundary(lattice))  # (rings, inputs)
    downwash = induced[rings:] @ circulation
    return _reduced(lattice, circulation, downwash)


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
        x = part.control_points_W[..., 0] - surface.elastic_axis_x_m
        for k in np.flatnonzero((slopes.strip >= strip0) & (slopes.strip < strip0 + part.spanwise)):
            rings = ring + slopes.strip[k] - strip0 + part.spanwise * np.arange(part.chordwise)
            out[rings, motions + k] = slopes.slope[k]
        for i in range(part.chordwise):
            for j in range(part.spanwise):
                out[ring, 2 * (strip0 + j)] = 1.0
                out[ring, 2 * (strip0 + j) + 1] = x[i, j]
                ring += 1
    return out


def _reduced(lattice: AircraftLattice, circulation: Array, downwash: Array) -> LatticeOperator:
    rows, columns = lattice.operator_shape
    matrix = np.zeros((rows, columns))
    strips = np.zeros((lattice.strips, 3))
    motions, controls = 2 * lattice.strips, np.zeros((rows, lattice.slopes.parts))
    uniform = circulation[:, :motions:2].sum(axis=1)  # every strip at the same incidence
    inputs = circulation.shape[1]
    ring = 0
    side0 = lattice.rings
    for surface, part, strip0 in zip(
        lattice.aircraft.surfaces, lattice.lattices, lattice.strip0, strict=True
    ):
        shape = (part.chordwise, part.spanwise)
        count = part.rings
        side_count = part.chordwise * (part.spanwise + 1)
        gamma = circulation[ring : ring + count].reshape(*shape, inputs)
        reference = uniform[ring : ring + count].reshape(shape)
        front = downwash[ring : ring + count].reshape(*shape, inputs)
        side = downwash[side0 : side0 + side_count].reshape(part.chordwise, part.spanwise + 1, inputs)
        ring, side0 = ring + count, side0 + side_count

        corners = part.ring_corners_W - np.array([surface.elastic_axis_x_m, 0.0, 0.0])
        width = np.diff(part.strip_edges_m)
        edge_x = corners[..., 0]
        middle_x = 0.5 * (edge_x[:, 1:] + edge_x[:, :-1])
        area = (middle_x[:-1] - middle_x[1:]) * width  # of the rings, trapezia between straight strip edges
        centre_x = 0.5 * (middle_x[:-1] + middle_x[1:])
        length = 0.5 * (edge_x[:-1, 1:] + edge_x[:-1, :-1] - edge_x[1:, 1:] - edge_x[1:, :-1])
        bound = np.diff(reference, axis=0, prepend=0.0) / reference[-1]
        chordwise_share = reference / reference[-1]

        row = OUTPUTS * strip0 + OUTPUTS * np.arange(part.spanwise)
        found = np.zeros((part.spanwise, OUTPUTS, inputs))
        found[:, 0] = gamma[-1] * width[:, None]
        found[:, 1] = np.einsum("ijn,ij->jn", gamma, area)
        found[:, 2] = np.einsum("ijn,ij->jn", gamma, area * centre_x)
        found[:, 3] = np.einsum("ijn,ij->jn", front, bound)
        jump = part.span_sign * np.diff(side, axis=1)
        found[:, 4] = np.einsum("ijn,ij->jn", jump, chordwise_share * length) / width[:, None]
        if lattice.slopes.parts:
            found[:, 3, motions:] += _exchanged(
                gamma[..., motions:], front[..., :motions:2], bound, reference
            )
        for output in range(OUTPUTS):
            matrix[row + output, :motions] = found[:, output, :motions]
            controls[row + output] = found[:, output, motions:]
        strips[strip0 : strip0 + part.spanwise, 0] = middle_x[-1]
        strips[strip0 : strip0 + part.spanwise, 1] = np.sum(bound * middle_x[:-1], axis=0)
        strips[strip0 : strip0 + part.spanwise, 2] = np.diff(edge_x[-1]) / (part.span_sign * width)
    return LatticeOperator(matrix, strips, controls)


def _exchanged(gamma: Array, front: Array, bound: Array, reference: Array) -> Array:
    """What the induced velocity (strips, m) of controls lacks for the right force along the chord.

    A flap's circulation is distributed along the chord unlike that of uniform incidence (the weights
    ``bound``), and meets other velocities of it than the mean: without this a deflection in two dimensions
    would have a drag or thrust in proportion to the incidence. gamma : (rows, strips, m) of the controls;
    front : (rows, strips, strips) induced velocities of unit incidence; reference : (rows, strips) its rings.
    """
    induced = front.sum(axis=2)
    mean = np.sum(bound * induced, axis=0)
    of_edges = np.diff(gamma, axis=0, prepend=0.0)
    met = np.einsum("ijm,ij->jm", of_edges, induced) - gamma[-1] * mean[:, None]
    return np.asarray(met / reference[-1][:, None])
