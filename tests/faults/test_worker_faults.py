"""What happens to a job when processes die under it, with short leases."""

from __future__ import annotations

import os
import signal
import time

import pytest

from app.jobs.records import JobStatus
from tests.faults.ledger import undisturbed
from tests.faults.rig import HEARTBEAT_S, LEASE_S, REAP_EVERY_S, Rig

# the fast selection: one pair; the same faults and worse ones are tried on both in the other files
pytestmark = [pytest.mark.faults, pytest.mark.parametrize("pair", ["sqlite-embedded"], indirect=True)]

STEPS = 40
PAUSE_S = 0.1


def succeeded(rig: Rig, job_id: str) -> bool:
    """Whether the job has ended well; any other end fails the test."""
    job = rig.job(job_id)
    assert not job.finished or job.status is JobStatus.SUCCEEDED, job.error
    return job.finished


def test_a_killed_child_loses_no_work(rig: Rig) -> None:
    """SIGKILL of the process that runs a job: another goes on from the checkpoint to the same result."""
    rig.start_worker()
    job_id = rig.add(steps=STEPS, pause_s=PAUSE_S)
    rig.until(lambda: rig.generation(job_id) >= 10, 30.0)
    killed_at, reached = time.monotonic(), rig.generation(job_id)
    rig.kill_runner_of(job_id)
    rig.until(lambda: rig.job(job_id).attempt == 2, 30.0)
    waited_s = time.monotonic() - killed_at
    # the lease may just have been renewed; reaper and broker each add a round
    assert waited_s < LEASE_S + 2 * REAP_EVERY_S + HEARTBEAT_S + 10.0
    rig.until(lambda: succeeded(rig, job_id), 30.0)
    assert reached >= 10
    assert rig.result(job_id) == undisturbed(STEPS)


def test_a_killed_worker_is_restarted_and_goes_on(rig: Rig) -> None:
    """SIGKILL of the whole worker: the supervisor starts it again and the job ends with the same result."""
    worker = rig.start_worker()
    job_id = rig.add(steps=STEPS, pause_s=PAUSE_S)
    rig.until(lambda: rig.generation(job_id) >= 10, 30.0)
    assert worker.pid is not None
    os.kill(worker.pid, signal.SIGKILL)
    rig.until(lambda: succeeded(rig, job_id), 60.0)
    assert worker.restarts == 1
    assert rig.job(job_id).attempt == 2
    assert rig.result(job_id) == undisturbed(STEPS)


def test_a_stopped_worker_hands_its_job_back(rig: Rig) -> None:
    """SIGTERM: within seconds the job is queued again with its checkpoint; the next worker finishes it."""
    worker = rig.start_worker()
    job_id = rig.add(steps=STEPS, pause_s=PAUSE_S)
    rig.until(lambda: rig.generation(job_id) >= 10, 30.0)
    stopped_at = time.monotonic()
    worker.stop()
    assert time.monotonic() - stopped_at < 8.0
    job = rig.job(job_id)
    assert job.status is JobStatus.QUEUED
    assert job.attempt == 0
    worker.start()
    rig.until(lambda: succeeded(rig, job_id), 60.0)
    assert rig.result(job_id) == undisturbed(STEPS)


def test_a_lost_message_delays_a_job_but_loses_none(rig: Rig) -> None:
    """A row whose wake-up message never arrived is found by the reaper."""
    rig.start_worker()
    job_id = rig.add(published=False, steps=3)
    rig.until(lambda: succeeded(rig, job_id), 30.0)


def test_a_killed_broker_is_restarted(rig: Rig) -> None:
    """SIGKILL of the broker: the running job does not notice, and jobs posted afterwards run."""
    rig.start_worker()
    running = rig.add(steps=STEPS, pause_s=PAUSE_S)
    rig.until(lambda: rig.generation(running) >= 5, 30.0)
    broker = rig.supervisor.children["broker"]
    assert broker.pid is not None
    os.kill(broker.pid, signal.SIGKILL)
    waiting = rig.add(published=False, steps=3)
    rig.until(lambda: succeeded(rig, running) and succeeded(rig, waiting), 60.0)
    assert rig.job(running).attempt == 1
    assert broker.restarts == 1


def test_a_job_that_kills_its_worker_gives_up(rig: Rig) -> None:
    """A job whose worker dies in every attempt fails as `worker_lost` and says how often it was tried."""
    rig.start_worker()
    job_id = rig.add(steps=10_000, pause_s=PAUSE_S, max_attempts=2, ends=frozenset({"failed"}))
    for attempt in (1, 2):
        rig.until(lambda attempt=attempt: rig.job(job_id).attempt == attempt, 30.0)
        rig.until(lambda: rig.job(job_id).status is JobStatus.RUNNING, 5.0)
        time.sleep(0.3)
        rig.kill_runner_of(job_id)
    rig.until(lambda: rig.job(job_id).finished, 30.0)
    job = rig.job(job_id)
    assert job.status is JobStatus.FAILED
    assert (job.error or {})["code"] == "worker_lost"
