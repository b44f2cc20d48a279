"""Workers look at the rows by themselves: a broker that fails costs seconds."""

from __future__ import annotations

import os
import signal
import time

import pytest
import redis

from tests.faults.malformed import LIST
from tests.faults.rig import Rig

START_S = 90.0  # a worker, on a machine that has other things to do
SOON_S = 20.0  # in truth a second or two; with nobody to repeat messages it would be never
ALONE = {"MORPHID_REAP_EVERY_S": "3600", "MORPHID_REPUBLISH_AFTER_S": "3600"}  # nobody repeats a message


def runs_soon(rig: Rig, *, published: bool = False) -> None:
    """A job that is added now ends within seconds."""
    job_id = rig.add(steps=3, pause_s=0.01, published=published)
    rig.until(lambda: rig.job(job_id).finished, SOON_S)


def start(rig: Rig, *, slots: int = 1) -> None:
    """Start a worker, and wait until it has run a job."""
    rig.start_worker(slots=slots, environment=ALONE)
    job_id = rig.add(steps=3, pause_s=0.01)
    rig.until(lambda: rig.job(job_id).finished, START_S)


def test_a_job_whose_message_is_lost(rig: Rig) -> None:
    """A job that was never announced starts all the same."""
    start(rig)
    for _ in range(3):
        runs_soon(rig)


@pytest.mark.faults
def test_without_a_broker(rig: Rig) -> None:
    """The broker goes while a job runs and others come: all of them run, on a worker that stays itself."""
    start(rig, slots=2)
    worker = rig.supervisor.children["worker"].pid
    long = rig.add(steps=40, pause_s=0.1)
    rig.until(lambda: rig.generation(long) >= 1, START_S)
    rig.take_away("broker")
    for _ in range(3):
        runs_soon(rig)
    assert not rig.job(long).finished
    rig.bring_back("broker")
    runs_soon(rig)
    rig.settle(20.0)
    assert rig.supervisor.children["worker"].pid == worker
    assert rig.job(long).attempt == 1


@pytest.mark.faults
def test_a_worker_that_starts_without_a_broker(rig: Rig) -> None:
    """A worker that has never seen a broker runs jobs, and ends at once on request."""
    rig.take_away("broker")
    worker = rig.start_worker(environment=ALONE)
    job_id = rig.add(steps=3, pause_s=0.01, published=False)
    rig.until(lambda: rig.job(job_id).finished, START_S)
    long = rig.add(steps=60, pause_s=0.1, published=False)
    rig.until(lambda: rig.generation(long) >= 1, START_S)
    began = time.monotonic()
    rig.take_away("worker")
    assert time.monotonic() - began < 10.0
    assert worker.exit_code == 0, worker.last_words(30)
    assert (rig.job(long).status.value, rig.job(long).attempt) == ("queued", 0)
    rig.bring_back("worker")


@pytest.mark.faults
def test_the_free_slot_is_used_after_the_broker_was_away(rig: Rig) -> None:
    """One slot is busy for long while the broker restarts: the next hint goes to the other one."""
    start(rig, slots=2)
    long = rig.add(steps=120, pause_s=0.1)
    rig.until(lambda: rig.generation(long) >= 1, START_S)
    for _ in range(2):
        rig.take_away("broker")
        rig.bring_back("broker")
        for _ in range(3):
            runs_soon(rig, published=True)
    assert not rig.job(long).finished
    rig.until(lambda: rig.job(long).finished, START_S)
    assert rig.job(long).attempt == 1


@pytest.mark.faults
@pytest.mark.parametrize("trouble", ["full", "hung", "wrong type", "forgetful"])
def test_a_broker_out_of_order(rig: Rig, trouble: str) -> None:
    """A broker that is full, answers nothing, holds nonsense under our name or forgets: jobs run."""
    start(rig)
    broker = rig.supervisor.children["broker"].pid
    assert broker is not None
    with redis.Redis.from_url(rig.broker.url) as link:
        if trouble == "full":
            link.config_set("maxmemory", "1")
        elif trouble == "hung":
            os.kill(broker, signal.SIGSTOP)
        elif trouble == "wrong type":
            link.set(LIST, "no list")
        else:
            link.flushall()
        try:
            for _ in range(3):
                runs_soon(rig)
        finally:
            if trouble == "hung":
                os.kill(broker, signal.SIGCONT)
            else:
                link.config_set("maxmemory", "0")
                link.delete(LIST)
    runs_soon(rig)
    assert not rig.reports, "a process ended"
