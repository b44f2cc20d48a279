"""Identifications in a job store of their own, and worker processes of one thread each."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import psutil
from sqlalchemy import select

from app.database import Database
from app.documents import unpacked
from app.jobs.records import Job, JobStatus
from app.jobs.store import Terms, create_job, get_job
from app.tables import job_results

ROOT = Path(__file__).resolve().parents[3]
OWNER = "local"


class Workers:
    """Worker processes over one job store; a context manager that ends them.

    Parameters
    ----------
    database : the job store, migrated.
    chunk_lease_s : life of a claim on a chunk, s.
    """

    def __init__(self, database: Database, *, chunk_lease_s: float = 15.0) -> None:
        self.database = database
        self._chunk_lease_s = chunk_lease_s
        self._processes: dict[str, subprocess.Popen[str]] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for name in list(self._processes):
            self.kill(name)

    def start(self, *names: str) -> None:
        """Start some and wait until their kernels are ready."""
        url = self.database.engine.url.render_as_string(hide_password=False)
        for name in names:
            command = [sys.executable, "-m", "tests.worker.spread.polling_worker", url, name]
            self._processes[name] = subprocess.Popen(
                [*command, str(self._chunk_lease_s)],
                cwd=ROOT,
                env={**os.environ, "NUMBA_NUM_THREADS": "1"},
                stdout=subprocess.PIPE,
                text=True,
            )
        for name in names:
            stdout = self._processes[name].stdout
            assert stdout is not None
            assert stdout.readline() == "ready\n", f"worker {name} ended"

    def cpu_s(self) -> float:
        """CPU time that all worker processes have used, s."""
        times = [psutil.Process(process.pid).cpu_times() for process in self._processes.values()]
        return float(sum(time.user + time.system for time in times))

    def kill(self, name: str) -> None:
        """SIGKILL one."""
        process = self._processes.pop(name)
        process.send_signal(signal.SIGKILL)
        process.communicate()

    def add(self, request: dict[str, Any]) -> str:
        """Queue an identification."""
        with self.database.write() as session:
            terms = Terms()
            return create_job(session, owner=OWNER, operation="identify", request=request, terms=terms).id

    def job(self, job_id: str) -> Job:
        """Give a job as it is now."""
        with self.database.read() as session:
            return get_job(session, OWNER, job_id)

    def wait(self, job_id: str, within_s: float) -> Job:
        """Wait until a job has succeeded."""
        until = time.monotonic() + within_s
        while not (job := self.job(job_id)).finished:
            assert time.monotonic() < until, f"{job.status} {job.progress}"
            time.sleep(0.05)
        assert job.status is JobStatus.SUCCEEDED, job.error
        return job

    def content(self, job_id: str) -> dict[str, Any]:
        """A job's result without what a clock put into it."""
        query = select(job_results.c.document).where(job_results.c.job_id == job_id)
        with self.database.read() as session:
            document: dict[str, Any] = unpacked(session.execute(query).scalar_one())
        search = {key: value for key, value in document["search"].items() if key != "wall_s"}
        return {**document, "search": search, "cost": None}


def spread(request: dict[str, Any], chunks: int = 16) -> dict[str, Any]:
    """The same request, over several workers."""
    return {**request, "execution": {"mode": "distributed", "chunks": chunks}}
