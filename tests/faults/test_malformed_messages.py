"""Messages that nobody of ours sends: dropped and counted, and the jobs around them run."""

from __future__ import annotations

import random
from itertools import cycle, islice
from typing import Any

import httpx
import pytest
import redis

from app.observability.counters import read_counters
from app.observability.job_counts import MESSAGES_DROPPED
from tests.faults.malformed import HARMFUL, LIST, MALFORMED
from tests.faults.rig import Rig

START_S = 90.0  # API and worker, on a machine that has other things to do
SEEN_EVERY_S = 0.5
JOBS, MESSAGES = 20, 1000
SEEN = {"MORPHID_WORKER_SEEN_EVERY_S": str(SEEN_EVERY_S)}


def dropped(rig: Rig) -> int:
    """How many messages the workers have dropped, as the rows say."""
    with rig.database.read() as session:
        return sum(each.value for each in read_counters(session) if each.name == MESSAGES_DROPPED)


def readiness(rig: Rig) -> dict[str, Any]:
    """What the API says of the service."""
    reported: dict[str, Any] = httpx.get(f"{rig.url}/readyz", timeout=20.0).json()
    return reported


def feed(rig: Rig, jobs: int, messages: int, *, seed: int = 5) -> list[str]:
    """Put malformed messages into the list at random places between those of some jobs."""
    waiting = list(islice(cycle(MALFORMED.values()), messages))
    places = sorted(random.Random(seed).sample(range(messages), jobs))
    added = []
    with redis.Redis.from_url(rig.broker.url) as link:
        for number, message in enumerate(waiting):
            link.lpush(LIST, message)
            if number in places:
                added.append(rig.add(steps=5, pause_s=0.01))
    return added


@pytest.mark.faults
def test_a_thousand_malformed_messages_amid_jobs(rig: Rig) -> None:
    """Every job succeeds at its first attempt, every malformed message is counted, and no process ends."""
    rig.start_api(SEEN)
    worker = rig.start_worker(environment=SEEN)
    rig.until(lambda: readiness(rig)["status"] == "ready", START_S)
    before = worker.pid, rig.pool_children()
    added = feed(rig, JOBS, MESSAGES)
    rig.settle()
    rig.until(lambda: dropped(rig) == MESSAGES, 20.0)
    assert {rig.job(job_id).attempt for job_id in added} == {1}
    assert (worker.pid, rig.pool_children()) == before
    assert not rig.reports
    assert readiness(rig)["status"] == "ready"
    metrics = httpx.get(f"{rig.url}/metrics", timeout=20.0).text
    assert f"morphid_messages_dropped_total {MESSAGES:.1f}" in metrics


@pytest.mark.faults
def test_messages_that_harm_celery_are_wake_ups(rig: Rig) -> None:
    """Time limits, times of the year 9999 and callbacks in a message have no effect; the next job runs."""
    rig.start_api(SEEN)
    worker = rig.start_worker(environment=SEEN)
    rig.until(lambda: readiness(rig)["status"] == "ready", START_S)
    before = worker.pid, rig.pool_children()
    with redis.Redis.from_url(rig.broker.url) as link:
        for message in HARMFUL.values():
            job_id = rig.add(steps=3, pause_s=0.01, published=False)
            link.lpush(LIST, message)
            rig.until(lambda job_id=job_id: rig.job(job_id).finished, 20.0)
        rig.until(lambda: link.llen(LIST) == 0, 20.0)
    assert (worker.pid, rig.pool_children()) == before
    assert dropped(rig) == 0
