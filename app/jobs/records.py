"""Values returned by the job store: plain and frozen, detached from any session."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import Enum, StrEnum
from typing import Any


class JobStatus(StrEnum):
    """States of a job: ``queued -> running -> succeeded | failed | cancelled | expired``."""

    QUEUED = "queued"
    RUNNING = "running"
    CANCELLING = "cancelling"  # a running job whose cancellation was requested
    SUCCEEDED = "succeeded"
    FAILED = "failed"
    CANCELLED = "cancelled"
    EXPIRED = "expired"


HELD = (JobStatus.RUNNING.value, JobStatus.CANCELLING.value)  # a worker holds the claim
FINISHED = (
    JobStatus.SUCCEEDED.value,
    JobStatus.FAILED.value,
    JobStatus.CANCELLED.value,
    JobStatus.EXPIRED.value,
)


def moment(seconds: float) -> datetime:
    """Database time (s since 1970 UTC) as an aware datetime."""
    return datetime.fromtimestamp(seconds, UTC)


def optional_moment(seconds: float | None) -> datetime | None:
    """The same for a time that may not have come yet."""
    return None if seconds is None else moment(seconds)


@dataclass(frozen=True, slots=True)
class Job:
    """One job row without its request, result and artifacts."""

    id: str
    owner: str
    operation: str
    status: JobStatus
    priority: int
    summary: Mapping[str, Any]
    progress: Mapping[str, Any] | None
    error: Mapping[str, Any] | None
    attempt: int
    max_attempts: int
    event_seq: int
    model_id: str | None
    partial: bool
    created_at: datetime
    started_at: datetime | None
    updated_at: datetime
    finished_at: datetime | None
    deadline_at: datetime | None  # latest start of a job that has not started
    label: str | None = None
    replayed: bool = False  # this answer repeats an earlier one with the same idempotency key

    @property
    def finished(self) -> bool:
        """Whether the job is in a state that it never leaves."""
        return self.status.value in FINISHED


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """A worker's right to write to one job, until its lease runs out or a later claim has a higher fence."""

    job_id: str
    owner: str
    operation: str
    fence: int
    attempt: int
    max_attempts: int
    worker: str
    request_id: str | None = None  # of the call that posted the job, to connect its logs with the worker's
    traceparent: str | None = None
    waited_s: float = 0.0  # since the job was made

    @property
    def key(self) -> tuple[str | int, ...]:
        """Key of the row."""
        return (self.job_id,)


@dataclass(frozen=True, slots=True, kw_only=True)
class ChunkClaim(Claim):
    """A worker's right to store the outcome of one chunk of a job; fence and attempt are the chunk's."""

    generation: int
    number: int
    task: bytes

    @property
    def key(self) -> tuple[str | int, ...]:
        """Key of the row."""
        return (self.job_id, self.generation, self.number)


class StopReason(Enum):
    """Why running work should stop."""

    CANCEL = "cancel"  # the user cancelled it
    DEADLINE = "deadline"  # its time is over: finish as `expired`, with the best result so far
    SHUTDOWN = "shutdown"  # this worker shuts down; another will continue from the checkpoint
    LOST = "lost"  # another claim or the reaper took it: writes of this worker are void


@dataclass(frozen=True, slots=True)
class ReapReport:
    """The result of one round of the reaper; each entry is a job id."""

    requeued: tuple[str, ...] = ()
    failed: tuple[str, ...] = ()
    cancelled: tuple[str, ...] = ()
    expired: tuple[str, ...] = ()
    publish: tuple[str, ...] = ()  # send a wake-up message for these, after the commit
