"""What a second worker brings: the paper's swarm on two one-thread workers against one."""

from __future__ import annotations

import statistics
from pathlib import Path
from typing import Any

import psutil
import pytest
from sqlalchemy import select

from app.database import Database, upgrade
from app.tables import job_events
from tests.identification_request import identification
from tests.worker.spread.processes import Workers, spread

PROMISED = 1.7  # times the flights per second of one worker
GENERATIONS = 2
ROUNDS = 3  # interleaved; a machine shared with others is slow at times
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


def flown(workers: Workers, request: dict[str, Any], *names: str) -> tuple[str, float]:
    """Run a request on workers of these names alone; give its job and its rate."""
    workers.start(*names)
    warm = identification("train_rate_0.8", links=3)
    for _ in names:  # imports, kernels and pages come before the clock starts
        workers.add(warm)
    job_id = workers.add(request)
    workers.wait(job_id, 600.0)
    rate = flights_per_s(workers, job_id)
    for name in names:
        workers.kill(name)
    return job_id, rate


@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.skipif((psutil.cpu_count() or 1) < 2, reason="two workers need two cores")
def test_two_workers_fly_almost_twice_as_fast(tmp_path: Path) -> None:
    """2,500 models of three links through the three flights of constant rate, SQLite, 16 chunks a generation.

    The results of one worker, of two, and of the mode `single` are the same to the bit.
    """
    url = f"sqlite:///{tmp_path / 'jobs.sqlite3'}"
    upgrade(url)
    search = {"preset": "paper", "generations": GENERATIONS, "seed": 1}
    request = identification(*SAMPLES, links=3, search=search)
    rates: dict[str, list[float]] = {"single": [], "one": [], "two": []}
    contents = []
    with Workers(Database(url)) as workers:
        for _ in range(ROUNDS):
            for kind, asked, names in (
                ("single", request, ("a",)),
                ("two", spread(request), ("a", "b")),
                ("one", spread(request), ("a",)),
            ):
                job_id, rate = flown(workers, asked, *names)
                rates[kind].append(rate)
                contents.append(workers.content(job_id))
    assert all(content == contents[0] for content in contents)
    single, one, two = (statistics.median(rates[kind]) for kind in ("single", "one", "two"))
    for kind, values in rates.items():
        print(f"{kind:7s} {' '.join(f'{value:7.1f}' for value in values)} flights/s")
    ratios = [pair[0] / pair[1] for pair in zip(rates["two"], rates["single"], strict=True)]
    print(f"two workers: {two / single:.2f} x mode single, {two / one:.2f} x one worker with chunks")
    print(f"round by round: {' '.join(f'{ratio:.2f}' for ratio in ratios)}")
    assert two / single >= PROMISED
