"""From a parsed request to a job, or to the faults that prevent it."""

from __future__ import annotations

from app.database import Session
from app.documents import Document
from app.errors import Fault, InvalidRequest
from app.identify.checks import identify_faults, total_rows_faults
from app.identify.cost import estimate
from app.identify.schemas import IdentifyRequest, IdentifyValidation
from app.jobs import store
from app.jobs.records import Job
from app.schemas.samples import InlineSample, UploadedSample
from app.trajectories import repository as trajectories

REPORT_TIME_S = 120.0  # after the search's own time budget: uncertainty, plots, writing


def resolve(session: Session, owner: str, request: IdentifyRequest) -> list[InlineSample]:
    """Return the samples with their rows, in the order of the request.

    Raises
    ------
    InvalidRequest
        When a trajectory does not exist, or the samples have too many rows together.
    """
    uploads = [sample.trajectory_id for sample in request.samples if isinstance(sample, UploadedSample)]
    rows = trajectories.row_counts(session, owner, uploads)
    faults = [
        Fault(
            "trajectory_not_found",
            f"There is no trajectory {sample.trajectory_id}.",
            f"/samples/{number}/trajectory_id",
            "Upload it with POST /trajectories first.",
        )
        for number, sample in enumerate(request.samples)
        if isinstance(sample, UploadedSample) and sample.trajectory_id not in rows
    ]
    # before any row is read: a short request may name a flight of 100000 rows many times
    faults += total_rows_faults(
        len(sample.time_s) if isinstance(sample, InlineSample) else rows.get(sample.trajectory_id, 0)
        for sample in request.samples
    )
    if faults:
        raise InvalidRequest.of(faults)
    return [
        sample if isinstance(sample, InlineSample) else _uploaded(session, owner, sample)
        for sample in request.samples
    ]


def _uploaded(session: Session, owner: str, sample: UploadedSample) -> InlineSample:
    stored, columns = trajectories.get_trajectory(session, owner, sample.trajectory_id)
    return InlineSample(name=sample.name or stored.name, role=sample.role, weight=sample.weight, **columns)


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
