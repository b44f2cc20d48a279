"""Laws of the job store, proved on SQLite and on Postgres."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier
from typing import Any

import pytest
from sqlalchemy import func, select, update

from app.database import Database, database_time
from app.errors import IdempotencyConflict, JobNotFound
from app.jobs import store
from app.jobs.reaper import reap
from app.jobs.records import Claim, Job, JobStatus, StopReason
from app.jobs.store import Terms
from app.tables import artifacts, job_events, job_results, jobs, models

OWNER = "local"
REQUEST = {"aircraft": {"name": "toy"}, "flight": {}, "samples": [{"time_s": [0.0, 0.1]}], "model": {}}
RESULT = {"model": {"links_per_wing": 3}, "fit": []}
HOUR_S = 3600.0


def new_job(database: Database, **options: Any) -> Job:
    """Create a job of the toy request, committed."""
    with database.write() as session:
        return store.create_job(
            session, **{"owner": OWNER, "operation": "identify", "request": REQUEST, **options}
        )


def claimed(database: Database, job_id: str, worker: str = "w1", lease_s: float = 60.0) -> Claim:
    """Claim a job that is there to be claimed; a negative lease is lost at once."""
    with database.write() as session:
        claim = store.claim_job(session, job_id, worker, lease_s)
    assert claim is not None
    return claim


def current(database: Database, job_id: str) -> Job:
    """Read the job as it is now."""
    with database.read() as session:
        return store.get_job(session, OWNER, job_id)


def event_types(database: Database, job_id: str) -> list[str]:
    """List the types of the job's events in order."""
    query = select(job_events.c.type).where(job_events.c.job_id == job_id).order_by(job_events.c.seq)
    with database.read() as session:
        return list(session.scalars(query))


def test_request_comes_back_as_it_went_in(database: Database) -> None:
    """What the worker loads is the request that was stored, to the last digit."""
    request = {**REQUEST, "samples": [{"phi_rad": [0.1 + 0.2, 1e-300, -0.0]}]}
    job = new_job(database, request=request)
    with database.read() as session:
        assert store.load_request(session, job.id) == request


def test_one_claim_wins(database: Database) -> None:
    """Of many workers that claim the same job at the same moment exactly one gets it."""
    job = new_job(database)
    workers = 8
    barrier = Barrier(workers)

    def attempt(number: int) -> Claim | None:
        barrier.wait()
        with database.write() as session:
            return store.claim_job(session, job.id, f"w{number}")

    with ThreadPoolExecutor(workers) as pool:
        claims = [claim for claim in pool.map(attempt, range(workers)) if claim is not None]
    assert len(claims) == 1
    assert claims[0].fence == 1


def test_fence_rises_with_every_claim(database: Database) -> None:
    """A later claim has a higher fence, whatever happened between."""
    job = new_job(database)
    first = claimed(database, job.id)
    with database.write() as session:
        assert store.release_job(session, first)
    assert claimed(database, job.id).fence > first.fence


def test_stale_worker_changes_nothing(database: Database) -> None:
    """After its lease was lost, no write of the former worker has any effect, even before the next claim."""
    job = new_job(database)
    stale = claimed(database, job.id, lease_s=-1.0)
    with database.write() as session:
        assert reap(session).requeued == (job.id,)
    writes: list[Callable[[Any, Claim], Any]] = [
        lambda s, c: store.save_progress(s, c, {"fraction": 0.9}, b"late"),
        lambda s, c: store.finish_job(s, c, "succeeded", result=RESULT),
        store.release_job,
        lambda s, c: store.renew_lease(s, c) is not StopReason.LOST,
    ]
    before = current(database, job.id)
    for write in writes:
        with database.write() as session:
            assert write(session, stale) is False
    assert current(database, job.id) == before
    fresh = claimed(database, job.id, "w2")
    for write in writes:
        with database.write() as session:
            assert write(session, stale) is False
    with database.read() as session:
        assert store.load_checkpoint(session, fresh) is None
        assert session.scalar(select(func.count()).select_from(job_results)) == 0


def test_checkpoint_survives_the_worker(database: Database) -> None:
    """The next claim finds the checkpoint that the lost one wrote last."""
    job = new_job(database)
    first = claimed(database, job.id, lease_s=-1.0)
    for generation in range(3):
        with database.write() as session:
            assert store.save_progress(session, first, {"generation": generation}, bytes([generation]))
    with database.write() as session:
        reap(session)
    second = claimed(database, job.id)
    with database.read() as session:
        assert store.load_checkpoint(session, second) == b"\x02"
    assert second.attempt == 2


