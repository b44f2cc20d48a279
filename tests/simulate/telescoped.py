"""A small aircraft with telescoping wings, and the same aircraft with fixed wings of the visible span."""

from __future__ import annotations

from typing import Any

SIDES = (("right", 1.0), ("left", -1.0))
ROOT_M, INNER_M, PANEL_M, HIDDEN_M = 0.35, 1.6, 1.8, 1.0  # body to root, inner panel, outer panel, hidden
MATERIAL = {
    "density_kg_m3": 500.0,
    "youngs_modulus_pa": 2.1e9,
    "poisson_ratio": 0.3,
    "stiffness_damping_s": 0.004,
}
FLIGHT = {"airspeed_m_s": 80.0, "air_density_kg_m3": 1.225, "mach": 0.0}
FUSELAGE = {"length_m": 5.0, "width_m": 0.7, "height_m": 0.5, "density_kg_m3": 200.0}
MOUTH_M = ROOT_M + INNER_M


def panel(name: str, side: str, span_m: float, y_m: float, **fields: Any) -> dict[str, Any]:
    """Return a surface as a document."""
    return {
        "name": f"{side} {name}",
        "side": side,
        "span_m": span_m,
        "chord_m": 0.3,
        "thickness_m": 0.08,
        "material": MATERIAL,
        "profile_drag": 0.01,
        "position_m": [0.0, y_m, 0.0],
        "flexible": False,
        **fields,
    }


def telescoped(held_m: float = 0.0, **outer: Any) -> dict[str, Any]:
    """Return an aircraft whose outer panels slide out of the inner ones; ``outer``: fields of these."""
    surfaces = []
    for side, sign in SIDES:
        hinge = {
            "kind": "prismatic",
            "position_m": [0.0, sign * MOUTH_M, 0.0],
            "max_m": HIDDEN_M,
            "extension_m": held_m,
        }
        root = sign * (MOUTH_M - HIDDEN_M)
        surfaces.append(panel("inner", side, INNER_M, sign * ROOT_M))
        surfaces.append(panel("outer", side, PANEL_M, root, **{"hinges": [hinge], **outer}))
    return {"name": "telescope", "fuselage": FUSELAGE, "surfaces": surfaces}


def with_fixed_span(extension_m: float) -> dict[str, Any]:
    """Return the aircraft with its visible span fixed; what is hidden of the panels' mass is a point mass."""
    surfaces, masses = [], []
    visible = PANEL_M - HIDDEN_M + extension_m
    for side, sign in SIDES:
        surfaces.append(panel("inner", side, INNER_M, sign * ROOT_M))
        surfaces.append(panel("outer", side, visible, sign * MOUTH_M))
        hidden = HIDDEN_M - extension_m
        if hidden > 0.0:
            mass = 500.0 * 0.3 * 0.08 * hidden
            masses.append({"mass_kg": mass, "position_m": [0.0, sign * (MOUTH_M - 0.5 * hidden), 0.0]})
    fixed = {"name": "fixed", "fuselage": FUSELAGE, "surfaces": surfaces}
    return fixed | ({"point_masses": masses} if masses else {})


def extended(start_m: float, end_m: float, begin_s: float = 0.1, end_s: float = 0.5) -> dict[str, Any]:
    """Return the schedule of an extension."""
    return {"kind": "spline", "knot_time_s": [begin_s, end_s], "knot_extension_m": [start_m, end_m]}
