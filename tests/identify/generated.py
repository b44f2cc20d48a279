"""Seeded aircraft like that of the examples, and flights of their flexible models."""

from __future__ import annotations

import json
from functools import cache
from typing import Any

import numpy as np

from morphcore import Trajectory, simulate
from morphcore.simulate.trajectory import Role
from morphdata.aircraft import Aircraft
from morphdata.flight import Flight
from morphdata.schedules import Schedules
from tests.identify.flights import EXAMPLES

FACTOR = 1.5  # by which stiffness, span, mass and speed are larger or smaller at most


def _sweeps(left_rad: float, right_rad: float, **schedule: Any) -> dict[str, Any]:
    both = {"sweep_left": left_rad, "sweep_right": right_rad}
    return {drive: {"final_rad": final, "start_s": 0.2, **schedule} for drive, final in both.items()}


# name -> schedules and duration, s; in the order in which they are added to the flights to fit
TRAINING = {
    "asymmetric": (_sweeps(0.5, 0.6, kind="constant_rate", duration_s=1.5), 2.0),
    "fast": (_sweeps(1.0, 1.0, kind="constant_rate", duration_s=1.25), 1.75),
    "more_asymmetric": (_sweeps(0.4, 0.2, kind="constant_rate", duration_s=1.0), 1.5),
    "middle": (_sweeps(1.0, 1.0, kind="constant_rate", duration_s=2.0), 2.5),
    "slow": (_sweeps(0.7, 0.7, kind="constant_rate", duration_s=2.3), 2.8),
}
HELD_OUT = {
    "held_asymmetric": (_sweeps(0.5, 0.3, kind="constant_rate", duration_s=1.2), 1.7),
    "held_quadratic": (_sweeps(0.9, 0.9, kind="quadratic", duration_s=1.6), 2.1),
}


@cache
def generated(seed: int) -> tuple[Aircraft, Flight]:
    """An aircraft and its flight condition."""
    stiffness, span, mass, speed = FACTOR ** np.random.default_rng(seed).uniform(-1.0, 1.0, 4)
    aircraft = json.loads((EXAMPLES / "aircraft.json").read_text())
    for surface in aircraft["surfaces"]:
        surface["span_m"] *= span
        surface["material"]["youngs_modulus_pa"] *= stiffness
        surface["material"]["density_kg_m3"] *= mass
    aircraft["fuselage"]["density_kg_m3"] *= mass
    flight = json.loads((EXAMPLES / "flight.json").read_text())
    del flight["start"]
    flight["airspeed_m_s"] *= speed
    return Aircraft.parse(aircraft), Flight.parse(flight)


@cache
def flexible(seed: int, name: str, role: Role = "train") -> Trajectory:
    """A flight of an aircraft's flexible model."""
    schedules, duration_s = {**TRAINING, **HELD_OUT}[name]
    flown = simulate(
        *generated(seed), Schedules.parse(schedules), model="flexible", duration_s=duration_s
    ).trajectory
    return Trajectory(name, flown.time_s, flown.drives, flown.phi, flown.theta, flown.psi, role=role)
