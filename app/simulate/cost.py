"""What a simulation would cost, before it is run."""

from __future__ import annotations

import math

from morphdata.simulate import FlightCost, SimulateRequest

# nominal figures, to an order of magnitude, of a flight alone on one core
DEFAULT_STEP_S = {"rigid": 0.01, "equivalent": 0.01, "flexible": 0.001}
STEP_CORE_S = {"rigid": 5e-5, "equivalent": 1e-4, "flexible": 2e-3}
START_CORE_S = 1.0  # trim, the lattice along the morph, tables and plots


def row_count(request: SimulateRequest) -> int:
    """Rows of the trajectory."""
    return int(request.duration_s / request.output_step_s + 1e-9) + 1


def step_count(request: SimulateRequest, step_s: float | None) -> int:
    """Time steps: a whole number of them between two rows, none longer than ``step_s``."""
    longest_s = DEFAULT_STEP_S[request.model.kind] if step_s is None else step_s
    return math.ceil(request.output_step_s / longest_s - 1e-9) * (row_count(request) - 1)


def estimate(request: SimulateRequest, step_s: float | None) -> FlightCost:
    """Estimate steps and computing time."""
    steps = step_count(request, step_s)
    return FlightCost(
        rows=row_count(request),
        steps=steps,
        flight_s=request.duration_s,
        core_s=START_CORE_S + steps * STEP_CORE_S[request.model.kind],
    )
