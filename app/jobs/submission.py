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

from app.database import Session
from app.documents import Document
from app.errors import (
    BodyTooLarge,
    IdempotencyConflict,
    InvalidRequest,
    MalformedBody,
    UnsupportedMediaType,
)
from app.http.context import OwnerDep, Service, ServiceDep, demands
from app.http.json_body import JsonRoute
from app.http.prefer import IdempotencyKeyHeader, PreferHeader, wait_seconds
from app.http.problems import documented
from app.jobs import store
from app.jobs.event_stream import wait_for_end
from app.jobs.records import Job as StoredJob
from app.jobs.schemas import Job, Operation
from app.keys.records import Scope

Cost = TypeVar("Cost")
Request = TypeVar("Request")

BODY_ERRORS = (MalformedBody, BodyTooLarge, UnsupportedMediaType, InvalidRequest)
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
            responses={202: ACCEPTED, **documented(*BODY_ERRORS, IdempotencyConflict)},
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
    owner: str
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
        if self.wait_s > 0.0:
            headers["Preference-Applied"] = f"wait={self.wait_s:g}"
            job = await wait_for_end(self.app, self.owner, job.id, self.wait_s)
        return Job.of(job)

    def _write(self, prepare: Prepare[Request, Any], request: Request) -> StoredJob:
        settings = self.app.settings
        with self.app.database.write() as session:
            order = prepare(session, self.owner, request)
            return store.create_job(
                session,
                owner=self.owner,
                operation=order.operation,
                request=order.document,
                summary=order.summary,
                idempotency_key=self.idempotency_key,
                max_attempts=settings.job_max_attempts,
                max_seconds=settings.job_max_seconds if order.max_seconds is None else order.max_seconds,
            )


def _submission(
    response: Response,
    app: ServiceDep,
    owner: OwnerDep,
    idempotency_key: IdempotencyKeyHeader = None,
    prefer: PreferHeader = None,
) -> Submission:
    wait_s = wait_seconds(prefer, app.settings.max_wait_s)
    return Submission(app, owner, response, idempotency_key, wait_s)


SubmissionDep = Annotated[Submission, Depends(_submission)]


def priced(app: Service, owner: str, prepare: Prepare[Request, Cost], request: Request) -> Cost:
    """Make the checks of a submission, start nothing, and tell what it would cost.

    Raises
    ------
    InvalidRequest
        Naming every fault.
    """
    with app.database.read() as session:
        return prepare(session, owner, request).cost
