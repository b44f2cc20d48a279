"""Vortex-ring lattice of one flat, tapered lifting surface in its own wing axes, and its settings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from morphcore.errors import InvalidInput
from morphcore.frames import axis_rotation
from morphcore.geometry.fields import Fields, WholeNumbers
from morphcore.geometry.surface import Surface

Array = NDArray[np.float64]

CHORDWISE_PANELS = 4
SPANWISE_PANELS = 10
RING_FRONT = 0.25  # of panel chord: with the control point at 3/4, exact for the flat plate in two dimensions
CONTROL_POINT = 0.75  # of panel chord (Katz & Plotkin 2001, section 12.3; James 1972)

CoreLaw = Literal["line", "smoothed"]

CORE_LAWS: tuple[CoreLaw, ...] = ("line", "smoothed")
# Core radius of "line" as a fraction of the smaller side of a panel (2.5 per cent of the chord at four rows).
# Control points lie half a panel from their own ring's edges: Vatistas's factor there is
# 1 - (0.1 / 0.5)^4 / 2, so it moves the self-influence by less than 1e-3, while a leg that strikes a control
# point induces no more than gamma / (2 sqrt(2) pi core).
LINE_CORE = 0.1
# Cut-off of "smoothed" as a fraction of the surface's mean chord, as programs with this law commonly have it.
# A panel of 1/4 chord has its control point 2.5 cut-offs from its edges: the self-influence is damped, and
# the lift comes out too high (docs/physics.md has the figure).
SMOOTHED_CORE = 0.05
LARGEST_CORE = 0.5  # of either length; in documents


@dataclass(frozen=True)
class VortexCore:
    """Law that keeps the velocity of a vortex finite, and its length.

    Attributes
    ----------
    law : "line", Vatistas's factor of the distance from the vortex's line; or "smoothed", a cut-off in the
        denominator of the product form (both in aero/kernels/vortex.py).
    fraction : the core's radius over the smaller side of a panel ("line") or over the mean chord of the
        surface ("smoothed"), above 0; None for the law's default.
    """

    law: CoreLaw = "line"
    fraction: float | None = None

    def __post_init__(self) -> None:
        if self.law not in CORE_LAWS:
            raise InvalidInput(
                f"the vortex core's law is {self.law!r}",
                pointer="/model/lattice/core/law",
                hint=f"use one of {', '.join(CORE_LAWS)}",
            )
        if not self.radius_fraction > 0.0:
            raise InvalidInput(
                f"the vortex core is {self.fraction}, not above 0",
                pointer="/model/lattice/core/fraction",
                hint="leave it out for the default",
            )

    @property
    def radius_fraction(self) -> float:
        """The fraction that holds, given or default."""
        if self.fraction is not None:
            return self.fraction
        return LINE_CORE if self.law == "line" else SMOOTHED_CORE


DEFAULT_CORE = VortexCore()


@dataclass(frozen=True)
class LatticeSettings(WholeNumbers):
    """Panels of every surface, along chord and span, and the core of their vortices."""

    chordwise: int = CHORDWISE_PANELS
    spanwise: int = SPANWISE_PANELS
    core: VortexCore = DEFAULT_CORE

    def to_document(self) -> dict[str, Any]:
        """JSON form, as ``lattice_settings`` reads it, with the core's fraction that holds."""
        core = {"law": self.core.law, "fraction": self.core.radius_fraction}
        return {"chordwise": self.chordwise, "spanwise": self.spanwise, "core": core}


DEFAULT_LATTICE = LatticeSettings()


def lattice_settings(document: dict[str, Any], pointer: str = "/model/lattice") -> LatticeSettings:
    """Read ``{"chordwise", "spanwise", "core": {"law", "fraction"}}``; all may be left out."""
    fields = Fields(document, pointer)
    core = fields.optional_child("core")
    default = DEFAULT_LATTICE
    settings = LatticeSettings(
        chordwise=fields.whole("chordwise", default=default.chordwise, least=1, most=8),
        spanwise=fields.whole("spanwise", default=default.spanwise, least=4, most=20),
        core=VortexCore(
            law=core.choice("law", CORE_LAWS, default=default.core.law),  # type: ignore[arg-type]
            fraction=core.optional_number("fraction", above=0.0, most=LARGEST_CORE),
        ),
    )
    core.done()
    fields.done()
    return settings


