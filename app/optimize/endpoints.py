"""Endpoints of the optimisation of a morph schedule."""

from __future__ import annotations

from typing import Literal

from app.http.context import CallerDep, ServiceDep
from app.jobs.schemas import Job, Validation
from app.jobs.submission import OperationRouter, SubmissionDep, validated
from app.optimize import service
from morphdata.optimize import OptimizeRequest, ScheduleCost

router = OperationRouter("optimize")


class OptimizeValidation(Validation):
    """The request is valid."""

    operation: Literal["optimize"] = "optimize"
    cost: ScheduleCost


@router.submission("Find the morph schedule that disturbs the attitude least")
async def optimize(body: OptimizeRequest, submission: SubmissionDep) -> Job:
    """Start an optimisation and return its job.

    The schedule found with the equivalent model is compared with the constant rate and with the one found
    with the rigid model, all three flown in every model.
    """
    return await submission.accept(service.prepare, body)


@router.validation("Check a request for an optimisation")
def validate_optimize(body: OptimizeRequest, app: ServiceDep, caller: CallerDep) -> OptimizeValidation:
    """Make the checks of `POST /optimize` and start nothing; tell the cost and how long it would wait."""
    return validated(app, caller, service.prepare, body, OptimizeValidation)
