"""Laws of the outbox, on both databases: one delivery per end and webhook, with the end or not at all."""

from __future__ import annotations

import time

import pytest
from sqlalchemy import insert
from sqlalchemy.exc import IntegrityError

from app.database import Database
from app.jobs import store
from app.jobs.reaper import reap
from app.tables import webhook_deliveries, webhooks
from app.webhooks import deliveries as sql
from app.webhooks.outbox import forget_ended, new_delivery
from app.webhooks.schemas import Message
from tests.app.webhooks.hooks import OWNER, deliveries, ended_job, new_hook, new_job
from tests.app.webhooks.receiver import NOBODY


def test_an_end_makes_one_delivery(database: Database) -> None:
    """Each way in which a worker ends a job is reported once, in the documented form."""
    hook_id = new_hook(database, NOBODY)
    error = {"code": "diverged", "detail": "x" * 9000, "hint": "h", "extra": [1]}
    result = {"model": {"links_per_wing": 3}, "fit": []}
    for status, end in (
        ("succeeded", {"result": result}),
        ("failed", {"error": error}),
        ("cancelled", {}),
        ("expired", {}),
    ):
        job_id = ended_job(database, status, **end)
        (row,) = deliveries(database, job_id=job_id)
        assert (row.webhook_id, row.type) == (hook_id, f"job.{status}")
        assert (row.status, row.attempt) == ("waiting", 0)
        message = Message.model_validate(row.payload)
        assert (message.data.id, message.data.status) == (job_id, status)
        assert (message.data.model_id is not None) == (status == "succeeded")
        assert (message.data.error is not None) == (status == "failed")
        assert len(str(row.payload)) < 4000


def test_ends_without_a_worker_are_posted_too(database: Database) -> None:
    """A queued job that is cancelled, a job whose workers all died, one given back while it was cancelled."""
    new_hook(database, NOBODY)
    cancelled, lost, released = (new_job(database) for _ in range(3))
    with database.write() as session:
        store.request_cancel(session, OWNER, cancelled)
        claim = store.claim_job(session, released, "w")
        assert claim is not None
        store.request_cancel(session, OWNER, released)
        store.release_job(session, claim)
    for _ in range(10):
        with database.write() as session:
            store.claim_job(session, lost, "w", lease_s=-100.0)
        with database.write() as session:
            reap(session)
    reported = {row.job_id: row.type for row in deliveries(database)}
    assert reported == {cancelled: "job.cancelled", lost: "job.failed", released: "job.cancelled"}


def test_only_who_asked_is_reported(database: Database) -> None:
    """Other owners, other events and disabled webhooks get nothing; nor does any change but the end."""
    new_hook(database, NOBODY, owner="another")
    new_hook(database, NOBODY, events=["job.failed"])
    disabled = new_hook(database, NOBODY)
    wanted = {new_hook(database, NOBODY, events=["job.succeeded"]), new_hook(database, NOBODY)}
    with database.write() as session:
        sql.disable(session, disabled, "a test")
        claim = store.claim_job(
            session, store.create_job(session, owner=OWNER, operation="study", request={}).id, "w"
        )
        assert claim is not None
        store.save_progress(session, claim, {"fraction": 0.5}, b"state")
        store.release_job(session, claim)
    assert deliveries(database) == []
    ended_job(database, "succeeded")
    assert {row.webhook_id for row in deliveries(database)} == wanted


def test_no_end_no_delivery(database: Database) -> None:
    """A transaction that is rolled back leaves neither; a stale worker's end reports nothing."""
    new_hook(database, NOBODY)
    job_id = new_job(database)
    with database.write() as session:
        claim = store.claim_job(session, job_id, "w")
        assert claim is not None
    with database.write() as session:
        assert store.finish_job(session, claim, "succeeded")
        session.rollback()
    assert deliveries(database) == []
    with database.write() as session:
        assert store.finish_job(session, claim, "succeeded")
    with database.write() as session:
        assert not store.finish_job(session, claim, "failed")
    assert [row.type for row in deliveries(database)] == ["job.succeeded"]


def test_two_deliveries_of_one_end_cannot_be(database: Database) -> None:
    """The table itself refuses a second delivery of a job to a webhook; tests may be many."""
    hook_id = new_hook(database, NOBODY)
    with database.write() as session:
        for _ in range(2):
            session.execute(insert(webhook_deliveries).values(new_delivery(hook_id, "webhook.test", {})))
        session.execute(
            insert(webhook_deliveries).values(new_delivery(hook_id, "job.failed", {}, job_id="job_1"))
        )
    with pytest.raises(IntegrityError), database.write() as session:
        session.execute(
            insert(webhook_deliveries).values(new_delivery(hook_id, "job.failed", {}, job_id="job_1"))
        )


def test_old_deliveries_are_forgotten(database: Database) -> None:
    """Retention takes what ended before its time, and never what still waits."""
    hook_id = new_hook(database, NOBODY)
    old, young, waiting = (ended_job(database) for _ in range(3))
    with database.write() as session:
        for job_id, finished_at in ((old, time.time() - 3000.0), (young, time.time() - 1000.0)):
            session.execute(
                webhook_deliveries.update()
                .where(webhook_deliveries.c.job_id == job_id)
                .values(status="delivered", next_at=None, finished_at=finished_at)
            )
        assert forget_ended(session, 2000.0) == 1
    assert {row.job_id for row in deliveries(database, webhook_id=hook_id)} == {young, waiting}
    with database.write() as session:
        session.execute(webhooks.delete())
    assert deliveries(database) == []
