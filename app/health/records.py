"""What health and metrics are made of: plain values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from app.observability.counters import Counted


@dataclass(frozen=True, slots=True)
class WorkerCounts:
    """Workers that are there; those that ended as they should are not counted."""

    alive: int  # they looked for jobs a moment ago
    stalled: int  # they have not for a while, and have not ended
    slots: int  # jobs that the living can run at once
    busy: int  # of these slots


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The rows of the service, counted."""

    jobs: Mapping[str, int]  # by state, each state there
    oldest_queued_s: float
    flights_per_s: float  # of all running jobs
    chunks: Mapping[str, int]  # of spread jobs: open, running
    deliveries_waiting: int  # of webhooks
    workers: WorkerCounts
    counters: Sequence[Counted]
