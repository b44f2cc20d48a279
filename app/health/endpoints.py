"""Endpoints for monitoring."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query, Response
from fastapi.responses import PlainTextResponse

from app.errors import InvalidRequest
from app.health.metrics import MEDIA_TYPE
from app.health.schemas import Liveness, Readiness
from app.http.context import ServiceDep, demands
from app.http.problems import documented
from app.keys.records import Scope
from morphdata.version import VERSION

router = APIRouter(tags=["health"])


Strict = Annotated[bool, Query(description="Answer 503 also when the service is `degraded`.")]


@router.get("/livez", operation_id="get_liveness", summary="Is the process alive?")
async def livez() -> Liveness:
    """Answer while the process runs."""
    return Liveness(version=VERSION)


@router.get(
    "/readyz",
    operation_id="get_readiness",
    summary="Can requests be served?",
    responses={**documented(InvalidRequest), 503: {"model": Readiness, "description": "Not ready."}},
)
async def readyz(app: ServiceDep, response: Response, *, strict: Strict = False) -> Readiness:
    """Report whether database, broker and workers are available.

    Load balancers should check without `strict`: while broker or workers are away, this process still accepts
    and keeps jobs. Monitoring of the whole service should use `strict`.
    """
    state = await app.health.readiness()
    if state.status == "not_ready" or (strict and state.status == "degraded"):
        response.status_code = 503
    return state


@router.get(
    "/metrics",
    operation_id="get_metrics",
    summary="Metrics for Prometheus",
    response_class=PlainTextResponse,
    dependencies=[demands(Scope.METRICS)],
)
def metrics(app: ServiceDep) -> Response:
    """Jobs, queue, workers and counters from the database; requests served by this process."""
    return Response(app.health.metrics.text(), media_type=MEDIA_TYPE)