def test_progress_and_event_are_one(database: Database) -> None:
    """Events count up by one from 1 without a gap, and the last progress event is the row's progress."""
    job = new_job(database)
    claim = claimed(database, job.id)
    with database.write() as session:
        store.save_progress(session, claim, {"fraction": 0.5, "best_cost": float("inf")}, None)
    query = select(job_events).where(job_events.c.job_id == job.id).order_by(job_events.c.seq)
    with database.read() as session:
        rows = session.execute(query).all()
    assert [row.seq for row in rows] == [1, 2, 3]
    progress = current(database, job.id).progress
    assert progress == {"fraction": 0.5, "best_cost": None}  # JSON has no infinity
    assert rows[-1].payload.items() >= progress.items()


def test_rolled_back_progress_leaves_no_trace(database: Database) -> None:
    """Checkpoint, progress and event are one transaction: when it fails, none of them is there."""
    job = new_job(database)
    claim = claimed(database, job.id)
    before = current(database, job.id)

    def crash_before_commit() -> None:
        with database.write() as session:
            store.save_progress(session, claim, {"fraction": 0.5}, b"half")
            raise InterruptedError

    with pytest.raises(InterruptedError):
        crash_before_commit()
    assert current(database, job.id) == before
    assert event_types(database, job.id) == ["queued", "started"]


def test_success_stores_result_files_and_model(database: Database) -> None:
    """A successful identification leaves its result, its files and a model, and drops its checkpoint."""
    job = new_job(database)
    claim = claimed(database, job.id)
    with database.write() as session:
        store.save_progress(session, claim, {"fraction": 0.5}, b"state")
        assert store.finish_job(session, claim, "succeeded", result=RESULT, artifacts={"a.svg": b"<svg/>"})
    done = current(database, job.id)
    assert (done.status, done.partial) == (JobStatus.SUCCEEDED, False)
    with database.read() as session:
        assert store.load_checkpoint(session, claim) is None
        assert session.execute(select(models.c.id, models.c.links_per_wing)).one() == (done.model_id, 3)
        assert session.execute(select(artifacts.c.name, artifacts.c.media_type)).one() == (
            "a.svg",
            "image/svg+xml",
        )


def test_a_job_ends_once(database: Database) -> None:
    """The second end of a job changes nothing."""
    job = new_job(database)
    claim = claimed(database, job.id)
    with database.write() as session:
        assert store.finish_job(session, claim, "succeeded", result=RESULT)
        assert not store.finish_job(session, claim, "failed", error={"code": "x", "detail": "y"})
    assert current(database, job.id).status is JobStatus.SUCCEEDED


def test_artifact_names_are_plain(database: Database) -> None:
    """A file name that could leave its folder is refused, and the job does not end by it."""
    job = new_job(database)
    claim = claimed(database, job.id)
    for name in ("../x.svg", "a/b.svg", ".hidden", "", "a\x00.svg"):
        with pytest.raises(ValueError, match="plain file name"), database.write() as session:
            store.finish_job(session, claim, "succeeded", artifacts={name: b""})
    assert current(database, job.id).status is JobStatus.RUNNING


def test_cancel_in_every_state(database: Database) -> None:
    """A queued job ends at once, a running one winds down through its worker, an ended one is unchanged."""
    job = new_job(database)
    with database.write() as session:
        assert store.request_cancel(session, OWNER, job.id).status is JobStatus.CANCELLED
        assert store.claim_job(session, job.id, "w") is None
    job = new_job(database)
    claim = claimed(database, job.id)
    with database.write() as session:
        assert store.request_cancel(session, OWNER, job.id).status is JobStatus.CANCELLING
        assert store.request_cancel(session, OWNER, job.id).status is JobStatus.CANCELLING
        assert store.renew_lease(session, claim) is StopReason.CANCEL
        assert store.finish_job(session, claim, "cancelled", result=RESULT)
    after = current(database, job.id)
    assert (after.status, after.partial, after.model_id) == (JobStatus.CANCELLED, True, None)
    assert event_types(database, job.id) == ["queued", "started", "cancelling", "cancelled"]
    with database.write() as session:
        assert store.request_cancel(session, OWNER, job.id).status is JobStatus.CANCELLED


def test_release_keeps_the_attempt(database: Database) -> None:
    """A worker that stops gracefully gives the job back without using up an attempt."""
    job = new_job(database, terms=Terms(max_attempts=1))
    for _ in range(3):
        claim = claimed(database, job.id)
        assert claim.attempt == 1
        with database.write() as session:
            assert store.release_job(session, claim)
    assert current(database, job.id).status is JobStatus.QUEUED


