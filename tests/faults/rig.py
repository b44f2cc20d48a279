"""Database, broker, API and workers as real processes, with leases short enough for a test."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import psutil
from sqlalchemy import select
from sqlalchemy.exc import SQLAlchemyError

from app.database import Database, upgrade
from app.documents import unpacked
from app.jobs.queue import publish
from app.jobs.records import Job
from app.jobs.store import Terms, create_job, get_job
from app.tables import job_results, jobs
from morphid import serve
from morphid.broker import LOOPBACK, free_port
from morphid.supervisor import Child, ChildSpec, Supervisor
from tests.faults.ledger import SEED, SUCCEEDED, Ledger
from tests.plain_http import CERTIFICATES
from tests.servers.redis import BrokerServer

OWNER = "local"
LEASE_S, HEARTBEAT_S, REAP_EVERY_S, REPUBLISH_AFTER_S = 2.0, 0.5, 1.0, 2.0
NOTE_EVERY_S = 1.0
OURS = {
    "worker.process": "tests.faults.walk_process",
    "app.main:create_app": "tests.faults.walk_api:create_app",
    "app.http.server": "tests.faults.walk_api",
}


class Rig:
    """One broker, one job store, and the workers and API processes that a test starts.

    Parameters
    ----------
    folder : for all its files.
    root : the repository.
    database_url : an empty database.
    broker : how to run the broker.
    """

    def __init__(self, folder: Path, root: Path, database_url: str, broker: BrokerServer) -> None:
        upgrade(database_url)
        self.database = Database(database_url)
        self.ledger = Ledger()
        self.reports: list[str] = []
        self.supervisor = Supervisor(folder / "logs", report=self.reports.append)
        self.broker = broker
        self.url = ""
        self.worker: Child | None = None
        self._held: set[str] = set()
        self._seen: set[psutil.Process] = set()
        self._noted_at = float("-inf")
        self._environment = {
            "MORPHID_DATABASE_URL": database_url,
            "MORPHID_BROKER_URL": broker.url,
            "MORPHID_LEASE_S": str(LEASE_S),
            "MORPHID_HEARTBEAT_S": str(HEARTBEAT_S),
            "MORPHID_REAP_EVERY_S": str(REAP_EVERY_S),
            "MORPHID_REPUBLISH_AFTER_S": str(REPUBLISH_AFTER_S),
            "PYTHONPATH": str(root),
            "PYTHONUNBUFFERED": "1",
        }
        child = self.supervisor.start(broker.spec)
        assert self.supervisor.wait_until(child, broker.answers, 10.0), child.last_words()

    # processes

    def start_worker(
        self,
        name: str = "worker",
        *,
        slots: int = 1,
        environment: Mapping[str, str] | None = None,
    ) -> Child:
        """Start a worker as `morphid serve` does, its operations walks, and with the first one the beat."""
        reported = {**self._environment, "MORPHID_WORKERS": str(slots), **(environment or {})}
        child = self._start(serve.worker_process(reported, slots), name, "--hostname", f"{name}@%h")
        if self.worker is None:
            self.worker = child
            self.start_beat()
        return child

    def start_beat(self, name: str = "beat") -> Child:
        """Start a beat as `morphid serve` does: it has the reaper come."""
        return self._start(serve.beat_process(self._environment), name)

    def _start(self, spec: ChildSpec, name: str, *more: str) -> Child:
        command = [*(OURS.get(word, word) for word in spec.command), *more]
        return self.supervisor.start(replace(spec, name=name, command=command))

    def start_api(self, environment: Mapping[str, str] | None = None) -> Child:
        """Start the API as `morphid serve` does, and wait until it answers."""
        port = free_port(0)
        reported = {**self._environment, "MORPHID_PORT": str(port), **(environment or {})}
        child = self._start(serve.api_process(reported, LOOPBACK, port), "api")
        self.url = f"http://{LOOPBACK}:{port}"
        assert self.supervisor.wait_until(child, self.api_answers, 30.0), child.last_words(40)
        return child

    def api_answers(self) -> bool:
        """Whether the API takes calls."""
        with contextlib.suppress(httpx.HTTPError):
            return httpx.get(f"{self.url}/livez", timeout=1.0, verify=CERTIFICATES).status_code == 200
        return False

    def take_away(self, name: str) -> None:
        """End a child; it stays away until `bring_back`."""
        self._held.add(name)
        self.supervisor.children[name].stop()

    def leave_orphans(self, name: str) -> None:
        """SIGKILL a child and do not clean up after it, as where no supervisor of ours runs."""
        self._held.add(name)
        self.kill(name)

    def bring_back(self, name: str) -> None:
        """Start a child that was taken away."""
        child = self.supervisor.children[name]
        child.stop()
        child.start()
        if name == "broker":
            assert self.supervisor.wait_until(child, self.broker.answers, 10.0), child.last_words()
        self._held.discard(name)

    def kill(self, name: str) -> None:
        """SIGKILL a child; the supervisor starts it again."""
        pid = self.supervisor.children[name].pid
        if pid is not None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)

    def pool_children(self, name: str = "worker") -> list[int]:
        """Process ids of the children of a worker, which run its jobs."""
        pid = self.supervisor.children[name].pid
        with contextlib.suppress(psutil.NoSuchProcess):
            return [] if pid is None else [child.pid for child in psutil.Process(pid).children()]
        return []

    def runner_of(self, job_id: str) -> int:
        """Process id of the pool child that holds a job."""
        with self.database.read() as session:
            name = session.execute(select(jobs.c.worker).where(jobs.c.id == job_id)).scalar_one()
        assert name is not None, "nobody holds the job"
        return int(name.rpartition(":")[2])

    def kill_runner_of(self, job_id: str) -> None:
        """SIGKILL the process that runs a job."""
        os.kill(self.runner_of(job_id), signal.SIGKILL)

    def tend(self) -> None:
        """Do once what `morphid serve` does all the time: restart what has died."""
        self._note_descendants()
        for name, child in self.supervisor.children.items():
            if name in self._held:
                continue
            event = child.tend()
            if event is not None:
                self.reports.append(event)

    def _note_descendants(self) -> None:
        """Remember every process of the service now and then (a look at all of them is dear)."""
        if time.monotonic() < self._noted_at + NOTE_EVERY_S:
            return
        self._noted_at = time.monotonic()
        for child in self.supervisor.children.values():
            if child.pid is not None:
                with contextlib.suppress(psutil.NoSuchProcess):
                    self._seen.update(psutil.Process(child.pid).children(recursive=True))

    @contextmanager
    def tended(self) -> Iterator[None]:
        """Tend the children in the background of a block that waits in other ways."""
        over = threading.Event()

        def run() -> None:
            while not over.wait(0.1):
                self.tend()

        thread = threading.Thread(target=run, daemon=True)
        thread.start()
        try:
            yield
        finally:
            over.set()
            thread.join()

    def last_words(self) -> str:
        """Give the ends of all logs."""
        return "\n".join(
            f"--- {name}\n{child.last_words(25)}" for name, child in self.supervisor.children.items()
        )

    # jobs

    def add(
        self,
        *,
        published: bool = True,
        max_attempts: int = 3,
        max_seconds: float | None = None,
        deliveries: int = 1,
        ends: frozenset[str] = SUCCEEDED,
        **request: Any,
    ) -> str:
        """Queue a walk; send its wake-up message, or several, or lose it."""
        with self.database.write() as session:
            job = create_job(
                session,
                owner=OWNER,
                operation="walk",
                request={"seed": SEED, **request},
                terms=Terms(max_attempts=max_attempts, max_seconds=max_seconds),
            )
        self.ledger.accept(job.id, request["steps"], ends)
        for _ in range(deliveries if published else 0):
            assert publish(job.id, self.broker.url)
        return job.id

    def job(self, job_id: str) -> Job:
        """Give a job as it is now."""
        with self.database.read() as session:
            return get_job(session, OWNER, job_id)

    def generation(self, job_id: str) -> int:
        """How far a job has come."""
        return int((self.job(job_id).progress or {}).get("generation", 0))

    def result(self, job_id: str) -> dict[str, Any]:
        """Give a job's result."""
        with self.database.read() as session:
            query = select(job_results.c.document).where(job_results.c.job_id == job_id)
            document: dict[str, Any] = unpacked(session.execute(query).scalar_one())
        return document

    def until(self, condition: Callable[[], bool], within_s: float) -> None:
        """Tend the children until the condition holds; a database that is away gives no answer."""
        deadline = time.monotonic() + within_s
        while True:
            with contextlib.suppress(SQLAlchemyError):
                if condition():
                    return
            assert time.monotonic() < deadline, f"not within {within_s} s\n{self.last_words()}"
            self.tend()
            time.sleep(0.05)

    def settle(self, within_s: float = 90.0) -> None:
        """Wait until every accepted job has ended."""
        self.until(lambda: not self.ledger.open(self.database), within_s)

    # the end

    def close(self) -> None:
        """End everything; nothing may be left running."""
        self._noted_at = float("-inf")
        with contextlib.suppress(psutil.Error):
            self.tend()
        self.supervisor.stop()
        self.database.dispose()
        _, left = psutil.wait_procs(self._seen, timeout=5.0)
        for process in left:
            process.kill()
        assert not left, f"processes outlived the service: {left}"
