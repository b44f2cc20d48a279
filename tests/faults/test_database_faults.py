"""Postgres crashes in mid-commit; two processes hammer one SQLite file."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
from pathlib import Path

import httpx
import pytest
from sqlalchemy import update

from app.database import upgrade
from app.tables import jobs
from tests.faults.posting import Client, Posting, percentile
from tests.faults.rig import Rig
from tests.servers.postgres import PostgresServer

HAMMER_S = 10.0
LONGEST_WAIT_S = 25.0  # 15 s for SQLite's write lock, 10 s for a row of Postgres, and noise

pytestmark = [pytest.mark.faults, pytest.mark.timeout(300)]


class Stream(threading.Thread):
    """Follows a job on one connection to its end."""

    def __init__(self, rig: Rig, job_id: str) -> None:
        super().__init__(daemon=True)
        self._url = f"{rig.url}/jobs/{job_id}/events"
        self.last = ""

    def run(self) -> None:
        """Keep the type of the newest event."""
        with httpx.stream("GET", self._url, timeout=60.0) as answer:
            for line in answer.iter_lines():
                if line.startswith("event: "):
                    self.last = line.removeprefix("event: ")


@pytest.mark.parametrize("pair", ["postgres-redis"], indirect=True)
def test_postgres_crashes_in_mid_commit(rig: Rig, crashing_postgres: PostgresServer) -> None:
    """Gone at once twice, a backend killed twice, amid commits: 503s, no false 202; jobs wait and go on."""
    rig.start_worker(slots=2)
    rig.start_api()
    long = [rig.add(steps=80, pause_s=0.1) for _ in range(2)]
    rig.until(lambda: all(rig.generation(job_id) >= 2 for job_id in long), 30.0)
    stream = Stream(rig, long[0])
    stream.start()
    postings = [Posting(Client(rig), [2.5] * 60, pause_s=0.1) for _ in range(2)]
    for posting in postings:
        posting.start()
    with rig.tended():
        for crash in ("server", "backend", "server", "backend"):
            time.sleep(2.0)
            if crash == "server":
                crashing_postgres.crash()
                time.sleep(3.0)
                crashing_postgres.start()
            else:
                crashing_postgres.kill_a_backend(rig.database.url.replace("+psycopg", ""))
                crashing_postgres.wait_until_up()
        for posting in postings:
            posting.finish()
    rig.settle()
    stream.join(30.0)
    assert stream.last == "succeeded", "the event stream outlived the crashes on one connection"
    refused_s: list[float] = []
    for posting in postings:
        posting.client.assert_honest(may_break=False)
        refused_s += posting.client.took_s(503)
    refused_s.sort()
    attempts = [rig.job(job_id).attempt for job_id in long]
    print(
        f"Postgres crashed 4 times: {len(rig.ledger.promises)} jobs accepted, {len(refused_s)} times 503 "
        f"(p95 {1e3 * percentile(refused_s, 0.95):.0f} ms); attempts of the running jobs {attempts}"
    )
    assert refused_s, "no request was sent while it was away"


def test_a_sleeper_amid_a_transaction(rig: Rig) -> None:
    """A process that stalls while it holds a lock: others get a retry response; nothing waits for ever."""
    rig.start_api()
    job_id = rig.add(steps=5, published=False, ends=frozenset({"cancelled"}))
    with rig.database.write() as sleeper:
        sleeper.execute(update(jobs).where(jobs.c.id == job_id).values(priority=0))
        began = time.monotonic()
        answer = httpx.post(f"{rig.url}/jobs/{job_id}/cancel", timeout=LONGEST_WAIT_S)
        waited_s = time.monotonic() - began
    assert (answer.status_code, answer.json()["code"]) == (503, "database_unavailable")
    assert answer.headers["Retry-After"]
    print(f"retry response after {waited_s:.1f} s")
    assert httpx.post(f"{rig.url}/jobs/{job_id}/cancel", timeout=LONGEST_WAIT_S).status_code == 200


@pytest.mark.parametrize("pair", ["sqlite-embedded"])
def test_two_processes_hammer_one_file(pair: str, tmp_path: Path, root: Path) -> None:
    """Writers and readers of two processes on one SQLite file never get the error that it is locked."""
    url = f"{pair.partition('-')[0]}:///{tmp_path / 'hammered.sqlite3'}"
    upgrade(url)
    command = [sys.executable, "-m", "tests.faults.hammer", url, str(HAMMER_S)]
    processes = [subprocess.Popen(command, cwd=root, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    reports = []
    for process in processes:
        output, _ = process.communicate(timeout=HAMMER_S + 60.0)
        assert process.returncode == 0
        reports.append(json.loads(output))
    lived, writes = sum(each["jobs"] for each in reports), sum(each["writes"] for each in reports)
    longest_s = max(each["longest_s"] for each in reports)
    print(
        f"SQLite hammered by 2 processes, 6 writers and 4 readers for {HAMMER_S:g} s: {lived} jobs, "
        f"{writes / HAMMER_S:.0f} transactions a second, longest {longest_s:.2f} s, no error"
    )
    assert [each["errors"] for each in reports] == [[], []]
    assert lived > 0
