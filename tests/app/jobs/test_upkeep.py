"""Laws of the API process's own reaper, and of how many messages reapers send."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from sqlalchemy import insert, select, update

from app.database import Database, database_time
from app.jobs import reaper
from app.jobs.queue import Publisher
from app.jobs.reaper import reap
from app.jobs.upkeep import Upkeep
from app.settings import Settings
from app.tables import jobs, workers
from tests.app.jobs.test_retention import ended
from tests.app.jobs.test_store import claimed, current, new_job
from tests.app.running_service import DEAD_BROKER
from tests.waiting import until

WITHIN_S = 20.0


class Messages(Publisher):
    """Keeps what would be sent."""

    def __init__(self) -> None:
        super().__init__(DEAD_BROKER)
        self.sent: list[str] = []

    def publish(self, job_id: str) -> None:
        """Keep it."""
        self.sent.append(job_id)


@contextmanager
def upkeep(database: Database, messages: Messages, **settings: float) -> Iterator[Upkeep]:
    """The upkeep of a process, twenty rounds a second."""
    chosen = Settings(database_url=database.url, broker_url=DEAD_BROKER, **settings)  # type: ignore[arg-type]
    running = Upkeep(database, messages, chosen, reap_every_s=0.05)
    running.start()
    try:
        yield running
    finally:
        running.stop()


def test_reaps_while_no_worker_is_free(database: Database) -> None:
    """What a dead worker held goes back to the queue with a message, though no worker takes any."""
    job = new_job(database)
    claimed(database, job.id, lease_s=-1.0)
    messages = Messages()
    with upkeep(database, messages):
        until(lambda: job.id in messages.sent, WITHIN_S)
    assert current(database, job.id).status == "queued"


def test_forgets_in_the_background(database: Database) -> None:
    """Data older than the operator's limits is deleted automatically."""
    ended(database, days_ago=2.0)

    def left() -> int:
        with database.read() as session:
            return len(session.execute(select(jobs.c.id)).all())

    with upkeep(database, Messages(), keep_jobs_days=1.0):
        until(lambda: left() == 0, WITHIN_S)


def test_a_database_that_is_away_ends_nothing(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Rounds that fail are followed by others."""
    database = Database(f"sqlite:///{tmp_path_factory.mktemp('away') / 'never migrated'}")
    with upkeep(database, Messages()) as running:
        time.sleep(0.3)
        assert running.alive
    database.dispose()


def test_as_many_messages_as_idle_workers(database: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    """A round repeats messages for the slots that are free, one at least, and never more than its limit."""
    for _ in range(6):
        new_job(database)

    def sent(slots: int) -> int:
        with database.write() as session:
            session.execute(update(jobs).values(published_at=database_time() - 60.0))
            session.execute(workers.delete())
            seen = {"started_at": database_time(), "seen_at": database_time()}
            session.execute(insert(workers).values(name="w", version="1", slots=slots, busy=0, **seen))
            return len(reap(session).publish)

    assert [sent(slots) for slots in (0, 1, 4, 50)] == [1, 1, 4, 6]
    monkeypatch.setattr(reaper, "PUBLISH_LIMIT", 3)
    assert sent(50) == 3
