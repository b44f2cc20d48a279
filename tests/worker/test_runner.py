"""Every way a job can end."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

import pytest
from sqlalchemy import select
from sqlalchemy.exc import OperationalError

from app.database import Database
from app.documents import unpacked
from app.jobs.reaper import reap
from app.jobs.records import JobStatus
from app.jobs.store import claim_job, request_cancel
from app.tables import artifacts, job_events, job_results
from morphdata.faults import InvalidInput
from tests.worker.conftest import FAILURES, OWNER, Queue, Walk
from worker.attempt import Ending
from worker.lease import LeaseKeeper
from worker.runner import Runner

MakeRunner = Callable[..., Runner]


def result_of(database: Database, job_id: str) -> dict[str, Any] | None:
    """Read a job's result document."""
    with database.read() as connection:
        data = connection.execute(
            select(job_results.c.document).where(job_results.c.job_id == job_id)
        ).scalar_one_or_none()
    return None if data is None else unpacked(data)


def undisturbed(**request: Any) -> dict[str, Any]:
    """Walk to the end without any service."""
    walk = Walk({"seed": 7, "steps": 20, **request})
    *_, last = walk.steps(None, lambda: False)
    return walk.outcome(last.checkpoint).document


class StopAfter:
    """A stop signal that comes after so many seconds."""

    def __init__(self, seconds: float) -> None:
        self.at = time.monotonic() + seconds

    def __call__(self) -> bool:
        """Tell whether it has come."""
        return time.monotonic() > self.at


def test_a_job_ends_with_result_and_files(queue: Queue, database: Database, make_runner: MakeRunner) -> None:
    """A queued job becomes a succeeded one with the result and the files that its work gave."""
    job_id = queue.add()
    assert make_runner().run_next() == (Ending.SUCCEEDED, job_id)
    job = queue.job(job_id)
    assert job.status is JobStatus.SUCCEEDED
    assert job.progress is not None
    assert job.progress["fraction"] == 1.0
    assert result_of(database, job_id) == undisturbed()
    with database.read() as connection:
        assert connection.scalars(select(artifacts.c.name).where(artifacts.c.job_id == job_id)).all() == [
            "walk.csv"
        ]


def test_a_hint_without_a_job_changes_nothing(make_runner: MakeRunner) -> None:
    """A message that comes twice, or for a cancelled job, finds nothing queued."""
    assert make_runner().run_next() == (Ending.NOTHING_QUEUED, None)


def test_the_most_urgent_job_runs_first(queue: Queue, make_runner: MakeRunner) -> None:
    """Whatever job a message names, the rows decide: highest priority, then oldest."""
    later, first = queue.add(priority=0), queue.add(priority=5)
    runner = make_runner()
    assert [runner.run_next()[1] for _ in range(2)] == [first, later]


def test_stop_and_resume_give_the_undisturbed_result(
    queue: Queue, database: Database, make_runner: MakeRunner
) -> None:
    """A worker that shuts down hands its job back; the next one ends it with the undisturbed result."""
    job_id = queue.add(pause_s=0.05)
    assert make_runner(shutting_down=StopAfter(0.4)).run_next() == (Ending.RELEASED, job_id)
    released = queue.job(job_id)
    assert released.status is JobStatus.QUEUED
    assert released.attempt == 0, "a graceful stop burns no attempt"
    assert released.progress is not None
    assert 0 < released.progress["generation"] < 20
    assert make_runner().run_next() == (Ending.SUCCEEDED, job_id)
    assert result_of(database, job_id) == undisturbed()
    with database.read() as connection:
        payloads = connection.scalars(
            select(job_events.c.payload).where(job_events.c.job_id == job_id, job_events.c.type == "progress")
        ).all()
    seen = [payload["generation"] for payload in payloads if "generation" in payload]
    assert seen == sorted(seen), "no generation is walked twice"


def test_cancel_ends_a_running_job_within_two_seconds(
    queue: Queue, database: Database, make_runner: MakeRunner
) -> None:
    """A cancelled job ends within two seconds and leaves the best so far, marked as partial."""
    job_id = queue.add(steps=2000, pause_s=0.02)
    endings: list[Ending] = []
    thread = threading.Thread(target=lambda: endings.append(make_runner().run_next()[0]))
    thread.start()
    time.sleep(0.5)
    with database.write() as connection:
        request_cancel(connection, OWNER, job_id)
    requested_at = time.monotonic()
    thread.join(10.0)
    assert endings == [Ending.CANCELLED]
    assert time.monotonic() - requested_at < 2.0
    result = result_of(database, job_id)
    assert result is not None
    assert result["partial"] is True
    assert 0 < result["step"] < 2000
    assert queue.job(job_id).partial


