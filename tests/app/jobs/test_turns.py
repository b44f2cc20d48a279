"""Laws of the turns of owners, proved on SQLite and on Postgres."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from threading import Barrier

from sqlalchemy import delete, update

from app.database import Database, database_time
from app.jobs import store
from app.jobs.records import Claim
from app.jobs.rows import Unit, UnitKind
from app.jobs.store import Terms
from app.jobs.turns import next_job_of, next_unit, owners_in_turn
from app.tables import jobs, owners
from tests.app.jobs.test_store import new_job


def served(database: Database) -> Claim | None:
    """Play a worker: take the job whose turn it is, in one transaction."""
    with database.write() as session:
        unit = next_unit(session)
        return None if unit is None else store.claim_job(session, unit.job_id, "w")


def order(database: Database, *, finish: bool) -> list[str]:
    """Take all that is queued, one job after the other, ending each at once or never; give the owners."""
    found = []
    while (claim := served(database)) is not None:
        found.append(claim.owner)
        if finish:
            with database.write() as session:
                assert store.finish_job(session, claim, "succeeded")
    return found


def queue(database: Database, **counts: int) -> None:
    """Queue a number of jobs for each owner, one owner after the other."""
    for owner, count in counts.items():
        for _ in range(count):
            new_job(database, owner=owner)


def test_urgent_first_then_oldest(database: Database) -> None:
    """Inside an owner: higher priority first, then older first; in the end nothing."""
    ids = [new_job(database, terms=Terms(priority=priority)).id for priority in (0, 0, 5, -5, 0)]
    expected = [ids[2], *sorted([ids[0], ids[1], ids[4]]), ids[3]]
    taken = [claim.job_id for claim in iter(lambda: served(database), None)]
    assert taken == expected
    with database.read() as session:
        assert next_unit(session) is None


def test_owners_take_turns(database: Database) -> None:
    """One worker: a short queue is served between the jobs of a long one, not after it."""
    queue(database, many=6, few=2)
    assert order(database, finish=True) == ["few", "many", "few", "many", *["many"] * 4]


def test_fewest_running_first(database: Database) -> None:
    """Many workers: who has less running is next, though it was served last."""
    queue(database, many=4)
    assert [claim.owner for claim in (served(database), served(database)) if claim] == ["many", "many"]
    queue(database, few=3)
    assert order(database, finish=False) == ["few", "few", "many", "few", "many"]


def test_priority_stays_inside_its_owner(database: Database) -> None:
    """Nobody passes another owner by calling all their jobs urgent."""
    for _ in range(3):
        new_job(database, owner="loud", terms=Terms(priority=100))
    new_job(database, owner="quiet", terms=Terms(priority=-100))
    assert "quiet" in order(database, finish=True)[:2]


def test_least_recently_served_first(database: Database) -> None:
    """With nothing running the owner who waited longest since its last turn is next; a new one at once."""
    queue(database, a=1, b=1, c=1)
    with database.write() as session:
        for owner, ago_s in (("a", 10.0), ("b", 30.0), ("c", 20.0)):
            session.execute(
                update(owners).where(owners.c.owner == owner).values(served_at=database_time() - ago_s)
            )
        assert owners_in_turn(session) == ["b", "c", "a"]
        session.execute(delete(owners).where(owners.c.owner == "a"))  # rows are made with the first job
        assert owners_in_turn(session) == ["a", "b", "c"]


def test_workers_at_once_take_different_jobs(database: Database) -> None:
    """Workers that come in the same moment each get a job of their own at the first try."""
    workers = 6
    queue(database, a=workers)
    barrier = Barrier(workers)

    def take(_: int) -> str | None:
        barrier.wait()
        claim = served(database)
        return None if claim is None else claim.job_id

    with ThreadPoolExecutor(workers) as pool:
        taken = list(pool.map(take, range(workers)))
    assert None not in taken
    assert len(set(taken)) == workers


def test_a_job_being_taken_is_passed_over(database: Database) -> None:
    """On Postgres nobody waits for a job that another worker is just taking."""
    queue(database, a=2)
    if database.engine.dialect.name == "sqlite":
        return  # one writer at a time: there is nothing to pass over
    with ExitStack() as stack:
        first, second, third = (stack.enter_context(database.write()) for _ in range(3))
        ids = {next_job_of(first, "a"), next_job_of(second, "a")}
        assert len(ids) == 2
        assert None not in ids
        assert next_unit(third) is None


def test_too_late_to_start(database: Database) -> None:
    """A job whose time is over while it waits is not begun any more: neither chosen nor claimed."""
    late, other = new_job(database), new_job(database)
    with database.write() as session:
        session.execute(update(jobs).where(jobs.c.id == late.id).values(deadline_at=database_time() - 1.0))
        assert next_unit(session) == Unit(UnitKind.JOB, other.id)
        assert store.claim_job(session, late.id, "w") is None
