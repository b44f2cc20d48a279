"""Wings for the aerodynamic tests: pairs of surfaces without hinge or gap, warped at will."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.polar import steady_edges
from morphcore.aero.vlm import RingTable, ring_table
from morphcore.geometry.aircraft import Aircraft
from morphcore.geometry.lattice import surface_lattice
from morphdata.lattice import DEFAULT_CORE, VortexCore
from tests.models.chains import aircraft_of

Array = NDArray[np.float64]
Warp = Callable[[Array], Array]

EXAMPLES = Path(__file__).parents[2] / "examples"
DEGREE = np.pi / 180


def straight_wings(semi_span: float, root_chord: float, tip_chord: float, gap: float = 0.0) -> Aircraft:
    """Two fixed straight wings, right and left, ``gap`` metres apart."""
    document = json.loads((EXAMPLES / "aircraft.json").read_text(encoding="utf-8"))
    for surface in document["surfaces"]:
        side = 1.0 if surface["side"] == "right" else -1.0
        del surface["hinge"], surface["chord_m"]
        surface |= {
            "span_m": semi_span,
            "root_chord_m": root_chord,
            "tip_chord_m": tip_chord,
            "position_m": [0.0, side * gap / 2, 0.0],
        }
    return aircraft_of(document)


@dataclass(frozen=True)
class Lattice:
    """Ring corners (c, 3), control points (r, 3) and table of a pair of wings."""

    corners_B: Array
    controls_B: Array
    table: RingTable


def lattice(aircraft: Aircraft, panels: tuple[int, int], warp: Warp = lambda points: points) -> Lattice:
    """Lattice of fixed surfaces whose points (n, 3) in B are moved by ``warp``."""
    parts = [surface_lattice(surface, *panels) for surface in aircraft.surfaces]
    roots = [np.array(surface.position_m) for surface in aircraft.surfaces]
    corners = [p.ring_corners_W.reshape(-1, 3) + r for p, r in zip(parts, roots, strict=True)]
    controls = [p.control_points_W.reshape(-1, 3) + r for p, r in zip(parts, roots, strict=True)]
    return Lattice(warp(np.concatenate(corners)), warp(np.concatenate(controls)), ring_table(parts))


def sheared(sweep_rad: float) -> Warp:
    """Sweep with sections that stay in the stream."""

    def warp(points: Array) -> Array:
        moved = points.copy()
        moved[:, 0] -= np.abs(points[:, 1]) * np.tan(sweep_rad)
        return moved

    return warp


def elliptic(semi_span: float) -> Warp:
    """Chords that follow an ellipse over the span, about a straight mid-chord line."""

    def warp(points: Array) -> Array:
        moved = points.copy()
        moved[:, 0] *= np.sqrt(np.maximum(1.0 - (points[:, 1] / semi_span) ** 2, 0.0))
        return moved

    return warp


def lift_and_drag(
    wing: Lattice, alpha_rad: float, area: float, *, core: VortexCore = DEFAULT_CORE, mach: float = 0.0
) -> tuple[float, float, Array]:
    """Lift and induced drag coefficients and the circulations (r,) at 1 m/s."""
    flow_B = -np.array([np.cos(alpha_rad), 0.0, np.sin(alpha_rad)])
    circulation, edges = steady_edges(
        wing.corners_B, wing.controls_B, wing.table, flow_B, 1.0, core=core, mach=mach
    )
    force_B = edges.force_B.sum(axis=0)
    up_B = np.array([np.sin(alpha_rad), 0.0, -np.cos(alpha_rad)])
    return float(force_B @ up_B) / (0.5 * area), float(force_B @ flow_B) / (0.5 * area), circulation
