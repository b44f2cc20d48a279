"""The operation ``simulate`` and its cost estimate."""

from __future__ import annotations

from typing import Any

from morphdata.drives import shown_drives
from morphdata.operations.descriptor import Operation
from morphdata.simulate import EquivalentFlightModel, FlightCost, SimulateRequest, SimulateResult

# nominal figures, to an order of magnitude, for a single flight on one core
STEP_CORE_S = {"rigid": 5e-5, "equivalent": 1e-4, "flexible": 2e-3}
START_CORE_S = 1.0  # trim, the lattice along the morph, tables and plots


def _cost(request: SimulateRequest) -> FlightCost:
    return FlightCost(
        rows=request.rows,
        steps=request.steps,
        flight_s=request.duration_s,
        core_s=START_CORE_S + request.steps * STEP_CORE_S[request.model.kind],
    )


def _summary(request: SimulateRequest) -> dict[str, Any]:
    model = request.model
    known = model.known if isinstance(model, EquivalentFlightModel) else None
    return {
        "aircraft": request.aircraft.name,
        "model": model.kind,
        "links_per_wing": None if known is None else known.links_per_wing,
        "duration_s": request.duration_s,
        "drives": shown_drives(request.schedules.keys_by_drive(request.aircraft.drives)),
    }


SIMULATE = Operation(
    name="simulate",
    subject="Flights of the rigid, the equivalent and the flexible model.",
    help="Flies one morph with a rigid, an equivalent or a flexible model.",
    noun="a simulation",
    title="Fly a model through a morph",
    description="With `Prefer: wait=30` the job of a rigid or equivalent model has usually ended when the "
    "response arrives. A flight keeps no checkpoint: if its worker is lost, another flies it again from the "
    "start.",
    request=SimulateRequest,
    result=SimulateResult,
    cost_model=FlightCost,
    cost=_cost,
    summary=_summary,
    begin="worker.operations.simulation:begin",
    files=("result.json", "flight.*", "shape.*"),
)
