"""What the job store hands out: plain frozen values, detached from any session."""

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
    CANCELLING = "cancelling"  # a running job that was asked to wind down
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
    deadline_at: datetime | None  # of a job that never began: until when it must
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
    request_id: str | None = None  # of the call that posted the job: leads from its logs to the worker's
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

    CANCEL = "cancel"  # the user wants no more of it
    DEADLINE = "deadline"  # its time is over: finish as `expired`, with the best so far
    SHUTDOWN = "shutdown"  # this worker ends; another will go on from the checkpoint
    LOST = "lost"  # another claim or the reaper took it: nothing that this worker writes counts


@dataclass(frozen=True, slots=True)
class ReapReport:
    """What one round of the reaper did; each entry is a job id."""

    requeued: tuple[str, ...] = ()
    failed: tuple[str, ...] = ()
    cancelled: tuple[str, ...] = ()
    expired: tuple[str, ...] = ()
    publish: tuple[str, ...] = ()  # send a wake-up message for these, after the commit
