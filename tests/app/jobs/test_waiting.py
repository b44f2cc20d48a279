"""Laws of the place in the queue, proved on SQLite and on Postgres."""

from __future__ import annotations

import pytest
from sqlalchemy import insert, select, update

from app.database import Database, database_time
from app.jobs import store
from app.jobs.records import Job
from app.jobs.store import Terms
from app.jobs.waiting import FRESH_S, QueueView, count_queue, queue_place
from app.tables import jobs, workers
from tests.app.jobs.test_store import new_job
from tests.app.jobs.test_turns import queue, served


def places(database: Database) -> dict[str, int]:
    """Return the position of every queued job."""
    with database.read() as session:
        rows = session.execute(select(jobs.c.id, jobs.c.owner).where(jobs.c.status == "queued")).all()
        census = count_queue(session)
        return {
            row.id: queue_place(session, store.get_job(session, row.owner, row.id), census).position
            for row in rows
        }


@pytest.mark.parametrize("taken_before", [0, 1, 3])
def test_positions_are_the_order_of_turns(database: Database, taken_before: int) -> None:
    """Jobs start in the order of their positions, for any owners and any number of running jobs."""
    queue(database, many=5, few=2, one=1)
    for owner, priority in (("many", 7), ("few", -3)):
        new_job(database, owner=owner, terms=Terms(priority=priority))
    for _ in range(taken_before):
        served(database)
    reported = places(database)
    began = [claim.job_id for claim in iter(lambda: served(database), None)]
    assert sorted(reported, key=reported.__getitem__) == began
    assert sorted(reported.values()) == list(range(1, len(began) + 1))


def test_the_next_one_has_the_place_that_it_gets(database: Database) -> None:
    """A validation reports the position that the job would have if posted then."""
    queue(database, many=4, few=1)
    served(database)
    with database.read() as session:
        reported = QueueView().place_of_next(session, "few", "identify", 0).position
    job = new_job(database, owner="few")
    assert places(database)[job.id] == reported


def eta_of(database: Database, job: Job) -> float | None:
    """Reported time to the start of the job, s."""
    with database.read() as session:
        return queue_place(session, job, count_queue(session)).eta_s


def test_waiting_time_follows_from_what_jobs_took(database: Database) -> None:
    """Without data there is no estimate; then it is ends needed first, times usual duration, over workers."""
    queue(database, a=2)
    last = new_job(database, owner="a")
    assert eta_of(database, last) is None
    claim = served(database)
    assert claim is not None
    with database.write() as session:
        store.finish_job(session, claim, "succeeded")
        session.execute(
            update(jobs).where(jobs.c.id == claim.job_id).values(started_at=jobs.c.finished_at - 10.0)
        )
    served(database)  # one runs, none before the last
    assert eta_of(database, last) == pytest.approx(10.0, abs=1e-3)
    with database.write() as session:
        for name, age_s in (("live", 1.0), ("gone", 3600.0)):
            seen = database_time() - age_s
            session.execute(
                insert(workers).values(name=name, version="1", slots=4, busy=0, started_at=seen, seen_at=seen)
            )
    assert eta_of(database, last) == 0.0  # three of four slots are free


def test_the_queue_is_counted_once_for_all(database: Database) -> None:
    """Within a second many requests share one count; changes among an owner's own jobs are seen at once."""
    now = [0.0]
    view = QueueView(clock=lambda: now[0])
    queue(database, a=1, b=1)
    job = new_job(database, owner="b")
    with database.read() as session:
        counted = view.census(session)
    urgent = new_job(database, owner="b", terms=Terms(priority=5))
    with database.read() as session:
        assert view.census(session) is counted
        place = view.place(session, job)
        assert place is not None
        assert place.position == 4  # behind the other two of its owner, and behind a's
        now[0] = FRESH_S
        assert view.census(session).lines["b"].queued == 3
    with database.write() as session:
        store.request_cancel(session, "b", urgent.id)
        assert view.place(session, store.get_job(session, "b", urgent.id)) is None
