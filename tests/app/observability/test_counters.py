"""Laws of the counters."""

from __future__ import annotations

import os
import threading

import pytest
from sqlalchemy.exc import SQLAlchemyError

from app.database import Database
from app.observability.counters import SHARDS, count, count_all, read_counters, written
from app.observability.job_counts import BUCKETS_S, _observed


def values(database: Database) -> dict[str, int]:
    """Each counter as it is."""
    with database.read() as session:
        return {written(each.name, each.labels): each.value for each in read_counters(session)}


def test_counters_add_up_over_their_rows(database: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    """The sum is right whichever process counts; labels distinguish counters."""
    for process in range(2 * SHARDS + 1):
        monkeypatch.setattr(os, "getpid", lambda process=process: process)
        with database.write() as session:
            count(session, "jobs_finished", {"status": "failed", "operation": "study"})
            count(session, "jobs_finished", {"operation": "study", "status": "succeeded"}, by=2)
            count(session, "leases_lost")
    reported = 2 * SHARDS + 1
    assert values(database) == {
        "jobs_finished{operation=study,status=failed}": reported,
        "jobs_finished{operation=study,status=succeeded}": 2 * reported,
        "leases_lost": reported,
    }


def test_a_count_is_part_of_its_transaction(database: Database) -> None:
    """What was rolled back was not counted; a count of nothing writes nothing."""
    with database.read() as session:  # rolls back
        count(session, "leases_lost")
    with database.write() as session:
        count_all(session, {"flights": 0})
    assert values(database) == {}


def test_counting_at_once_loses_nothing(database: Database) -> None:
    """Threads that count the same counters in opposite orders neither lose counts nor block one another."""
    names = [f"counter_{number}" for number in range(5)]
    failed: list[SQLAlchemyError] = []

    def work(order: list[str]) -> None:
        try:
            for _ in range(20):
                with database.write() as session:
                    count_all(session, dict.fromkeys(order, 1))
        except SQLAlchemyError as error:
            failed.append(error)

    threads = [
        threading.Thread(target=work, args=(names if even else names[::-1],))
        for even in (True, False, True, False)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60.0)
    assert failed == []
    assert values(database) == dict.fromkeys(names, 80)


@pytest.mark.parametrize(
    ("seconds", "edge"),
    [(-1.0, "0.5"), (0.0, "0.5"), (0.5, "0.5"), (0.51, "1"), (BUCKETS_S[-1], "14400"), (1e9, "+Inf")],
)
def test_every_time_has_its_bucket(seconds: float, edge: str) -> None:
    """A time falls into the first bucket that is not below it; the names fit their column."""
    rises = _observed("job_run", {"operation": "x" * 32}, seconds)
    bucket, total = rises
    assert f"le={edge}" in bucket
    assert len(bucket) < 110
    assert rises[total] >= 0
