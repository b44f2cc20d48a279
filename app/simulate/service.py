"""From a parsed request to an order, or to the faults that prevent it."""

from __future__ import annotations

from app.database import Session
from app.documents import Document
from app.errors import InvalidRequest
from app.jobs.submission import Order
from app.models.service import known_model
from app.simulate.checks import air_faults, schedules_faults, size_faults
from app.simulate.cost import estimate
from morphdata.simulate import EquivalentFlightModel, FlightCost, SimulateRequest
from morphdata.vehicle import (
    flexible_wing_faults,
    model_surfaces_faults,
    vehicle_document,
    vehicle_faults,
)


def prepare(session: Session, owner: str, request: SimulateRequest) -> Order[FlightCost]:
    """Check the request and make its order.

    Raises
    ------
    InvalidRequest
        Naming every fault.
    """
    model = _model_document(session, owner, request)
    step_s = model.get("step_s")
    faults = [
        *vehicle_faults(request.aircraft, request.flight, start=model.get("start")),
        *schedules_faults(request),
        *air_faults(request),
        *size_faults(request, step_s),
    ]
    if request.model.kind != "rigid":
        faults += flexible_wing_faults(request.aircraft, "nothing_to_bend")
    if "parameters" in model:
        faults += model_surfaces_faults(request.aircraft, model["parameters"], "/model/parameters")
    if faults:
        raise InvalidRequest.of(faults)
    return Order(
        operation="simulate",
        document={
            **vehicle_document(request.aircraft, request.flight),
            **request.model_dump(
                include={"schedules", "duration_s", "output_step_s", "environment"}, exclude_none=True
            ),
            "model": model,
        },
        summary={
            "aircraft": request.aircraft.name,
            "model": request.model.kind,
            "links_per_wing": model.get("parameters", {}).get("links_per_wing"),
            "duration_s": request.duration_s,
        },
        cost=estimate(request, step_s),
    )


def _model_document(session: Session, owner: str, request: SimulateRequest) -> Document:
    if isinstance(request.model, EquivalentFlightModel):
        return {"kind": request.model.kind, **known_model(session, owner, request.model)}
    return request.model.model_dump(exclude_none=True)
