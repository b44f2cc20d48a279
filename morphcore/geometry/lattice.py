"""Vortex-ring lattice of one flat lifting surface in its own wing axes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from morphcore.geometry.hinge import hinge_arms, hinged_pose
from morphcore.geometry.surface import Surface
from morphdata.lattice import DEFAULT_LATTICE

Array = NDArray[np.float64]

RING_FRONT = 0.25  # of panel chord: with the control point at 3/4, exact for the flat plate in two dimensions
# three points integrate the chord squared of a tapered strip, and its drag area, exactly
STRIP_POINTS, STRIP_WEIGHTS = np.polynomial.legendre.leggauss(3)
CONTROL_POINT = 0.75  # of panel chord (Katz & Plotkin 2001, section 12.3; James 1972)


@dataclass(frozen=True)
class SurfaceLattice:
    """Panels, vortex rings and control points of one surface, uniformly spaced; oblique if it is swept.

    Row i = 0..chordwise-1 counts from the leading edge, strip j = 0..spanwise-1 from the root to the tip, on
    either side. Positions are in the surface's wing axes W (origin root mid-chord, x forward, y right, z
    down), in m.

    Attributes
    ----------
    panel_corners_W : (chordwise + 1, spanwise + 1, 3) geometric panel corners, leading edge first.
    ring_corners_W : (chordwise + 1, spanwise + 1, 3) corners of the vortex rings: their fronts at a quarter
        of each panel's chord, the aft edge of the last row on the trailing edge itself. Katz & Plotkin put
        that edge a quarter panel further aft; it cancels against the wake's first edge there as it does here,
        but the two chordwise pieces behind the trailing edge would carry a load, which a wake cannot.
    control_points_W : (chordwise, spanwise, 3) at three quarters of the panel's chord, mid panel span.
    panel_area_m2 : (chordwise, spanwise).
    strip_edges_m : (spanwise + 1,) distance of the strips' edges from the root, along the mid-chord line.
    strip_chord_m : (spanwise,) chord at mid strip.
    span_sign : +1 for a right surface, -1 for a left one. cos_sweep : cosine of its sweep.
    """

    panel_corners_W: Array
    ring_corners_W: Array
    control_points_W: Array
    panel_area_m2: Array
    strip_edges_m: Array
    strip_chord_m: Array
    span_sign: float
    cos_sweep: float = 1.0

    def __post_init__(self) -> None:
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)

    @property
    def chordwise(self) -> int:
        """Number of rows of panels."""
        return int(self.panel_area_m2.shape[0])

    @property
    def spanwise(self) -> int:
        """Number of strips."""
        return int(self.panel_area_m2.shape[1])

    @property
    def rings(self) -> int:
        """Number of rings, one a panel, numbered ``i * spanwise + j``."""
        return int(self.panel_area_m2.size)

    @property
    def area_m2(self) -> float:
        """Planform area."""
        return float(self.panel_area_m2.sum())

    @property
    def panel_size_m(self) -> float:
        """Smaller of a panel's mean chord and width: the reference length of the core "line"."""
        width = float(self.strip_edges_m[1] - self.strip_edges_m[0])
        return min(self.mean_chord_m / self.chordwise, width * self.cos_sweep)

    @property
    def mean_chord_m(self) -> float:
        """Mean chord: the reference length of the core "smoothed"."""
        return float(self.strip_chord_m.mean())


