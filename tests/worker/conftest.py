"""A job store on a fresh SQLite file and an operation that needs no numerics."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from app.database import Database
from app.jobs.records import Job
from app.jobs.store import Terms, create_job, get_job
from morphdata.faults import Interrupted
from tests.servers.stores import migrated_sqlite
from worker.numerics import Kernels
from worker.operations import Begin, Document, Outcome, Step, Stop
from worker.runner import Runner

OWNER = "local"


class Walk:
    """A random walk of ``request["steps"]`` steps with its whole state in the checkpoint.

    A linear congruential generator (Numerical Recipes' constants) stands for the swarm's.
    """

    def __init__(self, request: Document) -> None:
        self.request = request

    def steps(self, checkpoint: bytes | None, stop: Stop) -> Iterator[Step]:
        """Walk on from the checkpoint."""
        state = (
            json.loads(checkpoint) if checkpoint else {"step": 0, "seed": self.request["seed"], "place": 0}
        )
        while state["step"] < self.request["steps"]:
            until = time.monotonic() + self.request.get("pause_s", 0.0)
            while time.monotonic() < until:
                time.sleep(0.01)
                if stop():
                    raise Interrupted
            if stop():
                raise Interrupted
            if state["step"] == self.request.get("fail_at"):
                raise FAILURES[self.request["failure"]]
            seed = (1664525 * state["seed"] + 1013904223) % 2**32
            state = {
                "step": state["step"] + 1,
                "seed": seed,
                "place": state["place"] + (1 if seed > 2**31 else -1),
            }
            progress = {"fraction": state["step"] / self.request["steps"], "generation": state["step"]}
            yield Step(
                progress={**progress, "flights": 10 * state["step"]}, checkpoint=json.dumps(state).encode()
            )

    def outcome(self, checkpoint: bytes, *, files: bool = True) -> Outcome:  # noqa: ARG002
        """Give the place reached."""
        state = json.loads(checkpoint)
        return Outcome(document=state, artifacts={"walk.csv": f"{state['place']}\n".encode()})

    best_so_far = outcome


FAILURES: dict[str, BaseException] = {}


@pytest.fixture
def find_walk() -> Callable[[str], Begin]:
    """A registry with one operation in it, whatever its name."""

    def find(_name: str) -> Begin:
        return lambda request, _threads: Walk(request)

    return find


@pytest.fixture
def database(tmp_path: Path) -> Iterator[Database]:
    """An empty job store."""
    database = Database(migrated_sqlite(tmp_path / "jobs.sqlite3"))
    yield database
    database.dispose()


class Queue:
    """Puts walks into the job store and looks at what becomes of them."""

    def __init__(self, database: Database) -> None:
        self.database = database

    def add(self, *, max_seconds: float | None = None, priority: int = 0, **request: Any) -> str:
        """Queue a walk and give its job's id."""
        with self.database.write() as connection:
            job = create_job(
                connection,
                owner=OWNER,
                operation="walk",
                request={"seed": 7, "steps": 20, **request},
                terms=Terms(max_seconds=max_seconds, priority=priority),
            )
        return job.id

    def job(self, job_id: str) -> Job:
        """Give a job as it is now."""
        with self.database.read() as connection:
            return get_job(connection, OWNER, job_id)


@pytest.fixture
def queue(database: Database) -> Queue:
    """The job store's front."""
    return Queue(database)


@pytest.fixture
def make_runner(database: Database, find_walk: Callable[[str], Begin]) -> Callable[..., Runner]:
    """A worker in this process, its leases as short as the test likes."""

    def make(**changes: Any) -> Runner:
        settings: dict[str, Any] = {
            "database": database,
            "kernels": Kernels(lambda _threads: None, threads=1),
            "worker_name": "test",
            "lease_s": 60.0,
            "heartbeat_s": 10.0,
            "find_operation": find_walk,
        }
        return Runner(**{**settings, **changes})

    return make
