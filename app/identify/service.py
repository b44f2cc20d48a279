"""From a parsed request to an order, or to the faults that prevent it."""

from __future__ import annotations

from app.database import Session
from app.documents import Document
from app.errors import InvalidRequest
from app.identify.checks import samples_request_faults, total_rows_faults
from app.identify.cost import estimate
from app.identify.warm_start import warm_start_document
from app.jobs.submission import Order, deadline_s
from app.trajectories import repository as trajectories
from morphdata.faults import Fault
from morphdata.identify import CostEstimate, IdentifyRequest, SamplesRequest
from morphdata.samples import InlineSample, UploadedSample
from morphdata.vehicle import vehicle_document

REPORT_TIME_S = 120.0  # after the search's own time budget: uncertainty, plots, writing


def resolve(session: Session, owner: str, request: SamplesRequest) -> list[InlineSample]:
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


def checked_samples(session: Session, owner: str, request: SamplesRequest) -> list[InlineSample]:
    """Resolve the samples and check everything.

    Raises
    ------
    InvalidRequest
        Naming every fault.
    """
    samples = resolve(session, owner, request)
    faults = samples_request_faults(request, samples)
    if faults:
        raise InvalidRequest.of(faults)
    return samples


def prepare(session: Session, owner: str, request: IdentifyRequest) -> Order[CostEstimate]:
    """Check the request and make its order.

    Raises
    ------
    InvalidRequest
        Naming every fault.
    """
    samples = checked_samples(session, owner, request)
    warm_start = warm_start_document(session, owner, request)
    document = samples_document(request, samples)
    links = request.model.links_per_wing
    return Order(
        operation="identify",
        document={**document, "search": {**document["search"], **warm_start}},
        summary={**samples_summary(request, samples), "links_per_wing": links},
        cost=estimate(request, links, samples),
        max_seconds=deadline_s(request.search.max_seconds, REPORT_TIME_S),
    )


def samples_document(request: SamplesRequest, samples: list[InlineSample]) -> Document:
    """Build what the worker reads: aircraft and flight as they came, defaults of the rest filled in."""
    return {
        **vehicle_document(request.aircraft, request.flight),
        "samples": [sample.model_dump() for sample in samples],
        "model": request.model.model_dump(exclude_none=True),
        "search": request.search.model_dump(exclude_none=True, exclude={"warm_start"}),
    }


def samples_summary(request: SamplesRequest, samples: list[InlineSample]) -> Document:
    """Build what listings show."""
    return {
        "aircraft": request.aircraft.name,
        "method": request.search.method,
        "samples": [
            {"name": sample.name, "role": sample.role, "rows": len(sample.time_s)} for sample in samples
        ],
    }
