"""A job store of either kind, spread jobs in it, and workers in threads."""

from __future__ import annotations

import threading
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import pytest
from sqlalchemy import select

from app.database import Database
from app.documents import unpacked
from app.jobs.records import Job
from app.jobs.store import Terms, create_job, get_job
from app.tables import job_chunks, job_events, job_results
from tests.app.conftest import database, migrated_url, postgres_server
from tests.worker.spread.flocks import find_flock
from worker.attempt import Ending
from worker.numerics import Kernels
from worker.runner import Runner

__all__ = ["database", "migrated_url", "postgres_server"]

OWNER = "local"
FLOCK = {"seed": 7, "birds": 12, "generations": 5}


class Killed(BaseException):
    """What a test raises inside a flight to end a worker without a word."""


@dataclass
class Flights:
    """Notes every flight: how often each part of each generation was flown, and by how many birds."""

    parts: Counter[tuple[int, tuple[int, ...]]] = field(default_factory=Counter)
    before: Callable[[int, list[int]], None] = lambda _generation, _places: None

    def __call__(self, generation: int, places: list[int]) -> None:
        """Note a flight that begins."""
        self.parts[generation, tuple(places)] += 1
        self.before(generation, places)

    @property
    def birds(self) -> int:
        """Flights begun, one per bird."""
        return sum(len(places) * count for (_, places), count in self.parts.items())


class Spread:
    """Spread jobs in a job store, and workers for them.

    Parameters
    ----------
    database : the job store.
    """

    def __init__(self, database: Database) -> None:
        self.database = database
        self.flights = Flights()
        self.messages: Counter[str] = Counter()

    def add(
        self,
        *,
        chunks: int = 4,
        mode: str = "distributed",
        owner: str = OWNER,
        terms: Terms | None = None,
        **request: Any,
    ) -> str:
        """Queue a flock and give its job's id."""
        document = {**FLOCK, **request, "execution": {"mode": mode, "chunks": chunks}}
        with self.database.write() as session:
            return create_job(
                session, owner=owner, operation="flock", request=document, terms=terms or Terms()
            ).id

    def runner(self, name: str = "w1", **changes: Any) -> Runner:
        """Make a worker."""
        kernels = Kernels(lambda _threads: None, threads=1)
        kernels.wait(lambda: False, poll_s=0.001)
        settings: dict[str, Any] = {
            "database": self.database,
            "kernels": kernels,
            "worker_name": name,
            "lease_s": 60.0,
            "heartbeat_s": 10.0,
            "find_operation": find_flock(self.flights),
            "publish": lambda job_id, count: self.messages.update({job_id: count}),
        }
        return Runner(**{**settings, **changes})

    def work(self, runner: Runner, *, maximum: int = 10_000) -> list[Ending]:
        """Let a worker do whatever there is to do."""
        endings: list[Ending] = []
        while len(endings) < maximum and (ending := runner.run_next()[0]) is not Ending.NOTHING_QUEUED:
            endings.append(ending)
        return endings

    def work_together(self, runners: list[Runner], job_id: str, within_s: float = 60.0) -> None:
        """Let workers in threads poll for work until a job has ended."""
        until = time.monotonic() + within_s

        def ask(runner: Runner) -> None:
            while not self.job(job_id).finished and time.monotonic() < until:
                if runner.run_next()[0] is Ending.NOTHING_QUEUED:
                    time.sleep(0.005)

        threads = [threading.Thread(target=ask, args=(runner,)) for runner in runners]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert self.job(job_id).finished

    def job(self, job_id: str, owner: str = OWNER) -> Job:
        """Give a job as it is now."""
        with self.database.read() as session:
            return get_job(session, owner, job_id)

    def result(self, job_id: str) -> dict[str, Any] | None:
        """Give a job's result document."""
        query = select(job_results.c.document).where(job_results.c.job_id == job_id)
        with self.database.read() as session:
            data = session.execute(query).scalar_one_or_none()
        return None if data is None else unpacked(data)

    def chunks(self, job_id: str) -> list[Any]:
        """Give a job's chunks as they are now."""
        query = select(job_chunks).where(job_chunks.c.job_id == job_id).order_by(job_chunks.c.number)
        with self.database.read() as session:
            return list(session.execute(query).all())

    def events(self, job_id: str, kind: str) -> list[dict[str, Any]]:
        """Give the payloads of a job's events of a type."""
        query = select(job_events.c.payload).where(job_events.c.job_id == job_id, job_events.c.type == kind)
        with self.database.read() as session:
            return list(session.scalars(query.order_by(job_events.c.seq)))


@pytest.fixture
def spread(database: Database) -> Spread:
    """The job store's front."""
    return Spread(database)
