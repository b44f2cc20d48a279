"""A real swarm over workers: the same model, fit, uncertainty and history as on one, to the bit."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import select

from app.database import Database
from app.jobs.reaper import reap
from app.tables import job_chunks
from morphcore.lanes import TOGETHER
from tests.identification_request import identification
from tests.servers.stores import migrated_sqlite
from tests.worker.spread.processes import Workers, spread
from worker.attempt import Ending
from worker.numerics import Kernels, warm_up_library
from worker.runner import Runner

SMALL = {"method": "pso", "particles": 4 * TOGETHER + 3, "generations": 3, "seed": 4}
EVOLUTION = SMALL | {"method": "cma"}
HYBRID = {"method": "hybrid", "particles": 3 * TOGETHER, "generations": 2, "seed": 4}
LARGER = {"method": "pso", "particles": 40 * TOGETHER, "generations": 4, "seed": 4}
CHUNK_LEASE_S = 2.0


@pytest.mark.parametrize(
    ("search", "links"), [(SMALL, 2), (EVOLUTION, 2), (HYBRID, 1)], ids=["pso", "cma", "hybrid"]
)
def test_a_spread_search_is_the_search(
    tmp_path: Path, search: dict[str, Any], links: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two workers by turns (each with plans of its own) end with the document of the mode `single`.

    One link fits poorly: the hybrid screens candidates, which are spread, between two descents, which are
    not.
    Wall times are left out: no two runs share them. What the kind of database could change is under test with
    flocks.
    """
    # documents are compared; their pictures take seconds each
    monkeypatch.setattr("worker.operations.identification.identification_plots", lambda *_: {})
    database = Database(migrated_sqlite(tmp_path / "jobs.sqlite3"))
    kernels = Kernels(warm_up_library, threads=1)
    kernels.wait(lambda: False, poll_s=0.01)
    runners = [Runner(database, kernels, name, lease_s=60.0, heartbeat_s=10.0) for name in ("w1", "w2")]
    store = Workers(database)
    request = identification("train_rate_0.8", links=links, search=search)
    single = store.add(request)
    assert runners[0].run_next()[0] is Ending.SUCCEEDED
    together = store.add(spread(request, chunks=3))
    while not store.job(together).finished:
        for runner in runners:
            runner.run_next()
    assert store.content(together) == store.content(single)
    progress = [dict(store.job(job_id).progress or {}) for job_id in (together, single)]
    for shown in progress:
        assert shown.pop("flights_per_s") > 0.0
    assert progress[0] == progress[1]
    database.dispose()


@pytest.mark.faults
def test_a_killed_process_costs_its_chunk(database: Database) -> None:
    """SIGKILL of one of two workers in mid-generation: only its chunk is flown twice, to the same result."""
    request = identification("train_rate_0.8", links=2, search=LARGER)
    with Workers(database, chunk_lease_s=CHUNK_LEASE_S) as workers:
        workers.start("w1", "w2")
        undisturbed = workers.add(request)
        workers.wait(undisturbed, 120.0)
        job_id = workers.add(spread(request, chunks=8))
        generation, number = kill_in_mid_generation(workers, job_id, "w1")
        attempts = attempts_until_over(workers, job_id, generation)
        job = workers.wait(job_id, 120.0)
        assert attempts == {**dict.fromkeys(range(8), 1), number: 2}, (
            "only the killed worker's chunk flew twice"
        )
        assert job.attempt == 1
        assert workers.content(job_id) == workers.content(undisturbed)


def kill_in_mid_generation(workers: Workers, job_id: str, name: str) -> tuple[int, int]:
    """Kill a worker while it flies a chunk and others are open; give the chunk's generation and number."""
    mine = select(job_chunks).where(job_chunks.c.job_id == job_id).order_by(job_chunks.c.number)
    while True:
        with workers.database.read() as session:
            rows = session.execute(mine).all()
        flown = [row for row in rows if row.worker == name and row.status == "running"]
        if flown and any(row.status == "open" for row in rows):
            workers.kill(name)
            with workers.database.read() as session:
                rows = session.execute(mine).all()
            held = [row for row in rows if row.worker == name]
            if held:  # it died with a chunk in its hands
                return held[0].generation, held[0].number
            workers.start(name)
        time.sleep(0.01)


def attempts_until_over(workers: Workers, job_id: str, generation: int) -> dict[int, int]:
    """Reap until a generation is over; give how often each of its chunks was claimed."""
    attempts: dict[int, int] = {}
    until = time.monotonic() + 60.0
    query = select(job_chunks.c.number, job_chunks.c.attempt)
    query = query.where(job_chunks.c.job_id == job_id, job_chunks.c.generation == generation)
    while time.monotonic() < until:
        with workers.database.write() as session:
            reap(session)
            rows = session.execute(query).all()
        if not rows:
            break
        attempts.update({row.number: row.attempt for row in rows})
        time.sleep(0.05)
    return attempts
