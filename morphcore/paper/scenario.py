"""The paper's aircraft, flights and headline figures.

Sizes, rates and the roles of the flights are the paper's; density, modulus, damping and speed are ours, since
its text does not print them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.simulate.trajectory import Role
from morphdata import aircraft as documents
from morphdata.flight import Flight as FlightDocument
from morphdata.schedules import Schedules

Document = dict[str, Any]

DOI = "10.1177/00368504211010946"
TITLE = (
    "Equivalent modelling of a sweep-morphing aircraft with gimbal-jointed rigid bodies, identified by "
    "particle swarm"
)

# headline figures printed in the paper's text, per cent
PAPER_COMPUTATION = 10.0  # time of an equivalent flight relative to the flexible model's
PAPER_OPTIMUM = -4.23  # attitude variation of the optimised morph relative to constant rate
PAPER_RIGID_OPTIMUM = 4.12  # the same for the morph optimised with the rigid model

LINKS = 3  # per wing, of the equivalent model whose flights are shown

# each sample flight begins and ends held, with ramped rates, like the independent program's flights
HELD_BEFORE_S = 0.2
HELD_AFTER_S = 0.3
RAMP_S = 0.1
FINAL_RAD = 1.0

# the optimised morph
MORPH_S = 2.0
SETTLE_S = 2.0
RATE_LIMIT_RAD_S = 1.0
KNOTS = 6

_WING: Document = {
    "span_m": 3.0,
    "chord_m": 0.3,
    "thickness_m": 0.1,
    "material": {
        "density_kg_m3": 500.0,
        "youngs_modulus_pa": 2.1e9,
        "poisson_ratio": 0.3,
        "stiffness_damping_s": 0.004,
    },
    "profile_drag": 0.01,
    "flexible": True,
}

AIRCRAFT: Document = {
    "name": "reference sweep-morphing aircraft",
    "fuselage": {
        "shape": "box",
        "length_m": 5.0,
        "width_m": 0.7,
        "height_m": 0.5,
        "density_kg_m3": 500.0,
    },
    "surfaces": [
        {
            "name": f"{side} wing",
            "side": side,
            **_WING,
            "hinge": {"position_m": [0.0, y, 0.0], "axis": "z"},
        }
        for side, y in (("right", 0.35), ("left", -0.35))
    ],
}

FLIGHT: Document = {
    "airspeed_m_s": 150.0,
    "air_density_kg_m3": 1.225,
    "gravity_m_s2": 9.81,
    "altitude_m": 0.0,
    "mach": 0.0,  # incompressible, as the paper computes
}


@dataclass(frozen=True)
class PaperFlight:
    """One sample flight: both wings follow ``schedule`` (a document, see `morphdata.schedules`)."""

    name: str
    label: str
    role: Role
    schedule: Document
    duration_s: float

    def schedules(self) -> Schedules:
        """The schedules of both hinges."""
        return Schedules.parse({"both": self.schedule})


def aircraft() -> Aircraft:
    """The aircraft."""
    return Aircraft.of(documents.Aircraft.parse(AIRCRAFT))


def flight() -> Flight:
    """The flight condition."""
    return Flight.of(FlightDocument.parse(FLIGHT))


def paper_flights() -> tuple[PaperFlight, ...]:
    """Three flights for identification, then three for checks: between, beyond, and of another shape."""
    fitted = [_constant_rate(rate, "train") for rate in (0.2, 0.5, 0.8)]
    checks = [_constant_rate(rate, "held_out") for rate in (0.4, 1.0)]
    quadratic = {"kind": "quadratic", "duration_s": MORPH_S}
    return (*fitted, *checks, _held("quadratic", "quadratic, 1 rad in 2 s", "held_out", quadratic))


def two_second_flight() -> PaperFlight:
    """The flight whose computing times are compared: 1 rad in 2 s and nothing else."""
    schedule = {"kind": "constant_rate", "final_rad": FINAL_RAD, "duration_s": MORPH_S, "ramp_s": RAMP_S}
    return PaperFlight("two_seconds", "1 rad in 2 s", "held_out", schedule, MORPH_S)


def _constant_rate(rate_rad_s: float, role: Role) -> PaperFlight:
    morph = {"kind": "constant_rate", "duration_s": FINAL_RAD / rate_rad_s, "ramp_s": RAMP_S}
    return _held(f"rate_{rate_rad_s}", f"{rate_rad_s} rad/s", role, morph)


def _held(name: str, label: str, role: Role, morph: Document) -> PaperFlight:
    """A flight with constant shape before and after its morph."""
    schedule = {"final_rad": FINAL_RAD, "start_s": HELD_BEFORE_S, **morph}
    return PaperFlight(name, label, role, schedule, HELD_BEFORE_S + morph["duration_s"] + HELD_AFTER_S)