def test_a_deadline_ends_a_job_with_its_best(
    queue: Queue, database: Database, make_runner: MakeRunner
) -> None:
    """A job that passes its deadline expires, says so, and leaves the best so far."""
    job_id = queue.add(steps=2000, pause_s=0.02, max_seconds=0.5)
    assert make_runner().run_next() == (Ending.EXPIRED, job_id)
    job = queue.job(job_id)
    assert job.error is not None
    assert job.error["code"] == "deadline_exceeded"
    assert (result_of(database, job_id) or {})["partial"] is True


def test_a_stale_worker_writes_nothing(queue: Queue, database: Database, make_runner: MakeRunner) -> None:
    """A worker whose lease ran out and whose job was claimed again stops and changes nothing."""
    job_id = queue.add(steps=200, pause_s=0.02)
    endings: list[Ending] = []
    thread = threading.Thread(target=lambda: endings.append(make_runner().run_next()[0]))
    thread.start()
    time.sleep(0.4)
    with database.write() as connection:
        # a day later the lease is over, whatever the heartbeat did
        assert reap(connection, now=time.time() + 86400.0).requeued == (job_id,)
        assert claim_job(connection, job_id, "another") is not None
    thread.join(10.0)
    assert endings == [Ending.ABANDONED]
    job = queue.job(job_id)
    assert job.status is JobStatus.RUNNING
    assert result_of(database, job_id) is None


def test_heartbeats_keep_a_long_step_alive(queue: Queue, database: Database, make_runner: MakeRunner) -> None:
    """A lease is renewed while one step takes longer than the lease: no reaper takes the job away."""
    job_id = queue.add(steps=1, pause_s=4.0)
    runner = make_runner(lease_s=2.0, heartbeat_s=0.2)
    endings: list[Ending] = []
    thread = threading.Thread(target=lambda: endings.append(runner.run_next()[0]))
    thread.start()
    while thread.is_alive():
        with database.write() as connection:
            assert reap(connection).requeued == ()
        time.sleep(0.1)
    assert endings == [Ending.SUCCEEDED]
    assert queue.job(job_id).attempt == 1


@pytest.mark.parametrize(
    ("failure", "expected"),
    [
        (
            InvalidInput("the span is negative", pointer="/aircraft/span_m", hint="give a length"),
            {
                "code": "invalid_input",
                "detail": "the span is negative",
                "pointer": "/aircraft/span_m",
                "hint": "give a length",
            },
        ),
        (MemoryError(), {"code": "out_of_memory"}),
        (ZeroDivisionError("x"), {"code": "internal_error"}),
    ],
)
def test_a_failure_says_what_and_why(
    queue: Queue,
    database: Database,
    make_runner: MakeRunner,
    failure: BaseException,
    expected: dict[str, str],
) -> None:
    """A failing job ends as failed with code, field and hint, and keeps the best so far."""
    FAILURES["this"] = failure
    job_id = queue.add(fail_at=5, failure="this")
    assert make_runner().run_next() == (Ending.FAILED, job_id)
    error = queue.job(job_id).error
    assert error is not None
    assert expected.items() <= error.items()
    assert (result_of(database, job_id) or {})["step"] == 5


def test_an_unknown_operation_fails_with_a_sentence(queue: Queue, make_runner: MakeRunner) -> None:
    """A job of a kind that this worker does not know fails and says what to do."""
    from worker.operations import find_operation

    job_id = queue.add()
    assert make_runner(find_operation=find_operation).run_next()[0] is Ending.FAILED
    assert (queue.job(job_id).error or {})["code"] == "unknown_operation"


def test_a_database_that_restarts_is_waited_for(
    queue: Queue, make_runner: MakeRunner, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two refused connections cost a pause each, not the job."""
    job_id = queue.add(steps=3)
    pauses: list[float] = []
    real = LeaseKeeper.write

    def flaky(self: LeaseKeeper, write: Callable[..., bool], **how: bool) -> None:
        def refuse_twice(connection: Any) -> bool:
            if len(pauses) < 2:
                raise OperationalError("UPDATE", {}, Exception("the database is starting up"))
            return write(connection)

        self._sleep = pauses.append
        real(self, refuse_twice, **how)

    monkeypatch.setattr(LeaseKeeper, "write", flaky)
    assert make_runner().run_next() == (Ending.SUCCEEDED, job_id)
    assert pauses == [0.5, 1.0]


def test_kernels_are_ready_before_work_begins(
    queue: Queue, database: Database, make_runner: MakeRunner
) -> None:
    """A job that comes while kernels compile says so in its progress, and can be cancelled."""
    from worker.numerics import Kernels

    release = threading.Event()
    kernels = Kernels(lambda _threads: release.wait(10.0), threads=1)
    job_id = queue.add()
    endings: list[Ending] = []
    thread = threading.Thread(target=lambda: endings.append(make_runner(kernels=kernels).run_next()[0]))
    thread.start()
    time.sleep(0.4)
    assert (queue.job(job_id).progress or {})["phase"] == "preparing"
    with database.write() as connection:
        request_cancel(connection, OWNER, job_id)
    thread.join(3.0)
    assert endings == [Ending.CANCELLED]
    release.set()