def test_release_of_a_cancelling_job_cancels_it(database: Database) -> None:
    """A job under cancellation does not come back to the queue."""
    job = new_job(database)
    claim = claimed(database, job.id)
    with database.write() as session:
        store.request_cancel(session, OWNER, job.id)
        assert store.release_job(session, claim)
    after = current(database, job.id)
    assert after.status is JobStatus.CANCELLED
    assert after.finished_at is not None


def test_poison_job_fails_after_its_attempts(database: Database) -> None:
    """A job whose worker is lost every time fails as `worker_lost` after exactly max_attempts claims."""
    job = new_job(database, terms=Terms(max_attempts=2))
    claimed(database, job.id, lease_s=-1.0)
    with database.write() as session:
        assert reap(session).requeued == (job.id,)
    claimed(database, job.id, lease_s=-1.0)
    with database.write() as session:
        assert reap(session).failed == (job.id,)
    after = current(database, job.id)
    assert after.error is not None
    assert (after.status, after.error["code"]) == (JobStatus.FAILED, "worker_lost")


def test_reaper_spares_the_living(database: Database) -> None:
    """A job whose lease was renewed is left alone, however long ago it was claimed."""
    job = new_job(database)
    claim = claimed(database, job.id, lease_s=-1.0)
    with database.write() as session:
        store.renew_lease(session, claim)
        report = reap(session)
    assert report.requeued == report.failed == ()


def test_two_reapers_act_once(database: Database) -> None:
    """Two reapers at the same moment requeue a lost job once."""
    ids = {new_job(database).id for _ in range(10)}
    for job_id in ids:
        claimed(database, job_id, lease_s=-1.0)
    barrier = Barrier(2)

    def one_round(_: int) -> tuple[str, ...]:
        barrier.wait()
        with database.write() as session:
            return reap(session).requeued

    with ThreadPoolExecutor(2) as pool:
        requeued = [job_id for found in pool.map(one_round, range(2)) for job_id in found]
    assert sorted(requeued) == sorted(ids)


def test_lost_messages_are_repeated(database: Database) -> None:
    """A queued job gets a new message after the waiting time, then not again at once."""
    job = new_job(database)
    with database.write() as session:
        assert reap(session).publish == ()
        now = session.scalar(select(database_time()))
        assert now is not None
        assert reap(session, now + 16.0).publish == (job.id,)
        assert reap(session, now + 17.0).publish == ()


def test_deadline_counts_from_the_first_claim(database: Database) -> None:
    """A job past its deadline is reported to its worker first, then ended by the reaper as expired."""
    job = new_job(database, terms=Terms(max_seconds=1.0))
    assert current(database, job.id).deadline_at is None
    claim = claimed(database, job.id, lease_s=HOUR_S)
    with database.write() as session:
        assert store.renew_lease(session, claim, HOUR_S) is None
        session.execute(update(jobs).values(deadline_at=database_time() - 1.0))
        assert store.renew_lease(session, claim, HOUR_S) is StopReason.DEADLINE
        assert reap(session).expired == ()
        assert reap(session, deadline_grace_s=0.0).expired == (job.id,)
        assert not store.finish_job(session, claim, "succeeded", result=RESULT)
    assert current(database, job.id).status is JobStatus.EXPIRED


def test_idempotency_key_gives_the_first_answer(database: Database) -> None:
    """Same key and request: the same job; another request: a conflict; another owner: its own job."""
    job = new_job(database, idempotency_key="k")
    again = new_job(database, idempotency_key="k")
    assert (again.id, again.replayed, job.replayed) == (job.id, True, False)
    with pytest.raises(IdempotencyConflict):
        new_job(database, idempotency_key="k", request={"other": 1})
    assert new_job(database, idempotency_key="k", owner="someone else").id != job.id


def test_racing_posts_with_one_key_make_one_job(database: Database) -> None:
    """Concurrent requests with the same key make exactly one job and all get it."""
    callers = 6
    barrier = Barrier(callers)

    def post(_: int) -> str:
        barrier.wait()
        return new_job(database, idempotency_key="k").id

    with ThreadPoolExecutor(callers) as pool:
        ids = set(pool.map(post, range(callers)))
    assert len(ids) == 1
    with database.read() as session:
        assert session.scalar(select(func.count()).select_from(jobs)) == 1


def test_another_owner_sees_nothing(database: Database) -> None:
    """A job is not found by anyone but its owner, for reading and for cancelling."""
    job = new_job(database)
    with database.write() as session, pytest.raises(JobNotFound):
        store.get_job(session, "someone else", job.id)
    with database.write() as session, pytest.raises(JobNotFound):
        store.request_cancel(session, "someone else", job.id)
    assert current(database, job.id).status is JobStatus.QUEUED
