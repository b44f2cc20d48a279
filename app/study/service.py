"""From a parsed request to an order, or to the faults that prevent it."""

from __future__ import annotations

from app.database import Session
from app.errors import InvalidRequest
from app.identify.checks import repeated_faults
from app.identify.cost import estimate
from app.identify.service import checked_samples, samples_document, samples_summary
from app.jobs.submission import Order, deadline_s
from morphdata.identify import CostEstimate
from morphdata.study import StudyRequest

REPORT_TIME_S = 300.0  # after the search's own time budget: uncertainty and timing of up to eight models


def prepare(session: Session, owner: str, request: StudyRequest) -> Order[CostEstimate]:
    """Check the request and make its order.

    Raises
    ------
    InvalidRequest
        Naming every fault.
    """
    listed = request.model.links_per_wing
    faults = list(repeated_faults(listed, "/model/links_per_wing", "List each number once."))
    if faults:
        raise InvalidRequest.of(faults)
    samples = checked_samples(session, owner, request)
    parts = [estimate(request, links, samples) for links in listed]
    return Order(
        operation="study",
        document=samples_document(request, samples),
        summary={**samples_summary(request, samples), "compared_links": listed},
        cost=CostEstimate(
            samples=len(samples),
            rows=parts[0].rows,
            parameters=max(part.parameters for part in parts),
            flights=sum(part.flights for part in parts),
            flight_s=sum(part.flight_s for part in parts),
            core_s=sum(part.core_s for part in parts),
        ),
        max_seconds=deadline_s(request.search.max_seconds, REPORT_TIME_S),
    )
