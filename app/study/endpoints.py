"""Endpoints of the study."""

from __future__ import annotations

from typing import Literal

from app.http.context import CallerDep, ServiceDep
from app.jobs.schemas import Job, Validation
from app.jobs.submission import OperationRouter, SubmissionDep, validated
from app.study import service
from morphdata.identify import CostEstimate
from morphdata.study import StudyRequest

router = OperationRouter("study")


class StudyValidation(Validation):
    """The request is valid."""

    operation: Literal["study"] = "study"
    cost: CostEstimate


@router.submission("Compare models of several sizes")
async def study(body: StudyRequest, submission: SubmissionDep) -> Job:
    """Start a study and return its job.

    A model is identified for every number of links per wing from the same samples; accuracy and cost of each
    are told, and one is recommended. The recommended model becomes one of yours: see `model_id` of the job.
    """
    return await submission.accept(service.prepare, body)


@router.validation("Check a request for a study")
def validate_study(body: StudyRequest, app: ServiceDep, caller: CallerDep) -> StudyValidation:
    """Make the checks of `POST /study` and start nothing; tell the cost and how long it would wait."""
    return validated(app, caller, service.prepare, body, StudyValidation)
