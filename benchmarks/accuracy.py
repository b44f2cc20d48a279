"""Error of the shipped step, and cost of the lattice behind it."""

from __future__ import annotations

import statistics

import numpy as np

from benchmarks.setting import ACCURACY_SAMPLES, LINKS, Array, Bench, Figures
from morphcore.aero.operator import lattice_operator
from morphcore.identify.cost import SampleCase, fly_attitudes, shared_trims
from morphcore.models.equivalent import ChainModel, ParameterBatch, chain_model, physical_guess
from morphcore.simulate.time_grid import STEP_S


def step_error(bench: Bench) -> Figures:
    """Largest attitude difference, rad, between the shipped step and a much finer one, on four flights."""
    model = chain_model(bench.aircraft, bench.flight, LINKS)
    guess = physical_guess(model)
    fine_s = STEP_S / bench.effort.refinement
    errors = {}
    for name in ACCURACY_SAMPLES:
        shipped, fine = (
            _attitude(model, guess, bench.cases(model, [name], step)[0]) for step in (STEP_S, fine_s)
        )
        errors[name] = float(np.abs(shipped - fine).max())
    return {"step_s": STEP_S, "reference_step_s": fine_s, "rad": errors, "worst_rad": max(errors.values())}


def lattice_cost(bench: Bench) -> Figures:
    """Assembly of one reduced lattice operator: influence of all rings, solution, reduction."""
    model = chain_model(bench.aircraft, bench.flight, LINKS)
    angles = np.full(len(bench.aircraft.surfaces), 0.3)
    times = [
        bench.timed(lambda: lattice_operator(model.lattice, tuple(angles)))
        for _ in range(bench.effort.singles)
    ]
    return {
        "rings": int(model.lattice.table.rings),
        "strips": model.lattice.strips,
        "operator_s": statistics.median(times),
    }


def _attitude(model: ChainModel, batch: ParameterBatch, case: SampleCase) -> Array:
    found = next(iter(shared_trims(model, batch, [case], "trim")))[1]
    return fly_attitudes(model, batch, case, found.require())
