"""The reported state of a worker is true: it takes jobs or not, whatever its process looks like."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable

import httpx
import pytest

from tests.faults.rig import Rig

SEEN_EVERY_S = 0.5
START_S = 90.0  # a worker, on a machine that has other things to do
WITHIN_S = 20.0  # three signs missed are 1.5 s; the rest is for a busy machine

pytestmark = pytest.mark.faults


def test_a_worker_that_no_longer_consumes_is_not_ready(rig: Rig) -> None:
    """Stopped or without living children: stalled, then ok again; without a broker it still takes jobs."""
    seen = {"MORPHID_WORKER_SEEN_EVERY_S": str(SEEN_EVERY_S)}
    rig.start_api(seen)
    worker = rig.start_worker(environment=seen)

    def reported() -> tuple[str, str]:
        state = httpx.get(f"{rig.url}/readyz", timeout=30.0).json()
        return state["status"], state["workers"]["status"]

    def until(*state: str, within_s: float = WITHIN_S) -> None:
        rig.until(lambda: reported() == state, within_s)

    def strict() -> int:
        return httpx.get(f"{rig.url}/readyz", params={"strict": True}, timeout=30.0).status_code

    until("ready", "ok", within_s=START_S)
    assert strict() == 200
    assert worker.pid is not None
    for pid in (worker.pid, *rig.pool_children()):
        os.kill(pid, signal.SIGSTOP)
        until("degraded", "stalled")
        assert strict() == 503
        assert httpx.get(f"{rig.url}/readyz", timeout=30.0).status_code == 200, (
            "jobs are still taken and kept"
        )
        os.kill(pid, signal.SIGCONT)
        until("ready", "ok")
    rig.take_away("broker")
    until("degraded", "ok")
    assert strict() == 503
    job_id = rig.add(steps=3, pause_s=0.01, published=False)
    rig.until(lambda: rig.job(job_id).finished, WITHIN_S)
    rig.bring_back("broker")
    until("ready", "ok")
    for end in (rig.take_away, rig.leave_orphans):  # as it should, and by SIGKILL
        end("worker")
        until("degraded", "none")
        rig.bring_back("worker")
        until("ready", "ok", within_s=START_S)


def test_a_hung_broker_is_not_ok(rig: Rig) -> None:
    """A broker that is stopped takes connections and answers nothing: not ok, and jobs run all the same."""
    seen = {"MORPHID_WORKER_SEEN_EVERY_S": str(SEEN_EVERY_S)}
    rig.start_api(seen)
    rig.start_worker(environment=seen)

    def reported() -> tuple[str, str]:
        state = httpx.get(f"{rig.url}/readyz", timeout=30.0).json()
        return state["broker"], state["workers"]["status"]

    def until(condition: Callable[[], bool], within_s: float = WITHIN_S) -> None:
        rig.until(condition, within_s)

    until(lambda: reported() == ("ok", "ok"), START_S)
    broker = rig.supervisor.children["broker"].pid
    assert broker is not None
    os.kill(broker, signal.SIGSTOP)
    until(lambda: reported() == ("unreachable", "ok"))
    job_id = rig.add(steps=3, pause_s=0.01, published=False)
    rig.until(lambda: rig.job(job_id).finished, WITHIN_S)
    os.kill(broker, signal.SIGCONT)
    until(lambda: reported() == ("ok", "ok"))
