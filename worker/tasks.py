"""The two tasks: run a job, reap lost work. They are thin; the work is in `runner` and in the job store."""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from itertools import repeat

from sqlalchemy.exc import SQLAlchemyError

from app.database import Database
from app.database_errors import trouble_of
from app.jobs.queue import RUN_JOB, messages_waiting
from app.jobs.queue import publish as send_hint
from app.jobs.reaper import log_ends, reap
from app.jobs.records import ReapReport
from app.jobs.rows import Unit
from app.jobs.turns import next_unit
from app.observability.counters import count
from app.observability.job_counts import REAP_ROUNDS
from app.observability.tracing import forget_tracing, start_tracing
from app.settings import load_settings
from worker import numerics, shutdown
from worker.attempt import Ending
from worker.celery_app import app, threads_per_job
from worker.hints import REAP
from worker.presence import process_name
from worker.runner import CHUNK_LEASE_S, Runner

log = logging.getLogger(__name__)


class Process:
    """State that a pool child keeps between tasks."""

    def __init__(self, threads: int) -> None:
        self.settings = load_settings()
        self.reaped_at = float("-inf")
        self.database = Database(self.settings.database_url)
        self.kernels = numerics.Kernels(numerics.warm_up_library, threads, numerics.warm_up_library_further)
        self.runner = Runner(
            database=self.database,
            kernels=self.kernels,
            worker_name=process_name(),
            lease_s=self.settings.lease_s,
            heartbeat_s=self.settings.heartbeat_s,
            shutting_down=shutdown.announced,
            publish=lambda job_id, count: publish_all(repeat(job_id, count)),
            chunk_lease_s=min(self.settings.lease_s, CHUNK_LEASE_S),
        )

    def reap_is_due(self) -> bool:
        """Whether this process has not reaped recently."""
        return bool(time.monotonic() - self.reaped_at > app.conf.beat_schedule["reap"]["schedule"] / 2.0)

    def next_unit(self) -> Unit | None:
        """The work that should be done next."""
        with self.database.read() as session:
            return next_unit(session)


_processes: dict[int, Process] = {}  # by process id: a forked child never uses its parent's connections


def enter_process() -> Process:
    """Give this process its database and kernels, made on first use."""
    if os.getpid() not in _processes:
        _processes.clear()
        forget_tracing()
        process = _processes[os.getpid()] = Process(threads_per_job())
        start_tracing("morphid-worker", process.settings.traces)
        process.kernels.start()
    return _processes[os.getpid()]


@contextmanager
def _unless_away() -> Iterator[None]:
    """Ignore an unreachable job store: the reaper repeats the message when the store is back."""
    try:
        yield
    except SQLAlchemyError as error:
        trouble = trouble_of(error)
        if trouble is None:
            raise
        log.warning("the job store is %s; the reaper will retry", trouble.value)


def publish(job_id: str) -> bool:
    """Send the wake-up hint for a queued job; without a broker the workers' own checks replace it."""
    return send_hint(job_id, enter_process().settings.broker_url)


def publish_all(job_ids: Iterable[str]) -> None:
    """Send several hints, until the broker refuses one."""
    all(publish(job_id) for job_id in job_ids)


@app.task(name=RUN_JOB)
def run_job(job_id: str) -> None:
    """Run the job that should run next (a hint names the job that caused it)."""
    log.debug("woken for job %s", job_id)
    with _unless_away():
        process = enter_process()
        ending, released_id = process.runner.run_next()
        if ending is Ending.RELEASED and released_id is not None:
            publish(released_id)
        elif ending is not Ending.NOTHING_QUEUED:
            # wake a worker for the next job unless a message is on its way: a lost one costs nothing
            unit = process.next_unit()
            if unit is not None and messages_waiting(process.settings.broker_url) == 0:
                publish(unit.job_id)


def work_waits() -> bool:
    """Whether a job or a part of one is waiting; False while shutting down or while the store is away."""
    if shutdown.announced():
        return False
    unit = None
    with _unless_away():
        unit = enter_process().next_unit()
    return unit is not None


@app.task(name=REAP)
def reap_jobs(republish_after_s: float | None = None) -> None:
    """Release the work of dead workers, end jobs that ran out of time, repeat lost hints."""
    process = enter_process()
    if republish_after_s is None:
        if not process.reap_is_due():
            return  # messages accumulate while every worker is busy: the first of them did the work
        republish_after_s = process.settings.republish_after_s
    report = ReapReport()
    with _unless_away(), process.database.write() as session:
        report = reap(session, republish_after_s=republish_after_s)
        count(session, REAP_ROUNDS)
    process.reaped_at = time.monotonic()
    log_ends(report)
    publish_all(report.publish)
