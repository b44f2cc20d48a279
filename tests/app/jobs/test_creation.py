"""Laws of what a job's row remembers and counts, proved on SQLite and on Postgres."""

from __future__ import annotations

import json

import pytest
from sqlalchemy import func, select

from app.database import Database
from app.documents import packed, sealed
from app.errors import QuotaExceeded
from app.jobs import store
from app.jobs.reaper import reap
from app.jobs.store import Origin, Terms
from app.keys import quota
from app.keys.records import Quota
from app.tables import idempotency_keys, job_events, job_results, jobs, owners
from tests.app.jobs.test_store import OWNER, REQUEST, RESULT, claimed, new_job
from tests.app.key_holders import make_key


def test_a_claim_knows_the_call_that_its_job_came_from(database: Database) -> None:
    """Request id and trace go from the post to the worker."""
    origin = Origin(request_id="req_1", traceparent="00-1-2-01")
    claim = claimed(database, new_job(database, origin=origin).id)
    assert (claim.request_id, claim.traceparent) == ("req_1", "00-1-2-01")


def test_a_sealed_request_is_the_request(database: Database) -> None:
    """Deflated before the transaction or in it: the same rows, and one key for both."""
    plain = new_job(database, idempotency_key="k")
    assert new_job(database, request=sealed(REQUEST), idempotency_key="k").id == plain.id
    with database.read() as session:
        assert store.load_request(session, new_job(database, request=sealed(REQUEST)).id) == REQUEST


def test_owners_are_known_from_their_first_job(database: Database) -> None:
    """One row per owner, served when a worker takes a job."""
    for _ in range(2):
        job = new_job(database)
    with database.read() as session:
        assert session.execute(select(owners)).all() == [(OWNER, 0.0)]
    claimed(database, job.id)
    with database.read() as session:
        assert session.scalar(select(owners.c.served_at)) == pytest.approx(
            session.scalar(select(jobs.c.started_at).where(jobs.c.id == job.id)), abs=5.0
        )


def test_bytes_of_a_job_are_those_of_its_parts(database: Database) -> None:
    """Request, then result and files too, and at the end the history."""
    job = new_job(database)
    claim = claimed(database, job.id)
    with database.write() as session:
        store.finish_job(session, claim, "succeeded", result=RESULT, artifacts={"a.csv": b"12345"})
        stored = session.scalar(select(func.length(job_results.c.document)))
        history = sum(len(json.dumps(payload)) for payload in session.scalars(select(job_events.c.payload)))
        size = session.scalar(select(jobs.c.size_bytes))
    assert size == len(packed(REQUEST)) + stored + 5 + history


def test_every_end_settles_the_quota(database: Database) -> None:
    """However a job ends, its key is charged what was flown and no longer the estimate."""
    key_id = make_key(database, quota=Quota(max_flights_per_day=1000)).key.id

    def flights() -> int:
        with database.read() as session:
            return quota.usage(session, key_id).flights_today

    def post() -> str:
        terms = Terms(max_attempts=1)
        return new_job(database, origin=Origin(key_id), flights_estimated=400, terms=terms).id

    succeeded, lost = post(), post()
    with pytest.raises(QuotaExceeded):
        new_job(database, origin=Origin(key_id), flights_estimated=400, idempotency_key="no job, no key")
    with database.read() as session:
        assert session.scalar(select(func.count()).select_from(idempotency_keys)) == 0
    claim = claimed(database, succeeded)
    with database.write() as session:
        store.save_progress(session, claim, {"flights": 30}, None)
        store.finish_job(session, claim, "succeeded", result=RESULT)
    assert flights() == 30 + 400
    claim = claimed(database, lost, lease_s=-1.0)
    with database.write() as session:
        store.save_progress(session, claim, {"flights": 5}, None)
        assert reap(session).failed == (lost,)
    assert flights() == 30 + 5
    cancelled = post()
    with database.write() as session:
        store.request_cancel(session, OWNER, cancelled)
    assert flights() == 30 + 5


def test_work_that_counts_no_flights_has_flown_once(database: Database) -> None:
    """A simulation is one flight; one that failed before it flew is none."""
    counted = []
    for status in ("succeeded", "failed"):
        claim = claimed(database, new_job(database, operation="simulate").id)
        with database.write() as session:
            store.finish_job(session, claim, status)
            counted.append(session.scalar(select(jobs.c.flights).where(jobs.c.id == claim.job_id)))
    assert counted == [1, 0]