def surface_lattice(
    surface: Surface,
    chordwise: int = DEFAULT_LATTICE.chordwise,
    spanwise: int = DEFAULT_LATTICE.spanwise,
    hidden_m: float = 0.0,
) -> SurfaceLattice:
    """Lattice of ``chordwise`` x ``spanwise`` panels of uniform spacing on a surface's mid-plane.

    hidden_m : length from the root on that is inside another panel (`Surface.hidden_m`), without a lattice.
    """
    edges = np.linspace(hidden_m, surface.length_m, spanwise + 1)
    cos_sweep = float(surface.chord_W[0])
    middles = 0.5 * (edges[1:] + edges[:-1])
    rows = np.arange(chordwise)
    panel_chordwise = np.arange(chordwise + 1) / chordwise
    ring_chordwise = np.append((rows + RING_FRONT) / chordwise, 1.0)
    at_edges = (surface.chord_at(edges), surface.aft_at(edges))
    at_middles = (surface.chord_at(middles), surface.aft_at(middles))
    if surface.stations is not None:  # strips are straight between their edges, whatever lies between
        at_middles = (_means(at_edges[0]), _means(at_edges[1]))
    panel_corners_W = _points(surface, panel_chordwise, edges, *at_edges)
    strip_width = np.diff(edges) * cos_sweep
    strip_chord = at_middles[0]
    return SurfaceLattice(
        panel_corners_W=panel_corners_W,
        ring_corners_W=_points(surface, ring_chordwise, edges, *at_edges),
        control_points_W=_points(surface, (rows + CONTROL_POINT) / chordwise, middles, *at_middles),
        panel_area_m2=np.tile(strip_chord * strip_width / chordwise, (chordwise, 1)),
        strip_edges_m=edges,
        strip_chord_m=strip_chord,
        span_sign=surface.span_sign,
        cos_sweep=cos_sweep,
    )


def surface_pose(surface: Surface, hinge_rad: ArrayLike | None = None) -> tuple[Array, Array]:
    """Pose of an undeformed surface for angles (m,) of its hinges, rad; None: all hinges at rest.

    Returns
    -------
    R_BW : (3, 3), wing components to body components.
    r_B : (3,) origin of W (root mid-chord) from the fuselage reference point, m.
    """
    angles = np.zeros(len(surface.hinges)) if hinge_rad is None else np.asarray(hinge_rad, dtype=np.float64)
    arms = hinge_arms(surface.hinges, np.array(surface.position_m))
    R_BW, r_B = hinged_pose(surface.hinges, arms, angles[None], surface.rest_R_BW)
    return R_BW[0], r_B[0]


def chord_points(surface: Surface, chord_fraction: Array, distance_m: Array) -> Array:
    """Points (rows, columns, 3) in W at chord fractions from the leading edge and distances from the root."""
    return _points(
        surface, chord_fraction, distance_m, surface.chord_at(distance_m), surface.aft_at(distance_m)
    )


def strip_areas(surface: Surface, part: SurfaceLattice) -> Array:
    """What a telescoping surface's loads need of each strip: (strips, 4), columns INBOARD to AREA_CHORD.

    Its ends, m from the root; its area weighted by `Surface.drag_share_at`, m^2; the integral of its chord
    squared, m^3. See aero/kernels/loads.py.
    """
    inboard, outboard = part.strip_edges_m[:-1], part.strip_edges_m[1:]
    half = 0.5 * (outboard - inboard)
    at = 0.5 * (inboard + outboard) + half * STRIP_POINTS[:, None]
    chord = surface.chord_at(at)
    width = STRIP_WEIGHTS[:, None] * half * part.cos_sweep
    area, squared = ((width * each).sum(axis=0) for each in (chord * surface.drag_share_at(at), chord**2))
    return np.stack([inboard, outboard, area, squared], axis=1)


def _means(values: Array) -> Array:
    return np.asarray(0.5 * (values[1:] + values[:-1]))


def _points(surface: Surface, chord_fraction: Array, distance_m: Array, chord: Array, aft: Array) -> Array:
    """Points (rows, columns, 3) in W at chord fractions from the leading edge and distances from the root.

    chord, aft : (columns,) chord, and mid-chord aft of the root's, there, m.
    """
    forward = (0.5 - chord_fraction)[:, None] * chord - aft
    points = forward[..., None] * surface.chord_W
    points[..., 1] += surface.span_sign * distance_m
    return points
