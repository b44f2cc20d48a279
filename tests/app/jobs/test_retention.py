"""Laws of forgetting, proved on SQLite and on Postgres."""

from __future__ import annotations

from typing import Any

import pytest
from sqlalchemy import Table, func, insert, select, update

from app.database import Database, database_time
from app.documents import packed
from app.jobs import retention, store
from app.jobs.retention import Keep, forget
from app.jobs.rows import FULL_HISTORY, SPARSE_STEP
from app.tables import (
    artifacts,
    audit_log,
    idempotency_keys,
    job_events,
    job_results,
    jobs,
    models,
    trajectories,
)
from app.trajectories.repository import insert_trajectory
from app.trajectories.schemas import TrajectoryUpload
from tests.app.jobs.test_store import OWNER, RESULT, claimed, new_job

DAY_S = 86_400.0


def count(database: Database, table: Table) -> int:
    """How many rows a table has."""
    with database.read() as session:
        return int(session.scalar(select(func.count()).select_from(table)) or 0)


def ended(database: Database, *, days_ago: float, **options: Any) -> str:
    """Let a job leave all that a job can leave, and end some days ago."""
    job = new_job(database, **options)
    claim = claimed(database, job.id)
    with database.write() as session:
        assert store.finish_job(session, claim, "succeeded", result=RESULT, artifacts={"a.csv": b"1"})
        ago = database_time() - days_ago * DAY_S
        session.execute(update(jobs).where(jobs.c.id == job.id).values(finished_at=ago))
    return job.id


def test_old_jobs_go_and_their_models_stay(database: Database) -> None:
    """What ended longer ago than is kept goes with all its rows; younger, waiting and running jobs stay."""
    ended(database, days_ago=8.0, idempotency_key="old")
    young = ended(database, days_ago=6.0, idempotency_key="young")
    waiting, running = new_job(database).id, new_job(database).id
    claimed(database, running)
    with database.write() as session:
        forgotten = forget(session, Keep(jobs=7.0))
    assert (forgotten.jobs, forgotten.more) == (1, False)
    with database.read() as session:
        assert set(session.scalars(select(jobs.c.id))) == {young, waiting, running}
        assert list(session.scalars(select(idempotency_keys.c.key))) == ["young"]
        assert set(session.scalars(select(models.c.job_id))) == {young, None}
    assert (count(database, artifacts), count(database, job_results)) == (1, 1)


def test_for_ever_is_the_default(database: Database) -> None:
    """Nothing is forgotten unless the operator says so."""
    ended(database, days_ago=10_000.0)
    with database.write() as session:
        assert forget(session, Keep()) == retention.Forgotten()
    assert count(database, jobs) == 1


def test_rounds_are_short(database: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    """A round deletes a few jobs and says that there are more."""
    monkeypatch.setattr(retention, "ROUND_LIMIT", 2)
    for _ in range(3):
        ended(database, days_ago=2.0)
    left = []
    for _ in range(2):
        with database.write() as session:
            left.append((forget(session, Keep(jobs=1.0)).more, count_in(session)))
    assert left == [(True, 1), (False, 0)]


def count_in(session: Any) -> int:
    """How many jobs there are inside a transaction."""
    return int(session.scalar(select(func.count()).select_from(jobs)))


def test_old_flights_and_deeds_go(database: Database) -> None:
    """Uploads and audit entries have ages of their own."""
    column = [0.0, 0.1, 0.2, 0.3]
    names = ("time_s", "sweep_left_rad", "sweep_right_rad", "phi_rad", "theta_rad", "psi_rad")
    columns = dict.fromkeys(names, column)
    upload = TrajectoryUpload(name="flight", **columns)
    with database.write() as session:
        old = insert_trajectory(session, OWNER, None, upload, packed(columns))
        young = insert_trajectory(session, OWNER, None, upload, packed(columns))
        session.execute(
            update(trajectories)
            .where(trajectories.c.id == old.id)
            .values(created_at=database_time() - 2.0 * DAY_S)
        )
        for ago in (1.0, 3.0):
            session.execute(
                insert(audit_log).values(
                    id=f"audit_{ago:g}", at=database_time() - ago * DAY_S, action="x", outcome="done"
                )
            )
        forgotten = forget(session, Keep(trajectories=1.0, audit=2.0))
        assert (forgotten.trajectories, forgotten.audit) == (1, 1)
        assert session.scalars(select(trajectories.c.id)).all() == [young.id]
        assert session.scalars(select(audit_log.c.id)).all() == ["audit_1"]


def test_long_histories_are_thinned(database: Database) -> None:
    """Of progress older than the full history one event in `SPARSE_STEP` stays; all else stays as it was."""
    job = new_job(database)
    claim = claimed(database, job.id)
    begin, end = SPARSE_STEP - 2, SPARSE_STEP + 3
    with database.write() as session:
        for seq in (1, 2):  # queued, started: no progress
            session.execute(update(job_events).where(job_events.c.seq == seq).values(seq=seq + begin - 1))
        for seq in range(begin + 2, end):
            session.execute(
                insert(job_events).values(job_id=job.id, seq=seq, type="progress", payload={}, at=0.0)
            )
        for newest in range(begin + FULL_HISTORY, end + FULL_HISTORY):
            session.execute(update(jobs).values(event_seq=newest - 1))
            assert store.save_progress(session, claim, {"fraction": 0.5}, None)
        kept = session.scalars(select(job_events.c.seq).where(job_events.c.seq < FULL_HISTORY)).all()
    assert sorted(kept) == [begin, begin + 1, SPARSE_STEP]
