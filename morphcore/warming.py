"""Compile or load the kernels before the first real flight."""

from __future__ import annotations

import numpy as np

from morphcore.geometry.aircraft import aircraft_from_document, flight_from_document
from morphcore.geometry.lattice import LatticeSettings
from morphcore.identify.cost import costs, sample_cases
from morphcore.models.equivalent import chain_model, lane_constants, physical_guess
from morphcore.simulate.flight import simulate
from morphcore.simulate.plan import flight_plan, time_grid
from morphcore.simulate.schedule import Hold
from morphcore.simulate.torque import hinge_torques
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
    guess = physical_guess(model)
    costs(model, guess, sample_cases(model, [sample]), "trim")
    held = flight_plan(model, [Hold()] * len(sides), time_grid(time_s))
    states = np.zeros((held.grid.steps + 1, model.state_rows))
    states[:, 0] = 1.0  # an attitude needs a unit quaternion
    hinge_torques(model, held, lane_constants(model, guess, held.grid.step_s), states)
    simulate(aircraft, flight, sample, model="flexible", elements=1, lattice=small, step_s=0.01)
