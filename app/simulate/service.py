"""From a parsed request to an order, or to the faults that prevent it."""

from __future__ import annotations

from app.database import Session
from app.documents import Document
from app.jobs.submission import Order
from app.models.service import known_model
from app.simulate.cost import estimate
from morphdata.simulate import EquivalentFlightModel, FlightCost, SimulateRequest
from morphdata.vehicle import vehicle_document


def prepare(session: Session, owner: str, request: SimulateRequest) -> Order[FlightCost]:
    """Check the request and make its order.

    Raises
    ------
    InvalidInput
        Naming every fault.
    """
    model = _model_document(session, owner, request)
    document = {
        **vehicle_document(request.aircraft, request.flight),
        **request.model_dump(
            include={"schedules", "duration_s", "output_step_s", "environment"}, exclude_none=True
        ),
        "model": model,
    }
    resolved = SimulateRequest.parse(document)  # a model that was named by its id may ask for more
    return Order(
        operation="simulate",
        document=document,
        summary={
            "aircraft": request.aircraft.name,
            "model": request.model.kind,
            "links_per_wing": model.get("parameters", {}).get("links_per_wing"),
            "duration_s": request.duration_s,
        },
        cost=estimate(resolved),
    )


def _model_document(session: Session, owner: str, request: SimulateRequest) -> Document:
    if isinstance(request.model, EquivalentFlightModel):
        return {"kind": request.model.kind, **known_model(session, owner, request.model)}
    return request.model.model_dump(exclude_none=True)
