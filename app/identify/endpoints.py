"""Endpoints of identification."""

from __future__ import annotations

from app.http.context import OwnerDep, ServiceDep
from app.identify import service
from app.identify.schemas import IdentifyRequest, IdentifyValidation
from app.jobs.schemas import Job
from app.jobs.submission import OperationRouter, SubmissionDep, priced

router = OperationRouter("identify")


@router.submission("Identify an equivalent model from sample flights")
async def identify(body: IdentifyRequest, submission: SubmissionDep) -> Job:
    """Start an identification and return its job.

    The samples with the role `train` are fitted; those with the role `held_out` are flown and reported only.
    """
    return await submission.accept(service.prepare, body)


@router.validation("Check a request for identification")
def validate_identify(body: IdentifyRequest, app: ServiceDep, owner: OwnerDep) -> IdentifyValidation:
    """Make the same checks as `POST /identify` without starting anything, and tell what it would cost."""
    return IdentifyValidation(cost=priced(app, owner, service.prepare, body))
