"""A small aircraft with a tail on hinges of incidence, and aircraft made rigid, for tests of trim."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from morphcore.geometry.aircraft import Aircraft

FLIGHT: dict[str, Any] = {"airspeed_m_s": 15.0, "air_density_kg_m3": 1.225, "gravity_m_s2": 9.81}
MATERIAL = {"density_kg_m3": 60.0, "youngs_modulus_pa": 3e9, "stiffness_damping_s": 2e-3}


def wing(side: str, **more: Any) -> dict[str, Any]:
    """A wing that sweeps, as a document."""
    y = 0.05 if side == "right" else -0.05
    return {
        "name": side, "side": side, "span_m": 1.2, "chord_m": 0.25, "thickness_m": 0.03,
        "material": MATERIAL, "hinge": {"position_m": [0.0, y, 0.0], "axis": "z"}, **more,
    }  # fmt: skip


def tail(side: str, **more: Any) -> dict[str, Any]:
    """A rigid tail that changes its incidence, well above the wing's wake, as a document."""
    y = 0.02 if side == "right" else -0.02
    return {
        "name": f"tail {side}", "side": side, "span_m": 0.35, "chord_m": 0.15, "thickness_m": 0.015,
        "flexible": False, "material": MATERIAL,
        "hinge": {"position_m": [-1.0, y, -0.4], "axis": "y", "min_rad": -0.3, "max_rad": 0.3}, **more,
    }  # fmt: skip


def document(order: Sequence[int] = (0, 1, 2, 3), *, flexible: bool = True, **tails: Any) -> dict[str, Any]:
    """About 2 kg with wings (0, 1) and tails (2, 3) in a given order."""
    surfaces = [
        wing("right", flexible=flexible), wing("left", flexible=flexible),
        tail("right", **tails), tail("left", **tails),
    ]  # fmt: skip
    fuselage = {"mass_kg": 1.5, "inertia_kg_m2": [0.03, 0.12, 0.14], "centre_of_mass_m": [0.06, 0.0, 0.0]}
    return {"fuselage": fuselage, "surfaces": [surfaces[k] for k in order]}


def rigid(aircraft: Aircraft) -> Aircraft:
    """The aircraft with every surface rigid, whatever the model."""
    return replace(
        aircraft, surfaces=tuple(replace(surface, flexible=False) for surface in aircraft.surfaces)
    )
