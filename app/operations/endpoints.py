"""The calls of the operations: ``POST /name`` starts a job, ``POST /validate/name`` only checks."""

from __future__ import annotations

from typing import Any, Literal

from fastapi import APIRouter
from pydantic import create_model

from app.errors import IdempotencyConflict, QuotaExceeded
from app.http.context import CallerDep, ServiceDep, demands
from app.http.json_body import BODY_ERRORS, JsonRoute
from app.http.problems import documented
from app.jobs.schemas import Job, Validation
from app.keys.records import Scope
from app.operations.submission import ACCEPTED, SubmissionDep, validated
from morphdata.execution import Request
from morphdata.operations import OPERATIONS
from morphdata.operations.descriptor import Operation

router = APIRouter()


def _add(operation: Operation[Any]) -> None:
    """Add the two calls of an operation."""
    name, noun = operation.name, operation.noun

    async def submit(body: Request, submission: SubmissionDep) -> Job:
        return await submission.accept(operation, body)

    def validate(body: Request, app: ServiceDep, caller: CallerDep) -> Any:
        return validated(app, caller, operation, body)

    for endpoint in (submit, validate):
        endpoint.__annotations__["body"] = operation.request
    calls = APIRouter(tags=[name], route_class=JsonRoute, dependencies=[demands(Scope.JOBS_WRITE)])
    calls.post(
        f"/{name}",
        operation_id=name,
        summary=operation.title,
        description=f"Start {noun} and return its job.\n\n{operation.description}",
        status_code=202,
        responses={202: ACCEPTED, **documented(*BODY_ERRORS, IdempotencyConflict, QuotaExceeded)},
    )(submit)
    calls.post(
        f"/validate/{name}",
        operation_id=f"validate_{name}",
        summary=f"Check a request for {noun}",
        description=f"Make the checks of `POST /{name}` and start nothing; report the cost and how long it "
        "would wait.",
        response_model=create_model(
            f"{name.capitalize()}Validation",
            __base__=Validation,
            __doc__="The request is valid.",
            operation=(Literal[name], name),  # type: ignore[arg-type]  # each its own
            cost=(operation.cost_model, ...),
        ),
        responses=documented(*BODY_ERRORS),
    )(validate)
    router.include_router(calls)


for _operation in OPERATIONS:
    _add(_operation)
