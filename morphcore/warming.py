"""Compile or load the kernels before the first real flight."""

from __future__ import annotations

import numpy as np

from morphcore.geometry.aircraft import aircraft_from_document, flight_from_document
from morphcore.geometry.lattice import LatticeSettings
from morphcore.identify.cost import costs, sample_cases
from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.simulate.flight import simulate
from morphcore.simulate.trajectory import Trajectory
from morphcore.threads import use_threads

_WING = {
    "span_m": 1.0,
    "chord_m": 0.2,
    "thickness_m": 0.02,
    "material": {"density_kg_m3": 500.0, "youngs_modulus_pa": 1e10},
}


def warm_up(threads: int | None = None) -> None:
    """Fly one tiny flight of two links a wing and one of beams: every kernel of a job is then compiled.

    Call it in the process that computes (never in the parent of forked workers), once.
    """
    if threads is not None:
        use_threads(threads)
    sides = (("right", 0.1), ("left", -0.1))
    aircraft = aircraft_from_document(
        {
            "fuselage": {"length_m": 1.0, "width_m": 0.2, "height_m": 0.2, "density_kg_m3": 100.0},
            "surfaces": [
                {"name": side, "side": side, **_WING, "hinge": {"position_m": [0.0, y, 0.0], "axis": "z"}}
                for side, y in sides
            ],
        }
    )
    flight = flight_from_document({"airspeed_m_s": 30.0, "gravity_m_s2": 9.81})
    time_s = np.linspace(0.0, 0.03, 4)
    rest = np.zeros(4)
    sample = Trajectory("warm-up", time_s, rest + time_s, rest + time_s, rest, rest, rest)
    small = LatticeSettings(chordwise=1, spanwise=4)
    model = chain_model(aircraft, flight, 2, small)
    costs(model, physical_guess(model), sample_cases(model, [sample]), "trim")
    simulate(aircraft, flight, sample, model="flexible", elements=1, lattice=small, step_s=0.01)
