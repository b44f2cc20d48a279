"""Compile the kernels of flights on two cores, before the first flight.

Numba compiles one function at a time in a process, and the kernels are compiled once for batches of flights
and once for single flights (see `morphcore.lanes`), and the two share little. So a second process compiles
the latter into the cache while this one compiles the former.
"""

from __future__ import annotations

import os
import subprocess
import sys
from functools import cache

import numpy as np

from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.jit import is_kept
from morphcore.lanes import ALONE, TOGETHER
from morphcore.models.equivalent import chain_model, lane_constants, physical_guess
from morphcore.simulate.batch import fly_batch, state_rates
from morphcore.simulate.kernels.batch import fly
from morphcore.simulate.plan import flight_plan
from morphcore.simulate.schedule import Hold
from morphcore.simulate.time_grid import time_grid
from morphcore.stopping import say
from morphcore.threads import usable_cores
from morphdata import aircraft as documents
from morphdata.flight import Flight as FlightDocument
from morphdata.lattice import Lattice

SMALL = Lattice(chordwise=1, spanwise=4)
_COMPILE_ALONE = "from morphcore.simulate.compilation import fly_tiny; fly_tiny(1)"


@cache
def compile_flights() -> None:
    """Compile the kernels of flights, unless the cache has them. A second call does nothing.

    With one core, or without a cache, this does nothing: the kernels are compiled when a flight first calls
    them.
    """
    if is_kept(fly) is not False or usable_cores() < 2 or not sys.executable:
        return
    say("compiling kernels, once on this machine")
    second = subprocess.Popen(
        [sys.executable, "-P", "-c", _COMPILE_ALONE],
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        env=os.environ | {"NUMBA_NUM_THREADS": "1"},
    )  # fmt: skip
    try:
        fly_tiny(TOGETHER)
        second.wait()  # if it failed, its kernels are compiled on their first call
    finally:
        second.kill()
        second.wait()


def fly_tiny(particles: int = ALONE) -> None:
    """Fly a small model ``particles`` times at once, which compiles or loads the kernels for that width."""
    aircraft, flight = tiny_aircraft()
    model = chain_model(aircraft, flight, 2, SMALL)
    plan = flight_plan(
        model, [Hold()] * len(aircraft.hinges), time_grid(np.linspace(0.0, 0.03, 4)), wake_alpha=0.0
    )
    batch = physical_guess(model).select(np.zeros(particles, dtype=np.int64))
    constants = lane_constants(model, batch, plan.grid.step_s)
    state = np.zeros((particles, model.state_rows))
    state[:, 0] = 1.0  # an attitude needs a unit quaternion
    state_rates(model, plan, 0, constants, state)
    for _ in fly_batch(model, plan, constants, state):
        pass


def tiny_aircraft() -> tuple[Aircraft, Flight]:
    """A small aircraft with two swept wings, and its flight."""
    wing = {
        "span_m": 1.0,
        "chord_m": 0.2,
        "thickness_m": 0.02,
        "material": {"density_kg_m3": 500.0, "youngs_modulus_pa": 1e10},
    }
    aircraft = documents.Aircraft.parse(
        {
            "fuselage": {"length_m": 1.0, "width_m": 0.2, "height_m": 0.2, "density_kg_m3": 100.0},
            "surfaces": [
                {"name": side, "side": side, **wing, "hinge": {"position_m": [0.0, y, 0.0], "axis": "z"}}
                for side, y in (("right", 0.1), ("left", -0.1))
            ],
        }
    )
    flight = FlightDocument(airspeed_m_s=30.0, gravity_m_s2=9.81)
    return Aircraft.of(aircraft), Flight.of(flight)
