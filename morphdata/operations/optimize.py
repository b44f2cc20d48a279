"""The operation ``optimize`` and its cost estimate."""

from __future__ import annotations

from typing import Any

from morphdata.drives import shown_drives
from morphdata.operations.descriptor import Operation, after_budget
from morphdata.operations.simulate import STEP_CORE_S
from morphdata.optimize import OptimizeRequest, OptimizeResult, ScheduleCost
from morphdata.simulate import DEFAULT_STEP_S

REAL_TIME_FACTOR = 150.0  # s on one core: every flight has its own schedule, and so its own lattice over time
COMPARED_SCHEDULES = 3  # constant rate and both optima
REPORT_TIME_S = 1800.0  # flights of the flexible model, plots


def _cost(request: OptimizeRequest) -> ScheduleCost:
    each_s = request.morph.duration_s + request.morph.settle_s
    flights = request.flights
    core_s = flights * each_s / REAL_TIME_FACTOR
    if request.verify == "flexible":
        core_s += COMPARED_SCHEDULES * each_s * STEP_CORE_S["flexible"] / DEFAULT_STEP_S["flexible"]
    return ScheduleCost(
        parameters=request.unknowns, flights=flights, flight_s=flights * each_s, core_s=core_s
    )


def _summary(request: OptimizeRequest) -> dict[str, Any]:
    known = request.model.known
    return {
        "aircraft": request.aircraft.name,
        "links_per_wing": None if known is None else known.links_per_wing,
        "method": request.search.method,
        "duration_s": request.morph.duration_s,
        "final_rad": request.morph.final_rad,
        "drives": shown_drives(request.morph.moved(request.aircraft.drives)),
    }


OPTIMIZE = Operation(
    name="optimize",
    subject="Morph schedules that disturb the attitude least.",
    help="Finds the morph schedule that disturbs the attitude least.",
    noun="an optimisation",
    title="Find the morph schedule that disturbs the attitude least",
    description="The schedule found with the equivalent model is compared with the constant rate and with "
    "the one found with the rigid model, all three flown in every model.",
    request=OptimizeRequest,
    result=OptimizeResult,
    cost_model=ScheduleCost,
    cost=_cost,
    summary=_summary,
    begin="worker.operations.optimisation:begin",
    files=("result.json", "schedule.csv", "schedules.*", "departures.*", "pareto.*"),
    deadline_s=after_budget(REPORT_TIME_S),
)
