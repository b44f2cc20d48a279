"""Schemas of jobs."""

from __future__ import annotations

from datetime import datetime
from typing import TYPE_CHECKING, Any, Literal, Union

from pydantic import BaseModel, ConfigDict, Field

from app.jobs.records import Job as StoredJob
from app.jobs.records import JobStatus
from app.keys.schemas import Quotas
from morphdata.links import LinksPerWing
from morphdata.operations import OPERATIONS

EXAMPLE_ID = "job_01k0c3v9fh8x2m4n6p8q0r2s4t"
if TYPE_CHECKING:
    OperationName = str
    JobResult = Any
else:
    OperationName = Literal[tuple(operation.name for operation in OPERATIONS)]
    JobResult = Union[tuple(operation.result for operation in OPERATIONS)]  # noqa: UP007 - of a list


class Progress(BaseModel):
    """Progress of a running job."""

    model_config = ConfigDict(extra="ignore")

    fraction: float | None = Field(default=None, description="0 to 1.")
    phase: str | None = Field(default=None, examples=["swarm"])
    message: str | None = None
    generation: int | None = None
    best_cost: float | None = Field(
        default=None,
        description="Least cost so far: sum of squared angle errors (identify, study) or attitude variation "
        "(optimize), rad^2.",
    )
    flights: int | None = Field(default=None, description="Flights flown so far.")
    flights_per_s: float | None = None
    eta_s: float | None = Field(default=None, description="Estimated time to the end.")


class JobError(BaseModel):
    """Why a job did not succeed."""

    model_config = ConfigDict(extra="ignore")

    code: str = Field(
        description="Stable, for programs.", examples=["not_flyable", "worker_lost", "invalid_input"]
    )
    detail: str
    pointer: str = ""
    hint: str = ""


class SampleSummary(BaseModel):
    """A sample of the request without its rows."""

    name: str
    role: str
    rows: int


class RequestSummary(BaseModel):
    """Summary of a job's request; the fields present depend on the operation."""

    model_config = ConfigDict(extra="allow")

    aircraft: str | None = None
    links_per_wing: LinksPerWing | None = Field(default=None, description="Of the equivalent model.")
    compared_links: list[LinksPerWing] = Field(
        default=[], description="Numbers of links per wing of a study."
    )
    model: str | None = Field(default=None, description="The model that a simulation flies.")
    method: str | None = Field(default=None, description="Of the search.")
    drives: list[str] = Field(
        default=[],
        description="The drives that move, both sides of a kind under its word; empty where it is the sweep.",
    )
    samples: list[SampleSummary] = []
    duration_s: float | None = Field(default=None, description="Of the flight or of the morph.")
    final_rad: float | None = Field(default=None, description="Sweep at the end of the morph.")
    format: str | None = Field(default=None, description="Of an exported file.")


class QueuePlace(BaseModel):
    """Place of a queued job. Owners take turns, so another owner's long queue does not delay it."""

    position: int = Field(description="Place in the queue, 1 is next, assuming no further jobs are posted.")
    eta_s: float | None = Field(
        description="Time to its start, estimated from recent durations and the workers; null while "
        "nothing is known."
    )


class Validation(BaseModel):
    """The request is valid; each operation adds its name and its cost."""

    valid: Literal[True] = True
    cost: Any
    queue: QueuePlace = Field(description="The job's place in the queue if it were posted now.")
    quotas: Quotas | None = Field(description="Of your key; null if the service requires no keys.")


class JobLinks(BaseModel):
    """Links to the parts of a job."""

    self: str
    events: str
    result: str
    artifacts: str
    cancel: str


class Job(BaseModel):
    """A piece of long work."""

    id: str = Field(examples=[EXAMPLE_ID])
    operation: str = Field(examples=["identify"])
    status: JobStatus = Field(
        description="`succeeded`, `failed`, `cancelled`, `expired` are final; `cancelling` is about to end."
    )
    progress: Progress | None
    error: JobError | None
    partial: bool = Field(description="The result is the best so far of a job that did not finish.")
    attempt: int = Field(description="Number of attempts; more than one after a worker was lost.")
    max_attempts: int
    priority: int
    label: str | None
    queue: QueuePlace | None = Field(description="While it is queued; null in lists.")
    request: RequestSummary
    model_id: str | None = Field(
        description="The identified model (for a study: the recommended one), once there is one: "
        "GET /models/{model_id}."
    )
    last_event: int = Field(description="Number of the newest event.")
    created_at: datetime
    started_at: datetime | None
    updated_at: datetime
    finished_at: datetime | None
    deadline_at: datetime | None = Field(
        description="When it must end; of a job that has not begun and has `execution.expires_in_s`: when it "
        "must have begun."
    )
    links: JobLinks

    @classmethod
    def of(cls, job: StoredJob, place: QueuePlace | None = None) -> Job:
        """Show a stored job with its place in the queue."""
        at = f"/jobs/{job.id}"
        parts = ("events", "result", "artifacts", "cancel")
        shown = {name: getattr(job, name) for name in cls.model_fields if hasattr(job, name)}
        return cls(
            **shown,
            queue=place,
            request=RequestSummary.model_validate(job.summary),
            last_event=job.event_seq,
            links=JobLinks(self=at, **{part: f"{at}/{part}" for part in parts}),
        )


class JobPage(BaseModel):
    """Jobs, newest first."""

    jobs: list[Job]
    next_cursor: str | None = Field(description="Pass as `cursor` to get the next page; null on the last.")


class JobEvent(BaseModel):
    """One event of a job's history."""

    model_config = ConfigDict(from_attributes=True)

    seq: int = Field(description="Rises from 1.")
    type: str = Field(description="`queued`, `started`, `progress`, `requeued`, ... or the final status.")
    payload: dict[str, Any]
    at: datetime


class JobEventPage(BaseModel):
    """Events, oldest first; beyond the latest few thousand, one progress event in 120 is kept."""

    events: list[JobEvent]
    last_seq: int = Field(description="Pass as `after` to continue from here.")
    finished: bool = Field(description="No more events will follow.")


class Artifact(BaseModel):
    """A file produced by a job."""

    name: str = Field(examples=["attitude_rate_0.5.svg"])
    media_type: str = Field(examples=["image/svg+xml"])
    size_bytes: int
    href: str


class ArtifactList(BaseModel):
    """The files of a job."""

    artifacts: list[Artifact]
