"""Compile or load the kernels before the first real flight."""

from __future__ import annotations

import importlib

import numpy as np

from morphcore.identify.cost import costs, sample_cases
from morphcore.models.equivalent import chain_model, lane_constants, physical_guess
from morphcore.search import evolution, swarm
from morphcore.simulate.compilation import SMALL, compile_flights, tiny_aircraft
from morphcore.simulate.flight import flight_steps
from morphcore.simulate.plan import flight_plan
from morphcore.simulate.schedule import Hold
from morphcore.simulate.time_grid import time_grid
from morphcore.simulate.torque import hinge_torques
from morphcore.simulate.trajectory import Trajectory
from morphcore.threads import use_threads


def warm_up(threads: int | None = None) -> None:
    """Fly one and two models of two links per wing over tiny flights, to compile what identifications need.

    Call it in the process that computes (never in the parent of forked workers), once. The kernels of hinge
    torques and beams, which few jobs need, are left to `warm_up_further`.

    Parameters
    ----------
    threads : int, optional
        Threads of the whole process; by default one for each core.
    """
    if threads is not None:
        use_threads(threads)
    compile_flights()
    model = chain_model(*tiny_aircraft(), 2, SMALL)
    cases = sample_cases(model, [_tiny_sample()])
    guess = physical_guess(model)
    costs(model, guess, cases, "trim")  # one lane, then blocks of them
    costs(model, guess.select(np.zeros(2, dtype=np.int64)), cases, "trim")


def warm_up_further() -> None:
    """Fly with hinge torques and with beams, to load the kernels and packages of all other jobs."""
    aircraft, flight = tiny_aircraft()
    sample = _tiny_sample()
    model = chain_model(aircraft, flight, 2, SMALL)
    held = flight_plan(model, [Hold()] * len(aircraft.hinges), time_grid(sample.time_s), wake_alpha=0.0)
    states = np.zeros((held.grid.steps + 1, model.state_rows))
    states[:, 0] = 1.0  # an attitude needs a unit quaternion
    hinge_torques(model, held, lane_constants(model, physical_guess(model), held.grid.step_s), states)
    for _ in flight_steps(aircraft, flight, sample, model="flexible", elements=1, lattice=SMALL, step_s=0.01):
        pass
    # packages that the searches import on first use
    importlib.import_module("scipy.stats")
    evolution.strategies()
    swarm.operators()


def _tiny_sample() -> Trajectory:
    """A flight of four rows in which both wings turn."""
    time_s = np.linspace(0.0, 0.03, 4)
    rest = np.zeros(4)
    return Trajectory("warm-up", time_s, {"sweep": rest + time_s}, rest, rest, rest)
