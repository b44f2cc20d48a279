"""From a parsed request to a job, or to the faults that prevent it."""

from __future__ import annotations

from app.database import Session
from app.documents import Document
from app.errors import Fault, InvalidRequest, TrajectoryNotFound
from app.identify.checks import identify_faults
from app.identify.cost import estimate
from app.identify.schemas import IdentifyRequest, IdentifyValidation
from app.jobs import store
from app.jobs.records import Job
from app.schemas.samples import InlineSample
from app.trajectories import repository as trajectories

REPORT_TIME_S = 120.0  # after the search's own time budget: uncertainty, plots, writing


def resolve(session: Session, owner: str, request: IdentifyRequest) -> list[InlineSample]:
    """Return the samples with their rows, in the order of the request.

    Raises
    ------
    InvalidRequest
        When a trajectory does not exist.
    """
    samples = []
    faults = []
    for number, sample in enumerate(request.samples):
        if isinstance(sample, InlineSample):
            samples.append(sample)
            continue
        try:
            summary, columns = trajectories.get_trajectory(session, owner, sample.trajectory_id)
        except TrajectoryNotFound as error:
            faults.append(Fault(error.code, error.detail, f"/samples/{number}/trajectory_id", error.hint))
            continue
        samples.append(
            InlineSample(name=sample.name or summary.name, role=sample.role, weight=sample.weight, **columns)
        )
    if faults:
        raise InvalidRequest.of(faults)
    return samples


def checked(session: Session, owner: str, request: IdentifyRequest) -> list[InlineSample]:
    """Resolve the samples and check everything.

    Raises
    ------
    InvalidRequest
        Naming every fault.
    """
    samples = resolve(session, owner, request)
    faults = identify_faults(request, samples)
    if faults:
        raise InvalidRequest.of(faults)
    return samples


def validate(session: Session, owner: str, request: IdentifyRequest) -> IdentifyValidation:
    """Make the checks of `submit` and tell what it would cost."""
    return IdentifyValidation(cost=estimate(request, checked(session, owner, request)))


def submit(
    session: Session,
    owner: str,
    request: IdentifyRequest,
    *,
    idempotency_key: str | None,
    max_attempts: int,
    default_max_seconds: float,
) -> Job:
    """Check the request and write its job; publish the job's id after the commit."""
    samples = checked(session, owner, request)
    budget_s = request.search.max_seconds
    return store.create_job(
        session,
        owner=owner,
        operation="identify",
        request=_document(request, samples),
        idempotency_key=idempotency_key,
        max_attempts=max_attempts,
        max_seconds=default_max_seconds if budget_s is None else budget_s + REPORT_TIME_S,
        summary=_summary(request, samples),
    )


def _document(request: IdentifyRequest, samples: list[InlineSample]) -> Document:
    """Build what the worker reads: aircraft and flight as they came, defaults of the rest filled in."""
    return {
        "aircraft": request.aircraft.model_dump(exclude_unset=True, exclude_none=True),
        "flight": request.flight.model_dump(exclude_unset=True, exclude_none=True),
        "samples": [sample.model_dump() for sample in samples],
        "model": request.model.model_dump(exclude_none=True),
        "search": request.search.model_dump(exclude_none=True),
    }


def _summary(request: IdentifyRequest, samples: list[InlineSample]) -> Document:
    return {
        "aircraft": request.aircraft.name,
        "links_per_wing": request.model.links_per_wing,
        "method": request.search.method,
        "samples": [
            {"name": sample.name, "role": sample.role, "rows": len(sample.time_s)} for sample in samples
        ],
    }
