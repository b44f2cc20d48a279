"""Endpoints for machines."""

from __future__ import annotations

from fastapi import APIRouter, Response
from fastapi.responses import PlainTextResponse

from app.health import repository, service
from app.health.schemas import Liveness, Readiness
from app.http.context import ServiceDep
from app.version import VERSION

router = APIRouter(tags=["health"])


@router.get("/livez", operation_id="get_liveness", summary="Is the process alive?")
async def livez() -> Liveness:
    """Answer while the process runs."""
    return Liveness(version=VERSION)


@router.get(
    "/readyz",
    operation_id="get_readiness",
    summary="Can requests be served?",
    responses={503: {"model": Readiness, "description": "Not ready."}},
)
async def readyz(app: ServiceDep, response: Response) -> Readiness:
    """Tell whether the database answers; the broker's state is told beside it."""
    state = await service.readiness(app.database, app.settings.broker_url)
    if state.status != "ready":
        response.status_code = 503
    return state


@router.get(
    "/metrics",
    operation_id="get_metrics",
    summary="Metrics for Prometheus",
    response_class=PlainTextResponse,
)
def metrics(app: ServiceDep) -> PlainTextResponse:
    """Jobs by state and the age of the queue."""
    with app.database.read() as session:
        counts = repository.job_counts(session)
    return PlainTextResponse(service.metrics_text(counts), media_type="text/plain; version=0.0.4")
