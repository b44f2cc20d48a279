"""Laws of leased work, on a table of the test's own and both databases."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from sqlalchemy import Column, Double, Integer, MetaData, String, Table, insert, literal, select

from app.database import Database, Session, database_time
from app.leases import LeasedRow, LeasedTable, Note

WAITING, HELD, DONE = "waiting", "held", "done"
work = Table(
    "leased_work_of_a_test",
    MetaData(),
    Column("id", String(16), primary_key=True),
    Column("status", String(16)),
    Column("fence", Integer),
    Column("attempt", Integer),
    Column("lease_until", Double),
)


@dataclass(frozen=True)
class Claim:
    """A claim on the only row."""

    fence: int
    key: tuple[str] = ("row",)


class Undone(Exception):
    """A subscriber failed."""


@pytest.fixture
def table(database: Database) -> Iterator[LeasedTable]:
    """A table with one row that waits."""
    with database.write() as session:
        work.create(session)
        session.execute(insert(work).values(id="row", status=WAITING, fence=0, attempt=0))
    yield LeasedTable(
        work,
        key=(work.c.id,),
        lease=work.c.lease_until,
        waiting=WAITING,
        held=(HELD,),
        ends=(DONE,),
        returning=(work.c.fence, work.c.status, work.c.attempt),
        unheld={"lease_until": None},
    )
    with database.write() as session:
        work.drop(session)


def row(database: Database) -> tuple[str, int, int]:
    """Status, fence and attempt as committed."""
    with database.read() as session:
        found = session.execute(select(work.c.status, work.c.fence, work.c.attempt)).one()
    return found.status, found.fence, found.attempt


def claim(session: Session, table: LeasedTable, lease_s: float = 60.0) -> Claim | None:
    """Claim the row."""
    found = table.claim(session, ("row",), lease_until=database_time() + lease_s)
    return None if found is None else Claim(found.fence)


def test_one_claim_holds_at_a_time(database: Database, table: LeasedTable) -> None:
    """A row that is held is not claimed again; one that is given back is, with a higher fence."""
    with database.write() as session:
        first = claim(session, table)
        assert first == Claim(1)
        assert claim(session, table) is None
    assert row(database) == (HELD, 1, 1)
    with database.write() as session:
        assert table.give_back(session, first) is not None
    assert row(database) == (WAITING, 1, 0), "the attempt is not counted"
    with database.write() as session:
        assert claim(session, table) == Claim(2)


def test_a_stale_claim_changes_nothing(database: Database, table: LeasedTable) -> None:
    """A holder that sleeps past its lease is reaped once, by any reaper; its later writes have no effect."""
    with database.write() as session:
        sleeper = claim(session, table, lease_s=-1.0)
        assert sleeper is not None
        assert session.scalar(select(table.lost(database_time())).select_from(work))
        reaped = [table.reap(session, ("row",), sleeper.fence, status=WAITING) for _ in range(2)]
        assert [found is not None for found in reaped] == [True, False]
        assert table.settle(session, sleeper, status=DONE) is None
        assert table.give_back(session, sleeper) is None
        table.renew(session, sleeper, 60.0)
    assert row(database) == (WAITING, 2, 1)
    with database.read() as session:
        assert session.scalar(select(work.c.lease_until)) is None


def test_renewing_keeps_a_lease(database: Database, table: LeasedTable) -> None:
    """A renewed lease ends later by the database's clock, and the row is not lost."""
    with database.write() as session:
        held = claim(session, table, lease_s=-1.0)
        assert held is not None
        table.renew(session, held, 60.0)
        assert not session.scalar(select(table.lost(database_time())).select_from(work))
        assert session.scalar(select(table.lost(database_time() + literal(61.0))).select_from(work))


def test_subscribers_are_part_of_the_change(database: Database, table: LeasedTable) -> None:
    """Changes with a note are reported in order, ends too; a failing subscriber undoes the change."""
    seen: list[str] = []

    def fails(_session: Session, _row: LeasedRow, _note: Note) -> None:
        raise Undone

    table.on_change = [lambda _session, row, note: seen.append(f"{note.event} {row.status}")]
    table.on_end = (lambda _session, _row, _note: seen.append("end"), fails)
    with database.write() as session:
        held = claim(session, table)
        assert held is not None
        table.settle(session, held, attempt=1)  # without a note it is no news
        table.settle(session, held, note=Note("progress"), attempt=1)
    with pytest.raises(Undone), database.write() as session:
        table.settle(session, held, note=Note("finished"), status=DONE)
    assert seen == ["progress held", "finished done", "end"]
    assert row(database) == (HELD, 1, 1)


def test_no_row_ends_before_its_ends_are_known(database: Database, table: LeasedTable) -> None:
    """A process that forgot to import what subscribes cannot end a row without it."""
    table.on_end = None
    with database.write() as session:
        held = claim(session, table)
    assert held is not None
    with pytest.raises(RuntimeError, match="no subscribers"), database.write() as session:
        table.settle(session, held, note=Note("finished"), status=DONE)
    assert row(database) == (HELD, 1, 1)


@pytest.mark.parametrize("process", ["app.main", "worker.tasks"])
def test_processes_know_what_belongs_to_a_jobs_end(root: Path, process: str) -> None:
    """The API and the workers, who end jobs, have everything subscribed that belongs to it."""
    program = (
        f"import {process}; from app.jobs.rows import JOBS; print([each.__name__ for each in JOBS.on_end])"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=root, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "['settle', 'store_extracted', 'note_end', 'drop_state']"
