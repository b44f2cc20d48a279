"""A broker that restarts, forgets everything, or is away for a minute."""

from __future__ import annotations

import random
import time

import pytest
import redis

from tests.faults.posting import Client, Posting, percentile
from tests.faults.rig import Rig

AWAY_S = 60.0
SLOWEST_POST_S = 2.0  # nothing in a POST waits for a broker; the rest is the noise of a busy machine

pytestmark = [pytest.mark.faults, pytest.mark.timeout(300)]


def test_a_broker_that_forgets(rig: Rig) -> None:
    """FLUSHALL, a restart, FLUSHALL again amid 30 jobs: every hint may be lost, no job is."""
    rig.start_worker(slots=2)
    rig.start_api()
    rng = random.Random(3)
    posting = Posting(Client(rig), [2.5 + 0.1 * rng.randrange(10) for _ in range(30)], pause_s=0.05)
    posting.start()
    for forget in ("flush", "restart", "flush"):
        pause_until = time.monotonic() + rng.uniform(0.3, 1.5)
        rig.until(lambda until=pause_until: time.monotonic() > until, 10.0)
        if forget == "restart":
            rig.take_away("broker")
            rig.bring_back("broker")
        else:
            with redis.Redis.from_url(rig.broker.url) as link:
                link.flushall()
    with rig.tended():
        posting.finish()
    rig.settle()
    posting.client.assert_honest(may_break=False)
    assert len(posting.client.took_s(202)) == 30


def test_a_minute_without_a_broker(rig: Rig) -> None:
    """For 60 s without a broker every POST is accepted, fast; the running job goes on, and others begin."""
    rig.start_worker(slots=2)
    rig.start_api()
    usual = Client(rig)
    for _ in range(20):
        usual.post()
    rig.settle()
    running = rig.add(steps=100, pause_s=0.1)
    rig.until(lambda: rig.generation(running) >= 2, 30.0)
    rig.take_away("broker")
    gone_at = time.monotonic()
    client = Client(rig)
    while time.monotonic() - gone_at < AWAY_S:
        client.post()
        rig.tend()
        time.sleep(1.0)
    assert rig.job(running).finished, "a job that runs needs no broker"
    rig.settle()
    settled_s = time.monotonic() - gone_at - AWAY_S
    rig.bring_back("broker")
    usual.post()
    rig.settle()
    took_s, usual_s = client.took_s(202), usual.took_s(202)
    print(
        f"broker away {AWAY_S:g} s: {len(took_s)} POSTs, p50 {1e3 * percentile(took_s, 0.5):.0f} ms, "
        f"p95 {1e3 * percentile(took_s, 0.95):.0f} ms, most {1e3 * took_s[-1]:.0f} ms (with it: p50 "
        f"{1e3 * percentile(usual_s, 0.5):.0f} ms, p95 {1e3 * percentile(usual_s, 0.95):.0f} ms); "
        f"all jobs had ended {settled_s:.1f} s after the last POST, without a broker"
    )
    assert len(client.answers) == len(took_s), "every POST was accepted at once"
    assert took_s[-1] < SLOWEST_POST_S
    assert rig.job(running).attempt == 1
