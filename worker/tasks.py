"""The two tasks: run a job, reap what was lost. Thin; the work is in `runner` and in the job store."""

from __future__ import annotations

import logging
import os
import socket

from app.database import Database
from app.jobs.reaper import reap
from app.settings import load_settings
from worker import numerics, shutdown
from worker.attempt import Ending
from worker.celery_app import QUEUE, REAP, RUN_JOB, app, threads_per_job
from worker.runner import Runner

log = logging.getLogger(__name__)


class Process:
    """What one pool child keeps between tasks.

    Parameters
    ----------
    threads : numeric threads of one job.
    """

    def __init__(self, threads: int) -> None:
        self.settings = load_settings()
        self.database = Database(self.settings.database_url)
        self.kernels = numerics.Kernels(numerics.warm_up_library, threads)
        self.runner = Runner(
            database=self.database,
            kernels=self.kernels,
            worker_name=f"{socket.gethostname()}:{os.getpid()}",
            lease_s=self.settings.lease_s,
            heartbeat_s=self.settings.heartbeat_s,
            shutting_down=shutdown.announced,
        )


_processes: dict[int, Process] = {}  # by process id: a forked child never uses its parent's connections


def enter_process() -> Process:
    """Give this process its database and kernels, made on first use."""
    if os.getpid() not in _processes:
        _processes.clear()
        process = _processes[os.getpid()] = Process(threads_per_job())
        process.kernels.start()
    return _processes[os.getpid()]


def publish(job_id: str) -> None:
    """Send the wake-up hint for a queued job."""
    app.send_task(RUN_JOB, args=[job_id], queue=QUEUE)


@app.task(name=RUN_JOB)
def run_job(job_id: str) -> None:
    """Run the job that should run next (a hint names the job that caused it)."""
    log.debug("woken for job %s", job_id)
    ending, released_id = enter_process().runner.run_next()
    if ending is Ending.RELEASED and released_id is not None:
        publish(released_id)


@app.task(name=REAP)
def reap_jobs(republish_after_s: float | None = None) -> None:
    """Give back what dead workers held, end what ran out of time, repeat lost hints."""
    process = enter_process()
    if republish_after_s is None:
        republish_after_s = process.settings.republish_after_s
    with process.database.write() as connection:
        report = reap(connection, republish_after_s=republish_after_s)
    for kind in ("requeued", "failed", "cancelled", "expired"):
        for job_id in getattr(report, kind):
            log.warning("reaper: job %s %s", job_id, kind)
    for job_id in report.publish:
        publish(job_id)
