"""What a second worker brings: the paper's swarm on two one-thread workers against one."""

from __future__ import annotations

import statistics
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psutil
import pytest
from sqlalchemy import select

from app.database import Database, upgrade
from app.tables import job_events
from tests.identification_request import identification
from tests.worker.spread.processes import Workers, spread

MIN_KEPT = (
    0.85  # of a flight's computing time is left when it comes in chunks; 1.7 = 2 x 0.85 on two free cores
)
GENERATIONS = 1  # after the first one
ROUNDS = 2  # interleaved
SAMPLES = ("train_rate_0.2", "train_rate_0.5", "train_rate_0.8")


def flights_per_s(workers: Workers, job_id: str) -> float:
    """Flights per second of a swarm's generations, by the times of their progress events."""
    query = select(job_events.c.payload, job_events.c.at)
    query = query.where(job_events.c.job_id == job_id, job_events.c.type == "progress")
    with workers.database.read() as session:
        rows = session.execute(query.order_by(job_events.c.seq)).all()
    first, last = rows[0], rows[-1]
    assert (first.payload["generation"], last.payload["generation"]) == (0, GENERATIONS)
    return float((last.payload["flights"] - first.payload["flights"]) / (last.at - first.at))


@dataclass(frozen=True)
class Run:
    """One run: its result, flights per second, and flights per second of CPU time (end included)."""

    content: dict[str, Any]
    rate: float
    rate_cpu: float


def start(workers: Workers, *names: str) -> None:
    """Start workers, and have them do something: imports and pages come before any clock starts."""
    workers.start(*names)
    warm = identification("train_rate_0.8", links=3)
    for job_id in [workers.add(warm) for _ in range(2)]:
        workers.wait(job_id, 600.0)


def flown(workers: Workers, request: dict[str, Any]) -> Run:
    """Run a request on all workers that there are."""
    begun_s = workers.cpu_s()
    job_id = workers.add(request)
    job = workers.wait(job_id, 1200.0)
    flights = (job.progress or {})["flights"]
    return Run(
        workers.content(job_id),
        flights_per_s(workers, job_id),
        flights / (workers.cpu_s() - begun_s),
    )


@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.skipif((psutil.cpu_count() or 1) < 2, reason="two workers need two cores")
def test_two_workers_fly_almost_twice_as_fast(tmp_path: Path) -> None:
    """2,500 models of three links through the three flights of constant rate, SQLite, 16 chunks a generation.

    The results of one worker, of two, and of the mode `single` are the same to the bit. Chunks cost little
    computing time; what that makes of the wall time on free cores is printed, and depends on who else is at
    work here.
    """
    url = f"sqlite:///{tmp_path / 'jobs.sqlite3'}"
    upgrade(url)
    search = {"preset": "paper", "generations": GENERATIONS, "seed": 1}
    request = identification(*SAMPLES, links=3, search=search)
    runs: dict[str, list[Run]] = {"single": [], "one": []}
    with Workers(Database(url)) as workers:
        start(workers, "a")
        for _ in range(ROUNDS):
            for kind, requested in (("single", request), ("one", spread(request))):
                runs[kind].append(flown(workers, requested))
                print(f"{kind:7s} {runs[kind][-1].rate:7.1f} flights/s", flush=True)
        start(workers, "b")
        two = flown(workers, spread(request))
    assert all(run.content == two.content for of_kind in runs.values() for run in of_kind)
    single, one = (statistics.median(run.rate for run in runs[kind]) for kind in runs)
    single_cpu, one_cpu = (statistics.median(run.rate_cpu for run in runs[kind]) for kind in runs)
    print(
        f"two workers: {two.rate / single:.2f} x mode single, {two.rate / one:.2f} x one worker with chunks"
    )
    print(
        f"flights per second of CPU time: {two.rate_cpu / single_cpu:.2f} x mode single, "
        f"{one_cpu / single_cpu:.3f} by one worker with chunks"
    )
    assert one_cpu / single_cpu >= MIN_KEPT
