"""Counts changes of jobs, in their transaction.

Waiting times and durations are histograms over all processes, stored as one counter per bucket, not yet
cumulative.
"""

from __future__ import annotations

import bisect
from collections.abc import Mapping

from app.database import Session
from app.jobs.records import FINISHED as JOB_ENDS
from app.leases import LeasedRow, Note
from app.observability.counters import count_all, written

BUCKETS_S = (0.5, 1.0, 2.0, 5.0, 15.0, 60.0, 300.0, 900.0, 3600.0, 14400.0)  # of seconds a job waits or takes

ATTEMPTS = "job_attempts"
CHUNK_LEASES_LOST = "chunk_leases_lost"  # the reaper of chunks counts these itself
FINISHED = "jobs_finished"
FLIGHTS = "flights"
LEASES_LOST = "leases_lost"
MESSAGES_DROPPED = "messages_dropped"  # the workers count these themselves
REAP_ROUNDS = "reap_rounds"  # the reaper counts these itself
RELEASED = "jobs_released"
RUN_TIME = "job_run"  # each of these two with BUCKET and MILLISECONDS
WAIT_TIME = "job_wait"
BUCKET = "_bucket"
MILLISECONDS = "_milliseconds"


def count_change(session: Session, row: LeasedRow, note: Note) -> None:
    """Count a change of a job; progress is not counted."""
    event = note.event
    if event == "progress":
        return
    labels = {"operation": row.operation}
    rises: dict[str, int] = {}
    if event == "started":
        rises[written(ATTEMPTS, labels)] = 1
        if row.fence == 1:  # a job that was handed back starts its first attempt again
            rises |= _observed(WAIT_TIME, labels, row.started_at - row.created_at)
    if event == "released":
        rises[RELEASED] = 1
    if (note.payload or {}).get("reason") == "lease_lost":
        rises[LEASES_LOST] = 1
    if row.status in JOB_ENDS:
        rises[written(FINISHED, {**labels, "status": row.status})] = 1
        rises[written(FLIGHTS, labels)] = row.flights
        if row.started_at is not None and row.finished_at is not None:
            rises |= _observed(RUN_TIME, labels, row.finished_at - row.started_at)
    count_all(session, rises)


def _observed(name: str, labels: Mapping[str, str], seconds: float) -> dict[str, int]:
    place = bisect.bisect_left(BUCKETS_S, seconds)
    edge = f"{BUCKETS_S[place]:g}" if place < len(BUCKETS_S) else "+Inf"
    return {
        written(name + BUCKET, {**labels, "le": edge}): 1,
        written(name + MILLISECONDS, labels): max(round(seconds * 1000.0), 0),
    }