@dataclass(frozen=True)
class SurfaceLattice:
    """Panels, vortex rings and control points of one surface, uniformly spaced.

    Row i = 0..chordwise-1 counts from the leading edge, strip j = 0..spanwise-1 from the root to the tip, on
    either side. Positions are in the surface's wing axes W (origin root mid-chord, x forward, y right, z
    down), in m.

    Attributes
    ----------
    panel_corners_W : (chordwise + 1, spanwise + 1, 3) geometric panel corners, leading edge first.
    ring_corners_W : (chordwise + 1, spanwise + 1, 3) corners of the vortex rings: their fronts at a quarter
        of each panel's chord, the aft edge of the last row on the trailing edge itself. Katz & Plotkin put
        that edge a quarter panel further aft; there it cancels against the wake's first edge just as it does
        here, but the two chordwise pieces behind the trailing edge would carry a load that a wake cannot
        carry.
    control_points_W : (chordwise, spanwise, 3) at three quarters of the panel's chord, mid panel span.
    panel_area_m2 : (chordwise, spanwise).
    strip_edges_m : (spanwise + 1,) distance of the strips' edges from the root.
    strip_chord_m : (spanwise,) chord at mid strip.
    span_sign : +1 for a right surface, -1 for a left one.
    """

    panel_corners_W: Array
    ring_corners_W: Array
    control_points_W: Array
    panel_area_m2: Array
    strip_edges_m: Array
    strip_chord_m: Array
    span_sign: float

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
        """Smaller of a panel's mean chord and width: the length to which the core "line" is referred."""
        return min(self.mean_chord_m / self.chordwise, float(self.strip_edges_m[1]))

    @property
    def mean_chord_m(self) -> float:
        """Mean chord: the length to which the core "smoothed" is referred."""
        return float(self.strip_chord_m.mean())


def surface_lattice(
    surface: Surface, chordwise: int = CHORDWISE_PANELS, spanwise: int = SPANWISE_PANELS
) -> SurfaceLattice:
    """Lattice of ``chordwise`` x ``spanwise`` panels of uniform spacing on a surface's mid-plane."""
    edges = np.linspace(0.0, surface.span_m, spanwise + 1)
    middles = 0.5 * (edges[1:] + edges[:-1])
    rows = np.arange(chordwise)
    panel_chordwise = np.arange(chordwise + 1) / chordwise
    ring_chordwise = np.append((rows + RING_FRONT) / chordwise, 1.0)
    panel_corners_W = _points(surface, panel_chordwise, edges)
    strip_width = np.diff(edges)
    strip_chord = surface.chord_at(middles)
    return SurfaceLattice(
        panel_corners_W=panel_corners_W,
        ring_corners_W=_points(surface, ring_chordwise, edges),
        control_points_W=_points(surface, (rows + CONTROL_POINT) / chordwise, middles),
        panel_area_m2=np.tile(strip_chord * strip_width / chordwise, (chordwise, 1)),
        strip_edges_m=edges,
        strip_chord_m=strip_chord,
        span_sign=surface.span_sign,
    )


def surface_pose(surface: Surface, hinge_rad: float = 0.0) -> tuple[Array, Array]:
    """Place of an undeformed surface for a hinge coordinate.

    Returns
    -------
    R_BW : (3, 3), wing components to body components.
    r_B : (3,) origin of W (root mid-chord) from the fuselage reference point, m.
    """
    root_B = np.array(surface.position_m)
    if surface.hinge is None:
        return np.eye(3), root_B
    hinge_B = np.array(surface.hinge.position_m)
    R_BW = axis_rotation(surface.hinge.axis_index, surface.rotation_sign * hinge_rad)
    return R_BW, hinge_B + R_BW @ (root_B - hinge_B)


def _points(surface: Surface, chord_fraction: Array, distance_m: Array) -> Array:
    """Points (rows, columns, 3) in W at chord fractions from the leading edge and distances from the root."""
    chord = surface.chord_at(distance_m)
    points = np.zeros((chord_fraction.size, distance_m.size, 3))
    points[..., 0] = (0.5 - chord_fraction)[:, None] * chord
    points[..., 1] = surface.span_sign * distance_m
    return points
