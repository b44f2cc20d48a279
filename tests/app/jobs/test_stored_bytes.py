"""Nothing that a job leaves is kept uncounted, on SQLite and on Postgres."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest
from sqlalchemy import func, insert, select, update

from app.database import Database, downgrade, upgrade
from app.jobs import store
from app.jobs.chunks import hand_out
from app.jobs.reaper import reap
from app.jobs.records import Claim
from app.jobs.repository import delete_job
from app.jobs.store import Origin
from app.keys import quota
from app.models.repository import delete_model
from app.tables import (
    artifacts,
    job_checkpoints,
    job_chunks,
    job_events,
    job_requests,
    job_results,
    jobs,
    models,
)
from tests.app.jobs.test_retention import count
from tests.app.jobs.test_store import OWNER, RESULT, claimed, new_job
from tests.app.key_holders import make_key

STATE = b"s" * 300_000
TASKS = [b"t" * 10_000, b"u" * 20_000]


def working(database: Database, key_id: str, *, lease_s: float = 60.0, max_attempts: int = 3) -> Claim:
    """A job under way that has saved its state."""
    job = new_job(database, origin=Origin(key_id=key_id))
    with database.write() as session:
        session.execute(update(jobs).where(jobs.c.id == job.id).values(max_attempts=max_attempts))
    claim = claimed(database, job.id, lease_s=lease_s)
    with database.write() as session:
        assert store.save_progress(session, claim, {"fraction": 0.5, "message": "m" * 100}, STATE)
    return claim


def ends(session: Any, claim: Claim, status: str) -> None:
    """The worker itself ends the job."""
    error = {"code": "x", "detail": "y"} if status in ("failed", "expired") else None
    assert store.finish_job(
        session, claim, status, result=RESULT, error=error, artifacts={"a.csv": b"1" * 500}
    )


def released_then_cancelled(session: Any, claim: Claim) -> None:
    """Back in the queue with its state, and cancelled there."""
    assert store.release_job(session, claim)
    assert store.request_cancel(session, OWNER, claim.job_id).finished


def cancelled_then_released(session: Any, claim: Claim) -> None:
    """Cancelled while it ran, by a worker that stops."""
    store.request_cancel(session, OWNER, claim.job_id)
    assert store.release_job(session, claim)


def handed_out_then_cancelled(session: Any, claim: Claim) -> None:
    """Spread over workers of whom none is there."""
    assert hand_out(session, claim, TASKS, STATE)
    session.execute(update(job_chunks).values(at=0.0))
    assert store.request_cancel(session, OWNER, claim.job_id).finished


def lost(session: Any, claim: Claim, **columns: Any) -> None:
    """The reaper ends it."""
    session.execute(update(jobs).where(jobs.c.id == claim.job_id).values(**columns))
    report = reap(session)
    assert claim.job_id in (*report.failed, *report.cancelled, *report.expired)


def cancelled_then_lost(session: Any, claim: Claim) -> None:
    """Its worker dies while it winds down."""
    store.request_cancel(session, OWNER, claim.job_id)
    lost(session, claim, lease_until=0.0)


def chunk_lost(session: Any, claim: Claim) -> None:
    """One of its chunks was lost too often."""
    assert hand_out(session, claim, TASKS, STATE)
    session.execute(update(job_chunks).values(status="running", attempt=99, lease_until=0.0))
    assert claim.job_id in reap(session).failed


ENDS: dict[str, Callable[[Any, Claim], None]] = {
    "succeeded": lambda session, claim: ends(session, claim, "succeeded"),
    "failed": lambda session, claim: ends(session, claim, "failed"),
    "cancelled": lambda session, claim: ends(session, claim, "cancelled"),
    "expired": lambda session, claim: ends(session, claim, "expired"),
    "cancelled while queued": released_then_cancelled,
    "cancelled while stopping": cancelled_then_released,
    "cancelled while handed out": handed_out_then_cancelled,
    "cancelled and lost": cancelled_then_lost,
    "worker lost": lambda session, claim: lost(session, claim, lease_until=0.0, max_attempts=1),
    "deadline passed": lambda session, claim: lost(session, claim, deadline_at=0.0),
    "chunk lost": chunk_lost,
}


def used(database: Database, key_id: str) -> int:
    """Bytes that count in the key's quota."""
    with database.read() as session:
        return quota.usage(session, key_id).stored_bytes


