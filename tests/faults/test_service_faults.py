"""An identification whose worker is killed: it goes on by itself and ends as if nothing had happened."""

from __future__ import annotations

import os
import random
import signal
import time
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

import httpx
import pytest

from morphid.service import Service
from morphid.supervisor import Supervisor
from tests.faults.posting import percentile
from tests.identification_request import identification
from tests.live import LiveService
from tests.servers import redis

SEARCH = {"method": "pso", "particles": 128, "generations": 25, "seed": 2}
SHORT = {"MORPHID_LEASE_S": "4", "MORPHID_HEARTBEAT_S": "1", "MORPHID_REAP_EVERY_S": "1"}
PROMISED_S = 90.0
CANCELS = 10
EFFECTIVE_S = 2.0
NOISE_S = 3.0  # what a busy machine adds

# the first identification on a machine also compiles the kernels
pytestmark = [pytest.mark.faults, pytest.mark.timeout(600)]


@pytest.fixture
def short_leases(pair: str, request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[LiveService]:
    """A service whose reaper comes within seconds, on each pair."""
    if pair == "sqlite-embedded":
        service = LiveService(tmp_path, environment=SHORT).start()
        yield service
        service.stop()
        return
    database_url = request.getfixturevalue("crashing_postgres").new_database()
    broker = redis.plain(tmp_path / "broker")
    supervisor = Supervisor(tmp_path / "logs", report=lambda _sentence: None)
    supervisor.start(broker.spec)
    urls = {"MORPHID_DATABASE_URL": database_url, "MORPHID_BROKER_URL": broker.url}
    service = LiveService(tmp_path / "data", environment={**SHORT, **urls}).start()
    yield service
    service.stop()
    supervisor.stop()


@pytest.fixture
def shipped(tmp_path: Path) -> Iterator[LiveService]:
    """A service as it is shipped."""
    service = LiveService(tmp_path).start()
    yield service
    service.stop()


def runner_of(service: LiveService, job_id: str) -> int:
    """Process id of the worker that runs a job, from the job's own events."""
    answer = httpx.get(f"{service.url}/jobs/{job_id}/events", headers={"Accept": "application/json"})
    started = [event for event in answer.json()["events"] if event["type"] == "started"]
    return int(started[-1]["payload"]["worker"].rpartition(":")[2])


def identify(client: Service, live: LiveService, *, kill_at: int | None) -> tuple[dict[str, Any], float, int]:
    """Identify; kill the worker at a generation. Give result, time without progress (s) and attempts."""
    job = client.submit("identify", identification("train_rate_0.8", links=2, search=SEARCH))
    killed_at: float | None = None
    away_s, reached = 0.0, 0
    for job in client.watch(job["id"], poll_s=0.1):  # noqa: B020 - the newest look is the one that counts
        generation = (job.get("progress") or {}).get("generation") or 0
        if kill_at is not None and killed_at is None and generation >= kill_at:
            os.kill(runner_of(live, job["id"]), signal.SIGKILL)
            killed_at, reached = time.monotonic(), generation
        elif killed_at is not None and away_s == 0.0 and job["attempt"] == 2 and generation > reached:
            away_s = time.monotonic() - killed_at
    assert job["status"] == "succeeded", f"{job['error']}\n{live.logs()}"
    return client.result(job["id"]), away_s, job["attempt"]


def assert_recovery(live: LiveService, within_s: float) -> None:
    """Kill once, run once undisturbed, compare."""
    with Service(live.url) as client:
        killed, away_s, attempts = identify(client, live, kill_at=5)
        undisturbed, _, _ = identify(client, live, kill_at=None)
    print(f"killed worker: progress again after {away_s:.1f} s")
    assert attempts == 2
    assert 0.0 < away_s < within_s
    assert killed["model"] == undisturbed["model"]
    assert killed["fit"] == undisturbed["fit"]
    assert killed["search"]["history"] == undisturbed["search"]["history"]


def test_a_killed_worker_with_short_leases(short_leases: LiveService) -> None:
    """SIGKILL amid an identification: it resumes from its checkpoint, to the bit-identical result."""
    assert_recovery(short_leases, within_s=60.0)


def test_a_killed_worker_as_shipped(shipped: LiveService) -> None:
    """With the leases that are shipped the job goes on within 90 s of the kill."""
    assert_recovery(shipped, within_s=PROMISED_S)


def ended_s(client: httpx.Client, job_id: str) -> float:
    """Time until a job has ended, s; its last change is looked for every 20 ms."""
    began = time.monotonic()
    while client.get(f"/jobs/{job_id}").json()["status"] in ("queued", "running", "cancelling"):
        assert time.monotonic() - began < 60.0
        time.sleep(0.02)
    return time.monotonic() - began


@pytest.mark.timed
def test_cancels_of_identifications(short_leases: LiveService) -> None:
    """A real search, cancelled at any moment of its life, ends soon with the best so far; its end, too."""
    rng = random.Random(5)
    document = identification("train_rate_0.8", links=2, search=SEARCH)
    took_s, partial = [], 0
    with httpx.Client(base_url=short_leases.url, timeout=30.0) as client:
        first = client.post("/identify", json=document).json()["id"]
        client.get(f"/jobs/{first}", headers={"Prefer": "wait=60"}, timeout=90.0)
        ended_s(client, first)  # the kernels are compiled from here on
        events = client.get(f"/jobs/{first}/events", headers={"Accept": "application/json"}).json()["events"]
        moments = [datetime.fromisoformat(event["at"]) for event in events]
        finishing_s = (moments[-1] - moments[-2]).total_seconds()
        for _ in range(CANCELS):
            job_id = client.post("/identify", json=document).json()["id"]
            time.sleep(rng.uniform(0.0, 4.0))
            client.post(f"/jobs/{job_id}/cancel").raise_for_status()
            took_s.append(ended_s(client, job_id))
            partial += client.get(f"/jobs/{job_id}/result").status_code == 200
    took_s.sort()
    print(
        f"{CANCELS} cancels of identifications: p50 {percentile(took_s, 0.5):.2f} s, "
        f"most {took_s[-1]:.2f} s; {partial} left their best so far; "
        f"the undisturbed one drew its plots within {finishing_s:.2f} s"
    )
    assert took_s[-1] < EFFECTIVE_S + NOISE_S
