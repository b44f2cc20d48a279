"""Endpoints of identification."""

from __future__ import annotations

from typing import Literal

from app.http.context import CallerDep, ServiceDep
from app.identify import service
from app.jobs.schemas import Job, Validation
from app.jobs.submission import OperationRouter, SubmissionDep, validated
from morphdata.identify import CostEstimate, IdentifyRequest

router = OperationRouter("identify")


class IdentifyValidation(Validation):
    """The request is valid."""

    operation: Literal["identify"] = "identify"
    cost: CostEstimate


@router.submission("Identify an equivalent model from sample flights")
async def identify(body: IdentifyRequest, submission: SubmissionDep) -> Job:
    """Start an identification and return its job.

    The samples with the role `train` are fitted; those with the role `held_out` are flown and reported only.
    """
    return await submission.accept(service.prepare, body)


@router.validation("Check a request for identification")
def validate_identify(body: IdentifyRequest, app: ServiceDep, caller: CallerDep) -> IdentifyValidation:
    """Make the checks of `POST /identify` and start nothing; tell the cost and how long it would wait."""
    return validated(app, caller, service.prepare, body, IdentifyValidation)
