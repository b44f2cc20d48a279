"""A real Celery worker whose operations are random walks: faults without numerics, and some on request.

Environment: ``MORPHID_TEST_CLOCK_S`` puts this process's clock wrong, ``MORPHID_TEST_DELIVERIES`` sends every
message so often, ``MORPHID_TEST_WARM_UP_S`` lets kernels take time to compile, ``MORPHID_TEST_PAGES`` bounds
an SQLite file as a full disk does.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from sqlalchemy import event
from sqlalchemy.engine import Engine

from morphdata import operations as descriptors
from tests.faults import wrong_clock
from tests.faults.ledger import SEED
from tests.faults.walk_length import flight_steps
from tests.worker.conftest import Walk
from worker import numerics, operations, tasks
from worker.celery_app import app

PAUSE_S = 0.01


class FaultyWalk(Walk):
    """A walk that can swell its checkpoints, end slowly, eat memory and kill its worker."""

    def steps(self, checkpoint: bytes | None, stop: operations.Stop) -> Iterator[operations.Step]:
        """Walk as requested."""
        for step in super().steps(checkpoint, stop):
            number = step.progress["generation"]
            if number == self.request.get("dies_at"):
                die(self.request["death"])
            ballast = b" " * (number * self.request.get("swells_bytes", 0))  # JSON may end in spaces
            yield operations.Step(step.progress, step.checkpoint + ballast)

    def outcome(self, checkpoint: bytes, *, files: bool = True) -> operations.Outcome:
        """Give the place reached, after drawing plots for a while."""
        time.sleep(self.request.get("outcome_s", 0.0))
        return super().outcome(checkpoint, files=files)

    best_so_far = Walk.outcome


def die(death: str) -> None:
    """End this process in one of the ways in which jobs do it."""
    if death == "exit":
        os._exit(3)
    if death == "segfault":
        import ctypes

        ctypes.string_at(0)
    os.kill(os.getpid(), 9)  # as the kernel does when memory is short


def begin(request: operations.Document, _threads: int) -> Walk:
    """Begin a walk."""
    return FaultyWalk(request)


def begin_flight(request: operations.Document, _threads: int) -> Walk:
    """Start a walk in place of the requested flight."""
    return FaultyWalk({"seed": SEED, "steps": flight_steps(request["duration_s"]), "pause_s": PAUSE_S})


def kernels(_threads: int) -> None:
    """Compile nothing: a walk needs no kernels."""
    time.sleep(float(os.environ.get("MORPHID_TEST_WARM_UP_S", "0")))


here = "tests.faults.walk_worker"
flight = descriptors.operation_named("simulate")
descriptors.OPERATIONS = (
    replace(flight, name="walk", begin=f"{here}:begin"),
    replace(flight, begin=f"{here}:begin_flight"),
)
numerics.warm_up_library = kernels

if "MORPHID_TEST_PAGES" in os.environ:

    @event.listens_for(Engine, "connect")
    def _bound(connection: Any, _record: Any) -> None:
        connection.execute(f"PRAGMA max_page_count = {int(os.environ['MORPHID_TEST_PAGES'])}")


if "MORPHID_TEST_DELIVERIES" in os.environ:
    publish_once = tasks.publish

    def publish(job_id: str) -> bool:
        """Send a message several times."""
        return all(publish_once(job_id) for _ in range(int(os.environ["MORPHID_TEST_DELIVERIES"])))

    tasks.publish = publish

wrong_clock.set_from_environment()

__all__ = ["app", "begin"]
