"""Aircraft with wings that bend by a large part of their span, and their trims."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.models.flexible import FlexibleModel, flexible_model
from morphcore.simulate.flexible import FlexibleFlight, hinge_path
from morphcore.simulate.flexible_trim import FlexibleTrim, trim_flexible
from morphcore.simulate.schedule import Hold
from morphcore.simulate.time_grid import TimeGrid
from morphcore.simulate.trim import StartMode
from morphdata.lattice import Lattice, VortexCore
from tests.models.chains import aircraft_of, flight_of

Array = NDArray[np.float64]

HALF_SPAN_M = 16.0
TAILED_SPAN_M = 4.0
MATERIAL = {"density_kg_m3": 100.0, "youngs_modulus_pa": 1e9, "stiffness_damping_s": 0.004}


@dataclass(frozen=True)
class Trimmed:
    """A trim, its model, and the right wing's tip (3,) in B over the wing's span."""

    found: FlexibleTrim
    model: FlexibleModel
    tip: Array


def slender_aircraft(stiffness: float, mass_kg: float = 50.0) -> Aircraft:
    """Patil's wing (half-span 16, chord 1, 0.75 kg/m, EI 2e4, GJ 1e4 times ``stiffness``) on a fuselage.

    Patil, Hodges & Cesnik (2001), table 1; the whole aircraft weighs 728 N.
    """

    def wing(side: str) -> dict[str, Any]:
        return {
            "name": f"{side} wing",
            "side": side,
            "span_m": HALF_SPAN_M,
            "chord_m": 1.0,
            "thickness_m": 0.1,
            "material": MATERIAL,
            "section": {
                "ei_flap_n_m2": 2e4 * stiffness,
                "ei_edge_n_m2": 4e6 * stiffness,
                "gj_n_m2": 1e4 * stiffness,
                "mass_per_length_kg_m": 0.75,
                "inertia_per_length_kg_m": [0.0, 0.1, 0.1],
            },
            "position_m": [0.0, 0.0, 0.0],
        }

    fuselage = {"mass_kg": mass_kg, "inertia_kg_m2": [50.0, 100.0, 100.0]}
    return aircraft_of({"name": "slender", "fuselage": fuselage, "surfaces": [wing("right"), wing("left")]})


def slender_flight(airspeed_m_s: float = 25.0) -> Flight:
    """Its flight condition, at 20 km."""
    return flight_of({"airspeed_m_s": airspeed_m_s, "air_density_kg_m3": 0.0889})


def tailed_aircraft(stiffness: float, *, flexible_tail: bool = False) -> Aircraft:
    """Wings of 4 m, EI = 300 N m^2 times ``stiffness``, a tail 2.5 m behind and 0.2 m above; 11.5 kg."""

    def surface(name: str, side: str, y_m: float, **more: Any) -> dict[str, Any]:
        sign = 1.0 if side == "right" else -1.0
        document = {"name": f"{side} {name}", "side": side, "material": MATERIAL, "profile_drag": 0.01}
        return document | more | {"position_m": [*more["position_m"][:1], sign * y_m, more["position_m"][1]]}

    section = {
        "ei_flap_n_m2": 300.0 * stiffness,
        "ei_edge_n_m2": 2e4 * stiffness,
        "gj_n_m2": 250.0 * stiffness,
        "mass_per_length_kg_m": 0.4,
        "inertia_per_length_kg_m": [0.0, 0.004, 0.004],
    }
    wing = {"span_m": TAILED_SPAN_M, "chord_m": 0.35, "thickness_m": 0.04, "section": section}
    tail = {"span_m": 0.8, "chord_m": 0.25, "thickness_m": 0.03, "flexible": flexible_tail}
    surfaces = [
        *(surface("wing", side, 0.1, position_m=[0.0, 0.0], **wing) for side in ("right", "left")),
        *(surface("tail", side, 0.05, position_m=[-2.5, -0.2], **tail) for side in ("right", "left")),
    ]
    fuselage = {"mass_kg": 8.0, "inertia_kg_m2": [1.0, 8.0, 8.0], "centre_of_mass_m": [0.05, 0.0, 0.0]}
    return aircraft_of({"name": "tailed", "fuselage": fuselage, "surfaces": surfaces})


def tailed_flight(**more: Any) -> Flight:
    """Its flight condition."""
    return flight_of({"airspeed_m_s": 15.0, "air_density_kg_m3": 1.225} | more)


def trimmed(
    aircraft: Aircraft,
    flight: Flight,
    law: str = "line",
    *,
    elements: int = 10,
    start: StartMode = "trim",
    **lattice: Any,
) -> Trimmed:
    """The flexible trim with all hinges at rest."""
    chosen = Lattice(core=VortexCore(law=law), **lattice)  # type: ignore[arg-type]
    model = flexible_model(aircraft, flight, elements=elements, lattice=chosen)
    path = hinge_path(model, [Hold()] * len(aircraft.hinges), TimeGrid(0.0, 1e-3, 2, None))
    found = trim_flexible(FlexibleFlight(model), path, flight.wind_N, start=start)
    poses = found.state.poses
    tip = (poses.x[model.tips[0]] - poses.x[model.roots[0]]) @ poses.R[0]
    return Trimmed(found, model, tip / aircraft.surfaces[0].span_m)
