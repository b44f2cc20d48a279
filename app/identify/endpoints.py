"""Endpoints of identification."""

from __future__ import annotations

from fastapi import APIRouter, Response
from fastapi.concurrency import run_in_threadpool

from app.errors import (
    BodyTooLarge,
    IdempotencyConflict,
    InvalidRequest,
    MalformedBody,
    UnsupportedMediaType,
)
from app.http.context import OwnerDep, ServiceDep
from app.http.json_body import JsonRoute
from app.http.prefer import IdempotencyKeyHeader, PreferHeader, wait_seconds
from app.http.problems import documented
from app.identify import service
from app.identify.schemas import IdentifyRequest, IdentifyValidation
from app.jobs.event_stream import wait_for_end
from app.jobs.records import Job as StoredJob
from app.jobs.schemas import Job

router = APIRouter(tags=["identify"], route_class=JsonRoute)

BODY_ERRORS = (MalformedBody, BodyTooLarge, UnsupportedMediaType, InvalidRequest)


@router.post(
    "/identify",
    operation_id="identify",
    summary="Identify an equivalent model from sample flights",
    status_code=202,
    responses={
        202: {
            "description": "The job, queued (or ended, with `Prefer: wait`).",
            "headers": {
                "Location": {"description": "The job.", "schema": {"type": "string"}},
                "Idempotency-Replayed": {
                    "description": "`true` when the answer repeats an earlier one.",
                    "schema": {"type": "string"},
                },
                "Preference-Applied": {
                    "description": "The wait that was honoured.",
                    "schema": {"type": "string"},
                },
            },
        },
        **documented(*BODY_ERRORS, IdempotencyConflict),
    },
)
async def identify(
    body: IdentifyRequest,
    response: Response,
    app: ServiceDep,
    owner: OwnerDep,
    idempotency_key: IdempotencyKeyHeader = None,
    prefer: PreferHeader = None,
) -> Job:
    """Start an identification and return its job.

    The samples with the role `train` are fitted; those with the role `held_out` are flown and reported only.
    """

    def submit() -> StoredJob:
        with app.database.write() as session:
            return service.submit(
                session,
                owner,
                body,
                idempotency_key=idempotency_key,
                max_attempts=app.settings.job_max_attempts,
                default_max_seconds=app.settings.job_max_seconds,
            )

    job = await run_in_threadpool(submit)
    if job.replayed:
        response.headers["Idempotency-Replayed"] = "true"
    else:
        app.publisher.publish(job.id)
    response.headers["Location"] = f"/jobs/{job.id}"
    wait_s = wait_seconds(prefer, app.settings.max_wait_s)
    if wait_s > 0.0:
        response.headers["Preference-Applied"] = f"wait={wait_s:g}"
        job = await wait_for_end(app, owner, job.id, wait_s)
    return Job.of(job)


@router.post(
    "/validate/identify",
    operation_id="validate_identify",
    summary="Check a request for identification",
    responses=documented(*BODY_ERRORS),
)
def validate_identify(body: IdentifyRequest, app: ServiceDep, owner: OwnerDep) -> IdentifyValidation:
    """Make the same checks as `POST /identify` without starting anything, and tell what it would cost."""
    with app.database.read() as session:
        return service.validate(session, owner, body)
