"""Compile or load the kernels before the first real flight."""

from __future__ import annotations

import importlib

import numpy as np

from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.identify.cost import costs, sample_cases
from morphcore.models.equivalent import chain_model, lane_constants, physical_guess
from morphcore.search import evolution, swarm
from morphcore.simulate.flight import flight_steps
from morphcore.simulate.plan import flight_plan, time_grid
from morphcore.simulate.schedule import Hold
from morphcore.simulate.torque import hinge_torques
from morphcore.simulate.trajectory import Trajectory
from morphcore.threads import use_threads
from morphdata import aircraft as documents
from morphdata.flight import Flight as FlightDocument
from morphdata.lattice import Lattice

_WING = {
    "span_m": 1.0,
    "chord_m": 0.2,
    "thickness_m": 0.02,
    "material": {"density_kg_m3": 500.0, "youngs_modulus_pa": 1e10},
}


_SMALL = Lattice(chordwise=1, spanwise=4)
_SIDES = (("right", 0.1), ("left", -0.1))


def warm_up(threads: int | None = None) -> None:
    """Fly one and two models of two links a wing over tiny flights: what identifications need is compiled.

    Call it in the process that computes (never in the parent of forked workers), once. The kernels of hinge
    torques and beams, which few jobs need, are left to `warm_up_further`.
    """
    if threads is not None:
        use_threads(threads)
    aircraft, flight, sample = _tiny()
    model = chain_model(aircraft, flight, 2, _SMALL)
    cases = sample_cases(model, [sample])
    guess = physical_guess(model)
    costs(model, guess, cases, "trim")  # one lane, then blocks of them
    costs(model, guess.select(np.zeros(2, dtype=np.int64)), cases, "trim")


def warm_up_further() -> None:
    """Fly with hinge torques and with beams: the kernels and packages of all other jobs are loaded too."""
    aircraft, flight, sample = _tiny()
    model = chain_model(aircraft, flight, 2, _SMALL)
    held = flight_plan(model, [Hold()] * len(_SIDES), time_grid(sample.time_s))
    states = np.zeros((held.grid.steps + 1, model.state_rows))
    states[:, 0] = 1.0  # an attitude needs a unit quaternion
    hinge_torques(model, held, lane_constants(model, physical_guess(model), held.grid.step_s), states)
    for _ in flight_steps(
        aircraft, flight, sample, model="flexible", elements=1, lattice=_SMALL, step_s=0.01
    ):
        pass
    # packages that the searches load when they are first needed
    importlib.import_module("scipy.stats")
    evolution.strategies()
    swarm.operators()


def _tiny() -> tuple[Aircraft, Flight, Trajectory]:
    """A small aircraft and a flight of three rows."""
    aircraft = documents.Aircraft.parse(
        {
            "fuselage": {"length_m": 1.0, "width_m": 0.2, "height_m": 0.2, "density_kg_m3": 100.0},
            "surfaces": [
                {"name": side, "side": side, **_WING, "hinge": {"position_m": [0.0, y, 0.0], "axis": "z"}}
                for side, y in _SIDES
            ],
        }
    )
    flight = FlightDocument(airspeed_m_s=30.0, gravity_m_s2=9.81)
    time_s = np.linspace(0.0, 0.03, 4)
    rest = np.zeros(4)
    sample = Trajectory("warm-up", time_s, rest + time_s, rest + time_s, rest, rest, rest)
    return Aircraft.of(aircraft), Flight.of(flight), sample
