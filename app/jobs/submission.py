"""What all operations share at the door: a checked request becomes an order, an order becomes a job.

An operation's folder has a request schema, a service with one function ``prepare(session, owner, request)``
that makes an `Order` or tells every fault, and endpoints of a few lines on an `OperationRouter`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, Generic, TypeVar

from fastapi import APIRouter, Depends, Response
from fastapi.concurrency import run_in_threadpool

from app.audit.records import Action
from app.audit.service import note
from app.database import Session
from app.documents import Document, sealed
from app.errors import IdempotencyConflict, QuotaExceeded
from app.http.context import Caller, CallerDep, Service, ServiceDep, demands
from app.http.json_body import BODY_ERRORS, JsonRoute
from app.http.prefer import IdempotencyKeyHeader, PreferHeader, wait_seconds
from app.http.problems import documented
from app.jobs import store
from app.jobs.creation import Origin, Terms
from app.jobs.event_stream import wait_for_end
from app.jobs.records import Job as StoredJob
from app.jobs.schemas import Job, Operation, QueuePlace, Validation
from app.keys import quota
from app.keys.records import Scope
from app.keys.schemas import Quotas
from app.observability.tracing import current_traceparent
from morphdata.execution import Executed, Execution

Cost = TypeVar("Cost")
Request = TypeVar("Request", bound=Executed)

ACCEPTED: dict[str, Any] = {
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
}


@dataclass(frozen=True, slots=True)
class Order(Generic[Cost]):
    """A request that passed every check.

    Attributes
    ----------
    operation : str
    document : dict
        What the worker reads: samples inline, references resolved.
    summary : dict
        The few small facts that listings show.
    cost
        What it would take, to an order of magnitude.
    max_seconds : float or None
        Deadline counted from the first claim, s; None for the service's own.
    """

    operation: Operation
    document: Document
    summary: Document
    cost: Cost
    max_seconds: float | None = None


Prepare = Callable[[Session, str, Request], Order[Cost]]


def deadline_s(budget_s: float | None, afterwards_s: float) -> float | None:
    """Deadline of a search: its own time budget and what comes afterwards; None without a budget."""
    return None if budget_s is None else budget_s + afterwards_s


class OperationRouter(APIRouter):
    """The two doors of one operation: ``POST /name`` starts a job, ``POST /validate/name`` only checks.

    Parameters
    ----------
    operation : str
        Its name.
    """

    def __init__(self, operation: Operation) -> None:
        super().__init__(tags=[operation], route_class=JsonRoute, dependencies=[demands(Scope.JOBS_WRITE)])
        self.operation = operation

    def submission(self, summary: str) -> Callable[..., Any]:
        """Decorate the endpoint that starts a job."""
        return self.post(
            f"/{self.operation}",
            operation_id=self.operation,
            summary=summary,
            status_code=202,
            responses={202: ACCEPTED, **documented(*BODY_ERRORS, IdempotencyConflict, QuotaExceeded)},
        )

    def validation(self, summary: str) -> Callable[..., Any]:
        """Decorate the endpoint that checks a request."""
        return self.post(
            f"/validate/{self.operation}",
            operation_id=f"validate_{self.operation}",
            summary=summary,
            responses=documented(*BODY_ERRORS),
        )


@dataclass(frozen=True, slots=True)
class Submission:
    """One call that starts a job: who calls, with which preferences, and the answer's headers."""

    app: Service
    caller: Caller
    response: Response
    idempotency_key: str | None
    wait_s: float

    async def accept(self, prepare: Prepare[Request, Any], request: Request) -> Job:
        """Check the request, write its job, wake a worker, and wait for the end as far as asked.

        Raises
        ------
        InvalidRequest
            Naming every fault.
        IdempotencyConflict
            The key was used for another request.
        """
        job = await run_in_threadpool(self._write, prepare, request)
        headers = self.response.headers
        if job.replayed:
            headers["Idempotency-Replayed"] = "true"
        else:
            self.app.publisher.publish(job.id)
        headers["Location"] = f"/jobs/{job.id}"
        # the job is made: an owner with too many waiting requests is answered at once and not refused
        wait_s = self.wait_s if self.app.waits.has_room(self.caller.owner) else 0.0
        if wait_s > 0.0:
            headers["Preference-Applied"] = f"wait={wait_s:g}"
        return await wait_for_end(self.app, self.caller, job.id, wait_s, accepted=job)

    def _write(self, prepare: Prepare[Request, Any], request: Request) -> StoredJob:
        with self.app.database.read() as session:
            order = prepare(session, self.caller.owner, request)
        # nothing is computed while the write transaction lasts: on SQLite everybody else waits for it
        document = sealed({**order.document, "execution": request.execution.model_dump(exclude_none=True)})
        terms = self._terms(order, request.execution)
        origin = Origin(self.caller.key_id, self.caller.request_id or None, current_traceparent())
        with self.app.database.write() as session:
            job = store.create_job(
                session,
                owner=self.caller.owner,
                operation=order.operation,
                request=document,
                summary=order.summary,
                flights_estimated=getattr(order.cost, "flights", 1),
                terms=terms,
                origin=origin,
                idempotency_key=self.idempotency_key,
            )
            if not job.replayed:
                note(session, self.caller, Action.JOB_POST, job.id, detail={"operation": order.operation})
        return job

    def _terms(self, order: Order[Any], execution: Execution) -> Terms:
        settings = self.app.settings
        return Terms(
            priority=execution.priority,
            label=execution.label,
            max_attempts=execution.max_attempts or settings.job_max_attempts,
            max_seconds=settings.job_max_seconds if order.max_seconds is None else order.max_seconds,
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


Verdict = TypeVar("Verdict", bound=Validation)


def validated(
    app: Service,
    caller: Caller,
    prepare: Prepare[Request, Any],
    request: Request,
    verdict: type[Verdict],
) -> Verdict:
    """Make the checks of a submission, start nothing; tell what it would cost and how long it would wait.

    Raises
    ------
    InvalidRequest
        Naming every fault.
    """
    with app.database.read() as session:
        order = prepare(session, caller.owner, request)
        place = app.queue.place_of_next(session, caller.owner, order.operation, request.execution.priority)
        used = None if caller.key_id is None else quota.usage(session, caller.key_id)
    return verdict(
        cost=order.cost,
        queue=QueuePlace.of(place),
        quotas=None if used is None else Quotas.of(used, caller.quota),
    )
