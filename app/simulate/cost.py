"""What a simulation would cost, before it is run."""

from __future__ import annotations

from morphdata.simulate import FlightCost, SimulateRequest

# nominal figures, to an order of magnitude, of a flight alone on one core
STEP_CORE_S = {"rigid": 5e-5, "equivalent": 1e-4, "flexible": 2e-3}
START_CORE_S = 1.0  # trim, the lattice along the morph, tables and plots


def estimate(request: SimulateRequest) -> FlightCost:
    """Estimate steps and computing time."""
    return FlightCost(
        rows=request.rows,
        steps=request.steps,
        flight_s=request.duration_s,
        core_s=START_CORE_S + request.steps * STEP_CORE_S[request.model.kind],
    )
