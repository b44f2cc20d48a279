"""Aircraft whose surfaces have several hinges, about any axes."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from morphcore.geometry.aircraft import Aircraft
from morphcore.geometry.hinge import Hinge
from morphdata.drives import Hinge as HingeDocument
from tests.models.chains import EXAMPLES, aircraft_of, odd_aircraft

SKEW = [0.3, -0.8, 0.5]
# from the fuselage outward, at different places: wings sweep and then fold
SWEEP = {"axis": "z", "position_m": [0.1, 0.3, 0.0]}
FOLD = {"axis": "x", "position_m": [-0.05, 0.5, 0.04]}
CANT = {"name": "cant", "axis": [0.2, 0.3, 0.9], "position_m": [0.05, 0.35, -0.03]}


def many_hinges(rng: np.random.Generator) -> Aircraft:
    """The odd aircraft on two hinges a surface, skew ones among them, each at a place of its own.

    (More than a skew one and another make more turns than MuJoCo has joints in a body.)
    """
    aircraft = odd_aircraft(rng)
    kinds: dict[str, list[dict[str, Any]]] = {
        "right wing": [{"axis": "z"}, {"axis": "x"}],
        "left wing": [{"name": "cant", "axis": SKEW}, {"axis": "z"}],
        "left fin": [{"axis": "y"}, {"name": "twist", "axis": [1.0, 1.0, -2.0]}],
    }
    surfaces = []
    for surface in aircraft.surfaces:
        hinges = tuple(
            Hinge.of(
                HingeDocument.parse({**kind, "position_m": rng.uniform(-0.6, 0.6, 3).tolist()}), surface.side
            )
            for kind in kinds.get(surface.name, [])
        )
        surfaces.append(replace(surface, hinges=hinges))
    return replace(aircraft, surfaces=tuple(surfaces))


def on_hinges(right: Sequence[dict[str, Any]], **of_wings: Any) -> dict[str, Any]:
    """The document of the example's aircraft with wings on some hinges, given for the right one."""
    document: dict[str, Any] = json.loads((EXAMPLES / "aircraft.json").read_text())
    for surface in document["surfaces"]:
        surface.pop("hinge")
        sign = 1.0 if surface["side"] == "right" else -1.0
        surface["hinges"] = [_on_side(hinge, sign) for hinge in right]
        surface["position_m"] = [0.0, 0.55 * sign, 0.0]
        surface["material"] = surface["material"] | of_wings
    return document


def _on_side(hinge: dict[str, Any], sign: float) -> dict[str, Any]:
    x, y, z = hinge["position_m"]
    axis = hinge["axis"]
    if not isinstance(axis, str):
        axis = [sign * axis[0], axis[1], sign * axis[2]]
    return {**hinge, "position_m": [x, sign * y, z], "axis": axis}


def hinged_wings(*right: dict[str, Any], **of_wings: Any) -> Aircraft:
    """The same, resolved."""
    return aircraft_of(on_hinges(right, **of_wings))
