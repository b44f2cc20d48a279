"""The calls of the operations: ``POST /name`` starts a job, ``POST /validate/name`` only checks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Depends, Response
from fastapi.concurrency import run_in_threadpool
from pydantic import create_model

from app.audit.records import Action
from app.audit.repository import note
from app.documents import Document, sealed
from app.errors import IdempotencyConflict, QuotaExceeded
from app.http.context import Caller, CallerDep, Service, ServiceDep, demands
from app.http.json_body import BODY_ERRORS, JsonRoute
from app.http.parameters import IdempotencyKeyHeader, PreferHeader, wait_seconds
from app.http.problems import documented
from app.jobs.event_stream import wait_for_end
from app.jobs.records import Job as StoredJob
from app.jobs.schemas import Job, Validation
from app.jobs.store import Origin, Terms, create_job
from app.keys import quota
from app.keys.records import Scope
from app.keys.schemas import Quotas
from app.observability.tracing import current_traceparent
from app.operations.references import resolved
from morphdata.execution import Execution, Request
from morphdata.operations import OPERATIONS
from morphdata.operations.descriptor import Operation

router = APIRouter()

ACCEPTED: dict[str, Any] = {
    "description": "The job, queued (or ended, with `Prefer: wait`).",
    "headers": {
        "Location": {"description": "The job.", "schema": {"type": "string"}},
        "Idempotency-Replayed": {
            "description": "`true` if the response repeats an earlier one.",
            "schema": {"type": "string"},
        },
        "Preference-Applied": {
            "description": "The wait that was honoured.",
            "schema": {"type": "string"},
        },
    },
}


@dataclass(frozen=True, slots=True)
class Submission:
    """One call that starts a job: the caller, its preferences, and the response headers."""

    app: Service
    caller: Caller
    response: Response
    idempotency_key: str | None
    wait_s: float

    async def accept(self, operation: Operation[Any], request: Request) -> Job:
        """Check the request, write its job, wake a worker, and wait for the end if requested."""
        job = await run_in_threadpool(self._write, operation, request)
        headers = self.response.headers
        if job.replayed:
            headers["Idempotency-Replayed"] = "true"
        else:
            self.app.publisher.publish(job.id)
        headers["Location"] = f"/jobs/{job.id}"
        # the job exists: an owner with too many waiting requests gets a response at once, not a refusal
        wait_s = self.wait_s if self.app.waits.has_room(self.caller.owner) else 0.0
        if wait_s > 0.0:
            headers["Preference-Applied"] = f"wait={wait_s:g}"
        return await wait_for_end(self.app, self.caller, job.id, wait_s, accepted=job)

    def _write(self, operation: Operation[Any], request: Request) -> StoredJob:
        with self.app.database.read() as session:
            request = resolved(session, self.caller.owner, request)
        # nothing is computed during the write transaction: on SQLite all other writers wait for it
        document, summary = sealed(request.document()), operation.summary(request)
        flights = getattr(operation.cost(request), "flights", 1)
        terms = self._terms(operation.deadline_s(request), request.execution)
        origin = Origin(self.caller.key_id, self.caller.request_id or None, current_traceparent())
        with self.app.database.write() as session:
            job = create_job(
                session,
                owner=self.caller.owner,
                operation=operation.name,
                request=document,
                summary=summary,
                flights_estimated=flights,
                terms=terms,
                origin=origin,
                idempotency_key=self.idempotency_key,
            )
            if not job.replayed:
                note(session, self.caller, Action.JOB_POST, job.id, detail={"operation": operation.name})
        return job

    def _terms(self, deadline_s: float | None, execution: Execution) -> Terms:
        settings = self.app.settings
        return Terms(
            priority=execution.priority,
            label=execution.label,
            max_attempts=execution.max_attempts or settings.job_max_attempts,
            max_seconds=settings.job_max_seconds if deadline_s is None else deadline_s,
            expires_in_s=execution.expires_in_s,
        )


def _submission(
    response: Response,
    app: ServiceDep,
    caller: CallerDep,
    idempotency_key: IdempotencyKeyHeader = None,
    prefer: PreferHeader = None,
) -> Submission:
    wait_s = wait_seconds(prefer, app.settings.max_wait_s)
    return Submission(app, caller, response, idempotency_key, wait_s)


SubmissionDep = Annotated[Submission, Depends(_submission)]


def validated(app: Service, caller: Caller, operation: Operation[Any], request: Request) -> Document:
    """Check a submission without starting it; report cost, place in the queue and quotas."""
    with app.database.read() as session:
        request = resolved(session, caller.owner, request)
        place = app.queue.place_of_next(session, caller.owner, operation.name, request.execution.priority)
        used = None if caller.key_id is None else quota.usage(session, caller.key_id)
    return {
        "cost": operation.cost(request),
        "queue": place,
        "quotas": None if used is None else Quotas.of(used, caller.quota),
    }


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