def held(database: Database) -> int:
    """Bytes that really lie in the rows of jobs and models, whatever any column says."""
    columns = (
        job_requests.c.document,
        job_results.c.document,
        artifacts.c.data,
        job_checkpoints.c.data,
        job_chunks.c.task,
        models.c.document,
    )
    with database.read() as session:
        total = sum(int(session.scalar(select(func.sum(func.length(column)))) or 0) for column in columns)
        payloads = session.scalars(select(job_events.c.payload)).all()
    return total + sum(len(json.dumps(payload)) for payload in payloads)


@pytest.mark.parametrize("end", ENDS.values(), ids=ENDS.keys())
def test_every_end_drops_the_state_and_counts_the_rest(
    database: Database, end: Callable[[Any, Claim], None]
) -> None:
    """After whatever end no checkpoint and no chunk is left, and what is left is counted to the byte."""
    key_id = make_key(database).key.id
    claim = working(database, key_id)
    with database.write() as session:
        end(session, claim)
    assert (count(database, job_checkpoints), count(database, job_chunks)) == (0, 0)
    assert used(database, key_id) == held(database)
    with database.write() as session:
        delete_job(session, OWNER, claim.job_id)
    assert used(database, key_id) == held(database), "only a model is left"


def test_the_state_of_a_job_under_way_counts(database: Database) -> None:
    """Checkpoint and chunks fill the quota as long as they are there."""
    key_id = make_key(database).key.id
    claim = working(database, key_id)
    assert used(database, key_id) > len(STATE)
    with database.write() as session:
        assert hand_out(session, claim, TASKS, STATE)
    assert used(database, key_id) > len(STATE) + sum(map(len, TASKS))
    with database.write() as session:
        session.execute(update(job_chunks).values(at=0.0))
        assert store.request_cancel(session, OWNER, claim.job_id).finished
    assert used(database, key_id) < 2000


def test_a_model_counts_until_it_is_deleted(database: Database) -> None:
    """It outlives its job, and so does its share of the quota."""
    key_id = make_key(database).key.id
    claim = working(database, key_id)
    with database.write() as session:
        ends(session, claim, "succeeded")
        model_id = session.scalars(select(models.c.id)).one()
        delete_job(session, OWNER, claim.job_id)
    size = used(database, key_id)
    with database.read() as session:
        assert size == session.scalar(select(func.length(models.c.document))) > 0
    with database.write() as session:
        delete_model(session, OWNER, model_id)
    assert used(database, key_id) == 0


def test_a_job_that_goes_on_keeps_its_state(database: Database) -> None:
    """Neither a release nor the loss of a worker drops a checkpoint that the next worker needs."""
    key_id = make_key(database).key.id
    claim = working(database, key_id)
    with database.write() as session:
        assert store.release_job(session, claim)
    again = claimed(database, claim.job_id, lease_s=-1.0)
    with database.write() as session:
        assert reap(session).requeued == (claim.job_id,)
    with database.read() as session:
        assert store.load_checkpoint(session, again) == STATE


def test_the_migration_does_the_same_for_what_is_there(database_url: str) -> None:
    """Jobs and models of the version before: state dropped where a job has ended, everything counted."""
    upgrade(database_url)
    database = Database(database_url)
    key_id = make_key(database).key.id
    with database.write() as session:
        ends(session, working_in(session, key_id), "succeeded")
        ended = session.scalars(select(jobs.c.id)).one()
        under_way = working_in(session, key_id)
    expected = used(database, key_id)
    database.dispose()
    downgrade(database_url, "0003")
    database = Database(database_url)
    with database.write() as session:
        session.execute(insert(job_checkpoints).values(job_id=ended, data=STATE, fence=1, at=0.0))
        session.execute(update(jobs).where(jobs.c.id == ended).values(size_bytes=1))
    database.dispose()
    upgrade(database_url)
    database = Database(database_url)
    with database.read() as session:
        assert session.scalars(select(job_checkpoints.c.job_id)).all() == [under_way.job_id]
    assert used(database, key_id) == expected
    database.dispose()


def working_in(session: Any, key_id: str) -> Claim:
    """A job under way, inside a transaction."""
    origin = Origin(key_id=key_id)
    job = store.create_job(session, owner=OWNER, operation="identify", request={"a": 1}, origin=origin)
    claim = store.claim_job(session, job.id, "w")
    assert claim is not None
    assert store.save_progress(session, claim, {"fraction": 0.5}, STATE)
    return claim
