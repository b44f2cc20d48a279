"""Graceful stop with real numerics: a running search is handed back with its checkpoint within 10 s."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest

from morphid.service import Service
from tests.identification_request import identification
from tests.live import LiveService

WITHIN_S = 10.0
LARGE = {"method": "pso", "particles": 512, "generations": 1000, "seed": 3}

pytestmark = [pytest.mark.faults, pytest.mark.timeout(900)]  # may have to compile the kernels first


@pytest.fixture
def live(tmp_path: Path) -> Iterator[LiveService]:
    """A service as it is shipped."""
    service = LiveService(tmp_path).start()
    yield service
    service.stop()


def running(client: Service, job_id: str, *, generation: int, within_s: float = 400.0) -> int:
    """Wait until the search has come so far; give how far it is."""
    deadline = time.monotonic() + within_s
    while True:
        job = client.job(job_id)
        reached = int((job.get("progress") or {}).get("generation") or 0)
        assert job["status"] in {"queued", "running"}, job
        if job["status"] == "running" and reached >= generation:
            return reached
        assert time.monotonic() < deadline, job
        time.sleep(0.05)


def worker_pid(live: LiveService) -> int:
    """Process id of the worker, whichever the supervisor runs now."""
    deadline = time.monotonic() + 30.0
    while True:
        for child in psutil.Process(live.process.pid).children():
            if child.cmdline()[3:5] == ["worker.process", "worker"]:
                return child.pid
        assert time.monotonic() < deadline
        time.sleep(0.1)


@pytest.mark.parametrize("signals", [1, 2], ids=["one SIGTERM", "an impatient second one"])
def test_a_search_is_handed_back_in_time(live: LiveService, signals: int) -> None:
    """SIGTERM in the midst of a large swarm: queued again within 10 s, no attempt spent, and it goes on."""
    took_s: list[float] = []
    with Service(live.url) as client:
        document = identification("train_rate_0.8", "train_rate_0.5", links=3, search=LARGE)
        job_id = client.submit("identify", document)["id"]
        reached = 0
        for pause_s in (0.0, 0.4, 0.9):  # at different moments of a generation
            reached = running(client, job_id, generation=reached + 2)
            time.sleep(pause_s)
            pid = worker_pid(live)
            began = time.monotonic()
            for number in range(signals):
                time.sleep(0.3 * number)
                os.kill(pid, signal.SIGTERM)
            while client.job(job_id)["status"] == "running":
                assert time.monotonic() - began < 30.0
                time.sleep(0.02)
            handed_s = time.monotonic() - began
            psutil.wait_procs([psutil.Process(pid)] if psutil.pid_exists(pid) else [], timeout=30.0)
            took_s.append(time.monotonic() - began)
            job = client.job(job_id)
            print(
                f"handed back after {handed_s:.2f} s, ended after {took_s[-1]:.2f} s, at generation {reached}"
            )
            assert job["attempt"] <= 1, "a graceful stop costs no attempt"
            assert int(job["progress"]["generation"]) >= reached
        running(client, job_id, generation=reached + 1)
        client.cancel(job_id)
    assert max(took_s) < WITHIN_S


def test_ctrl_c_ends_everything_in_time(live: LiveService) -> None:
    """Ctrl-C amid a large swarm: all processes are gone within 10 s; the job waits with its checkpoint."""
    with Service(live.url) as client:
        document = identification("train_rate_0.8", "train_rate_0.5", links=3, search=LARGE)
        job_id = client.submit("identify", document)["id"]
        running(client, job_id, generation=2)
    began = time.monotonic()
    live.stop()
    took_s = time.monotonic() - began
    print(f"everything ended after {took_s:.2f} s")
    database = live.database()
    with database.read() as session:
        row = session.exec_driver_sql("SELECT status, attempt FROM jobs").one()
        kept = session.exec_driver_sql("SELECT count(*) FROM job_checkpoints").scalar()
    database.dispose()
    assert tuple(row) == ("queued", 0)
    assert kept == 1
    assert took_s < WITHIN_S
