"""The lease keeper of a running job."""

from __future__ import annotations

import threading
import time

from app.database import Database
from app.jobs.records import StopReason
from app.jobs.store import claim_job, request_cancel
from tests.waiting import until
from tests.worker.conftest import OWNER, Queue
from worker.lease import LeaseKeeper
from worker.runner import never


def test_work_that_never_stops_ends_its_process(queue: Queue, database: Database) -> None:
    """A kernel that never returns cannot hold a cancelled job for ever: its process is ended."""
    job_id = queue.add()
    ended = threading.Event()
    with database.write() as connection:
        claim = claim_job(connection, job_id, "test")
    assert claim is not None
    keeper = LeaseKeeper(
        database,
        claim,
        lease_s=60.0,
        heartbeat_s=10.0,
        shutting_down=never,
        look_every_s=0.05,
        on_stuck=ended.set,
        stuck_after_s=0.4,
    )
    with keeper:
        with database.write() as connection:
            request_cancel(connection, OWNER, job_id)
        began = time.monotonic()
        assert ended.wait(5.0)
        assert time.monotonic() - began >= 0.4, "not before its patience is over"
        assert keeper.reason is StopReason.CANCEL


def test_work_that_stops_in_time_is_left_alone(queue: Queue, database: Database) -> None:
    """Work that follows its stop signal ends with its process alive."""
    job_id = queue.add()
    ended = threading.Event()
    with database.write() as connection:
        claim = claim_job(connection, job_id, "test")
    assert claim is not None
    keeper = LeaseKeeper(
        database,
        claim,
        lease_s=60.0,
        heartbeat_s=10.0,
        shutting_down=lambda: True,
        look_every_s=0.05,
        on_stuck=ended.set,
        stuck_after_s=0.4,
    )
    with keeper:
        while not keeper.should_stop():
            time.sleep(0.01)
        assert keeper.reason is StopReason.SHUTDOWN
    assert not ended.wait(0.6)


def test_a_vanished_job_stops_the_work(queue: Queue, database: Database) -> None:
    """When the row is gone (an operator deleted it), the work stops and writes nothing."""
    from app.tables import jobs

    job_id = queue.add()
    with database.write() as connection:
        claim = claim_job(connection, job_id, "test")
    assert claim is not None
    keeper = LeaseKeeper(
        database, claim, lease_s=60.0, heartbeat_s=10.0, shutting_down=never, look_every_s=0.05
    )
    with keeper:
        with database.write() as connection:
            connection.execute(jobs.delete().where(jobs.c.id == job_id))
        until(keeper.should_stop, 5.0)
        assert keeper.reason is StopReason.LOST
