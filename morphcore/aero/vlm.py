"""Vortex-ring lattice of any number of surfaces in any position: numbering and influence.

The lattice takes any ring corners, control points and local air velocities, deformed or not; it is
independent of links, beams and hinges. Conventions: all vectors in B (forward, right, down); *flow* is the
velocity of the air relative to the structure, excluding the velocity induced by the lattice itself, m/s (for
a body at rest in a head wind V it is (-V, 0, 0)); the circulation of a ring (m^2/s) is positive where it
lifts, toward -z of the wing, on both sides.

Source: Katz & Plotkin (2001), chapter 12.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from morphcore.aero.kernels.influence import ring_influence
from morphcore.errors import InvalidInput, UnsupportedRegime
from morphcore.geometry.lattice import SurfaceLattice
from morphdata.flight import MACH_LIMIT
from morphdata.lattice import DEFAULT_CORE, VortexCore

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True)
class RingTable:
    """Topology of a lattice, unaffected by deformation: which edge belongs to which rings and panels.

    Corners, rings and edges of all surfaces are numbered consecutively, surface by surface. Within a surface,
    corners are ``i * (spanwise + 1) + j``, rings and panels ``i * spanwise + j`` (row i from the leading
    edge, strip j from the root); edges first the rings' fronts (i, j) from root to tip, then the chordwise
    ones (i, j), front to aft.

    Attributes (c corners, r rings, e bound edges, l wake legs, s surfaces)
    ----------
    edge_start, edge_end : (e,) corners of each bound edge.
    edge_plus, edge_minus : (e,) the ring whose circulation runs along the edge, and the one against it; -1:
    none.
    edge_panel : (e, 2) the panels that carry the edge's force in equal parts (the same panel twice at root,
    tip and fronts).
    leg_start, leg_plus, leg_minus : (l,) trailing-edge corner and rings of each wake leg.
    leg_width_m : (l,) width of the wider strip beside each leg.
    edge_surface, leg_surface : (e,), (l,) surface of each edge and leg.
    panel_size_m, mean_chord_m : (s,) of each surface, the reference lengths of the two core laws.
    ring_corner : (r, 4) corners of each ring: root front, tip front, root aft, tip aft.
    panel_surface, panel_row : (r,) surface and row of each panel.
    panel_side : (r,) +1 on right surfaces, -1 on left ones.
    corners : number c of corners.
    """

    edge_start: IntArray
    edge_end: IntArray
    edge_plus: IntArray
    edge_minus: IntArray
    edge_panel: IntArray
    leg_start: IntArray
    leg_plus: IntArray
    leg_minus: IntArray
    leg_width_m: Array
    edge_surface: IntArray
    leg_surface: IntArray
    panel_size_m: Array
    mean_chord_m: Array
    ring_corner: IntArray
    panel_surface: IntArray
    panel_row: IntArray
    panel_side: Array
    corners: int

    def __post_init__(self) -> None:
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)

    @property
    def rings(self) -> int:
        """Number of rings."""
        return int(self.panel_surface.size)

    @property
    def edges(self) -> int:
        """Number of bound edges."""
        return int(self.edge_start.size)

    def core_radius_m(self, core: VortexCore) -> Array:
        """Radius (s,) of a core on every surface, m."""
        return core.radius_fraction * (self.panel_size_m if core.law == "line" else self.mean_chord_m)


def ring_table(lattices: Sequence[SurfaceLattice]) -> RingTable:
    """Number the corners, rings and edges of some surfaces consecutively."""
    parts: list[dict[str, NDArray[Any]]] = []
    corner, ring = 0, 0
    for index, lattice in enumerate(lattices):
        parts.append(_surface_table(lattice, index, corner, ring))
        corner += (lattice.chordwise + 1) * (lattice.spanwise + 1)
        ring += lattice.rings
    joined = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    return RingTable(**joined, corners=corner)


def influence(
    points_B: ArrayLike,
    corners_B: ArrayLike,
    table: RingTable,
    wake_direction_B: ArrayLike,
    core: VortexCore = DEFAULT_CORE,
    mach: float = 0.0,
) -> Array:
    """Velocity induced at every point by every ring of unit circulation with its straight wake.

    Parameters
    ----------
    points_B : (p, 3) m. corners_B : (c, 3) ring corners in the order of the table, m.
    wake_direction_B : (3,) direction of the free stream, from nose to tail; any length.
    core : law and size of the vortices' cores.
    mach : of the free stream. Goethert's rule: the geometry is stretched along the free stream by 1 / beta,
        beta^2 = 1 - mach^2, and the velocity along it by 1 / beta.

    Returns
    -------
    velocity_B : (3, r, p), 1/m; the point index is the contiguous one.

    Raises
    ------
    UnsupportedRegime : the Mach number is beyond 0.7.
    InvalidInput : the number of corners differs from the table's.
    """
    u_B = np.asarray(wake_direction_B, dtype=np.float64)
    u_B = u_B / np.sqrt(u_B @ u_B)
    stretch = 1.0 / prandtl_glauert(mach)
    points = np.array(points_B, dtype=np.float64).reshape(-1, 3)
    corners = np.array(corners_B, dtype=np.float64).reshape(-1, 3)
    if corners.shape[0] != table.corners:
        raise InvalidInput(f"{corners.shape[0]} corners, but the lattice has {table.corners}")
    if stretch > 1.0:
        points += (stretch - 1.0) * (points @ u_B)[:, None] * u_B
        corners += (stretch - 1.0) * (corners @ u_B)[:, None] * u_B
    radius = table.core_radius_m(core)
    out = np.empty((3, table.rings, points.shape[0]))
    ring_influence(
        np.ascontiguousarray(points.T),
        corners,
        table.edge_start,
        table.edge_end,
        table.edge_plus,
        table.edge_minus,
        radius[table.edge_surface],
        table.leg_start,
        table.leg_plus,
        table.leg_minus,
        radius[table.leg_surface],
        table.leg_width_m,
        table.mean_chord_m[table.leg_surface],
        core.law == "smoothed",
        u_B,
        np.empty((3, points.shape[0])),
        out,
    )
    if stretch > 1.0:
        along = np.einsum("a,arp->rp", u_B, out)
        out += (stretch - 1.0) * u_B[:, None, None] * along
    return out


def prandtl_glauert(mach: float) -> float:
    """beta = sqrt(1 - mach^2).

    Raises
    ------
    UnsupportedRegime : the Mach number is beyond 0.7.
    """
    if not 0.0 <= mach <= MACH_LIMIT:
        raise UnsupportedRegime(
            f"Mach {mach:.2f} is outside 0..{MACH_LIMIT}, where linear compressibility holds",
            pointer="/flight/mach",
            hint="lower the airspeed, or omit mach for incompressible flow",
        )
    return float(np.sqrt(1.0 - mach**2))


def _surface_table(lattice: SurfaceLattice, index: int, corner: int, ring: int) -> dict[str, NDArray[Any]]:
    """One surface's part of a RingTable; ``corner`` and ``ring`` are its first numbers."""
    rows, strips = lattice.chordwise, lattice.spanwise
    corners = corner + np.arange((rows + 1) * (strips + 1)).reshape(rows + 1, strips + 1)
    rings = ring + np.arange(rows * strips).reshape(rows, strips)
    bordered = np.full((rows + 1, strips + 2), -1)
    bordered[1:, 1:-1] = rings
    # a ring runs along its front to the tip, aft along its tip side, and back;
    # bordered[i + 1, j + 1] is ring (i, j), framed by -1 for "no ring"
    front, ahead = bordered[1:, 1:-1], bordered[:-1, 1:-1]
    inboard, outboard = bordered[1:, :-1], bordered[1:, 1:]
    plus = np.concatenate([front.ravel(), inboard.ravel()])
    minus = np.concatenate([ahead.ravel(), outboard.ravel()])
    leg_plus, leg_minus = inboard[-1], outboard[-1]
    bordering = np.stack([inboard.ravel(), outboard.ravel()], axis=1)
    bordering = np.where(bordering < 0, bordering[:, ::-1], bordering)
    if lattice.span_sign < 0:  # the strips run to the left, so lifting circulation runs from tip to root
        plus, minus = minus, plus
        leg_plus, leg_minus = leg_minus, leg_plus
    start = np.concatenate([corners[:-1, :-1].ravel(), corners[:-1].ravel()])
    end = np.concatenate([corners[:-1, 1:].ravel(), corners[1:].ravel()])
    width = np.diff(lattice.strip_edges_m)
    quarters = (corners[:-1, :-1], corners[:-1, 1:], corners[1:, :-1], corners[1:, 1:])
    return {
        "edge_start": start,
        "edge_end": end,
        "edge_plus": plus,
        "edge_minus": minus,
        "edge_panel": np.concatenate([np.repeat(rings.reshape(-1, 1), 2, axis=1), bordering]),
        "leg_start": corners[-1],
        "leg_plus": leg_plus,
        "leg_minus": leg_minus,
        "leg_width_m": np.maximum(np.append(width, 0.0), np.append(0.0, width)),
        "edge_surface": np.full(start.size, index),
        "leg_surface": np.full(strips + 1, index),
        "panel_size_m": np.array([lattice.panel_size_m]),
        "mean_chord_m": np.array([lattice.mean_chord_m]),
        "ring_corner": np.stack([quarter.ravel() for quarter in quarters], axis=1),
        "panel_surface": np.full(rows * strips, index),
        "panel_row": np.repeat(np.arange(rows), strips),
        "panel_side": np.full(rows * strips, lattice.span_sign),
    }
