"""Broker and worker as real processes on a job store of their own, with leases short enough for a test."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import select

from app.database import Database, upgrade
from app.documents import unpacked
from app.jobs.creation import Terms
from app.jobs.queue import publish
from app.jobs.records import Job
from app.jobs.store import create_job, get_job
from app.tables import job_results, jobs
from cli.broker import prepare_broker
from cli.supervisor import Child, ChildSpec, Supervisor

OWNER = "local"
LEASE_S, HEARTBEAT_S, REAP_EVERY_S = 2.0, 0.5, 1.0


class Rig:
    """One broker, one worker process tree, one job store.

    Parameters
    ----------
    folder : for all its files.
    root : the repository.
    """

    def __init__(self, folder: Path, root: Path) -> None:
        url = f"sqlite:///{folder / 'jobs.sqlite3'}"
        upgrade(url)
        self.database = Database(url)
        self.supervisor = Supervisor(folder / "logs", report=lambda _sentence: None)
        self.broker = prepare_broker(folder)
        self._environment = {
            "MORPHID_DATABASE_URL": url,
            "MORPHID_BROKER_URL": self.broker.url,
            "MORPHID_LEASE_S": str(LEASE_S),
            "MORPHID_HEARTBEAT_S": str(HEARTBEAT_S),
            "MORPHID_REAP_EVERY_S": str(REAP_EVERY_S),
            "MORPHID_REPUBLISH_AFTER_S": "2",
            "PYTHONPATH": str(root),
        }
        child = self.supervisor.start(self.broker.spec)
        assert self.supervisor.wait_until(child, self.broker.answers, 10.0), child.last_words()
        self.worker: Child | None = None

    def start_worker(self) -> Child:
        """Start the worker as `morphid serve` does."""
        command = [
            *(sys.executable, "-m", "celery", "--app", "tests.faults.walk_worker:app", "worker"),
            *(
                "--queues",
                "morphid",
                "--concurrency",
                "1",
                "--prefetch-multiplier",
                "1",
                "--loglevel",
                "INFO",
            ),
            *("--without-gossip", "--without-mingle", "--beat", "--scheduler", "celery.beat:Scheduler"),
        ]
        self.worker = self.supervisor.start(
            ChildSpec(name="worker", command=command, environment=self._environment, stop_within_s=15.0)
        )
        return self.worker

    def add(self, *, published: bool = True, max_attempts: int = 3, **request: Any) -> str:
        """Queue a walk; send its wake-up message or lose it."""
        with self.database.write() as connection:
            job = create_job(
                connection,
                owner=OWNER,
                operation="walk",
                request={"seed": 7, **request},
                terms=Terms(max_attempts=max_attempts),
            )
        if published:
            assert publish(job.id, self.broker.url)
        return job.id

    def job(self, job_id: str) -> Job:
        """Give a job as it is now."""
        with self.database.read() as connection:
            return get_job(connection, OWNER, job_id)

    def result(self, job_id: str) -> dict[str, Any]:
        """Give a job's result."""
        with self.database.read() as connection:
            document: dict[str, Any] = unpacked(
                connection.execute(
                    select(job_results.c.document).where(job_results.c.job_id == job_id)
                ).scalar_one()
            )
        return document

    def until(self, condition: Callable[[], bool], within_s: float) -> None:
        """Tend the children until the condition holds."""
        deadline = time.monotonic() + within_s
        while not condition():
            assert time.monotonic() < deadline, self.worker.last_words(30) if self.worker else "timeout"
            self.supervisor.tend()
            time.sleep(0.05)

    def kill_runner_of(self, job_id: str) -> None:
        """SIGKILL the process that runs a job."""
        with self.database.read() as connection:
            name = connection.execute(select(jobs.c.worker).where(jobs.c.id == job_id)).scalar_one()
        os.kill(int(name.rpartition(":")[2]), signal.SIGKILL)

    def close(self) -> None:
        """End everything."""
        self.supervisor.stop()
        self.database.dispose()


@pytest.fixture
def rig(tmp_path: Path, root: Path) -> Iterator[Rig]:
    """Broker and job store; the test starts the worker."""
    rig = Rig(tmp_path, root)
    yield rig
    rig.close()
