"""Whose chunk, or job, a worker takes next."""

from __future__ import annotations

from app.jobs.rows import UnitKind
from app.jobs.store import Terms
from app.jobs.turns import next_unit
from tests.worker.spread.conftest import Spread
from worker.attempt import Ending


def next_work(spread: Spread) -> tuple[UnitKind, str] | None:
    """What a worker would take now."""
    with spread.database.write() as session:
        unit = next_unit(session)
    return None if unit is None else (unit.kind, unit.job_id)


def test_chunks_before_queued_jobs_that_are_not_more_urgent(spread: Spread) -> None:
    """Begun work goes on before an owner's next job begins; an urgent job goes first all the same."""
    begun = spread.add()
    spread.work(spread.runner(), maximum=1)
    spread.add(terms=Terms(priority=0))
    assert next_work(spread) == (UnitKind.CHUNK, begun)
    urgent = spread.add(terms=Terms(priority=1))
    assert next_work(spread) == (UnitKind.JOB, urgent)


def test_chunks_of_the_more_urgent_job_first(spread: Spread) -> None:
    """Of two spread jobs the more urgent one is flown first, then the older one."""
    older, newer, urgent = (spread.add(terms=Terms(priority=priority)) for priority in (0, 0, 5))
    runner = spread.runner()
    spread.work(runner, maximum=1)  # hands the urgent one out
    assert next_work(spread) == (UnitKind.CHUNK, urgent)
    while next_work(spread) != (UnitKind.JOB, older):
        runner.run_next()
    runner.run_next()
    assert next_work(spread) == (UnitKind.CHUNK, older)
    assert newer > older


def test_owners_take_turns_with_chunks(spread: Spread) -> None:
    """Workers of an owner's chunks count as workers of the owner: another's job comes between them."""
    mine = spread.add(chunks=12)
    runner = spread.runner()
    assert spread.work(runner, maximum=1) == [Ending.HANDED_OUT]
    theirs = spread.add(owner="other", mode="single")
    assert next_work(spread) == (UnitKind.JOB, theirs), "never served before"
    runner.run_next()
    assert next_work(spread) == (UnitKind.CHUNK, mine)


def test_workers_at_once_take_different_chunks(spread: Spread) -> None:
    """Workers that choose in the same moment get chunks of their own and wait for nobody (Postgres)."""
    spread.add()
    spread.work(spread.runner(), maximum=1)
    if spread.database.engine.dialect.name == "sqlite":
        return  # one writer at a time
    with spread.database.write() as first, spread.database.write() as second:
        units = [next_unit(first), next_unit(second)]
    numbers = {unit.number for unit in units if unit is not None}
    assert numbers == {0, 1}
