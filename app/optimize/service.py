"""From a parsed request to an order, or to the faults that prevent it."""

from __future__ import annotations

from app.database import Session
from app.errors import InvalidRequest
from app.jobs.submission import Order, deadline_s
from app.models.service import known_model
from app.optimize.checks import morph_faults, work_faults
from app.optimize.cost import estimate
from morphdata.optimize import OptimizeRequest, ScheduleCost
from morphdata.vehicle import (
    flexible_wing_faults,
    model_surfaces_faults,
    vehicle_document,
    vehicle_faults,
)

REPORT_TIME_S = 1800.0  # after the search's own time budget: flights of the flexible model, plots


def prepare(session: Session, owner: str, request: OptimizeRequest) -> Order[ScheduleCost]:
    """Check the request and make its order.

    Raises
    ------
    InvalidRequest
        Naming every fault.
    """
    model = known_model(session, owner, request.model)
    cost = estimate(request)
    faults = [
        *vehicle_faults(request.aircraft, request.flight, start=model.get("start")),
        *flexible_wing_faults(request.aircraft, "nothing_to_bend"),
        *model_surfaces_faults(request.aircraft, model["parameters"], "/model/parameters"),
        *morph_faults(request),
        *work_faults(cost.flights),
    ]
    if faults:
        raise InvalidRequest.of(faults)
    return Order(
        operation="optimize",
        document={
            **vehicle_document(request.aircraft, request.flight),
            **request.model_dump(
                include={"morph", "limits", "weights", "search", "verify", "flexible"}, exclude_none=True
            ),
            "model": model,
        },
        summary={
            "aircraft": request.aircraft.name,
            "links_per_wing": model["parameters"].get("links_per_wing"),
            "method": request.search.method,
            "duration_s": request.morph.duration_s,
            "final_rad": request.morph.final_rad,
        },
        cost=cost,
        max_seconds=deadline_s(request.search.max_seconds, REPORT_TIME_S),
    )
