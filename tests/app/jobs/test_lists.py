"""Lists of jobs read what they show, whatever they are filtered by, on SQLite and on Postgres."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterator
from datetime import UTC, datetime
from functools import cache
from typing import Any

import pytest
from sqlalchemy import event, insert, text

from app.database import Database
from app.identifiers import ALPHABET, base32
from app.jobs.repository import JobFilter, list_jobs
from app.tables import STATUSES, jobs
from tests.app.jobs.test_store import OWNER
from tests.servers.stores import migrated_sqlite

COUNT = 10_000
FIRST_S = 1_800_000_000.0  # when the oldest was made; the next ones a second apart
PAGE = 50
OPERATIONS = ("identify", "study", "simulate")
MAX_READ_ROWS = len(STATUSES) * PAGE  # rows that the database touches for a page, of ten thousand


def moment(number: int) -> datetime:
    """When job `number` was made."""
    return datetime.fromtimestamp(FIRST_S + number, UTC)


def rows() -> list[dict[str, Any]]:
    """Ten thousand jobs of one owner: most succeeded simulations; ids of two hosts, one a minute late."""
    made = []
    for number in range(COUNT):
        late_ms = 60_000 * (number % 2)
        made.append(
            {
                "id": f"job_{base32(int(1e3 * (FIRST_S + number)) + late_ms, 10)}{base32(number, 16)}",
                "owner": OWNER,
                "operation": OPERATIONS[number % 3] if number % 1000 < 3 else "simulate",
                "status": STATUSES[number % len(STATUSES)] if number % 500 < 7 else "succeeded",
                "label": "campaign" if number % 400 == 0 else None,
                "summary": {"aircraft": "a straight wing"},
                "created_at": FIRST_S + number,
                "published_at": FIRST_S,
                "updated_at": FIRST_S,
                "partial": False,
                "max_attempts": 3,
                **dict.fromkeys(("priority", "attempt", "fence", "event_seq"), 0),
            }
        )
    return made


ROWS = rows()
KINDS: list[dict[str, Any]] = [
    {"statuses": statuses, "operation": operation, "label": label}
    for statuses, operation, label in itertools.product(
        ((), ("failed",), ("succeeded",), ("queued", "running", "failed")),
        (None, "study", "simulate"),
        (None, "campaign"),
    )
]
TIMES = [
    {},
    {"created_after": moment(COUNT - 200)},
    {"created_before": moment(200)},
    {"created_after": moment(5000), "created_before": moment(5300)},
]
FILTERS = [JobFilter(**kind, **times) for kind, times in itertools.product(KINDS, TIMES)]


@cache
def matching(number: int) -> list[str]:
    """All jobs that filter `number` lets through, by looking at every row, newest id first."""
    wanted = FILTERS[number]
    after_s = wanted.created_after.timestamp() if wanted.created_after else 0.0
    before_s = wanted.created_before.timestamp() if wanted.created_before else float("inf")
    found = [
        row["id"]
        for row in ROWS
        if (not wanted.statuses or row["status"] in wanted.statuses)
        and wanted.operation in (None, row["operation"])
        and wanted.label in (None, row["label"])
        and after_s <= row["created_at"] < before_s
    ]
    return sorted(found, reverse=True)


def expected(number: int, before: str | None) -> list[str]:
    """The page of filter `number` that begins below an id."""
    found = matching(number)
    return [identifier for identifier in found if before is None or identifier < before][:PAGE]


@pytest.fixture(scope="module", params=["sqlite", "postgres"])
def full(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Database]:
    """A database with all these jobs, its statistics made as the server makes them by itself."""
    if request.param == "sqlite":
        database = Database(migrated_sqlite(tmp_path_factory.mktemp("lists") / "jobs.sqlite3"))
    else:
        database = Database(request.getfixturevalue("postgres_server").migrated_database())
    with database.write() as session:
        session.execute(insert(jobs), ROWS)
    if database.engine.dialect.name == "postgresql":
        with database.write() as session:
            session.execute(text("ANALYZE jobs"))
    yield database
    database.dispose()


def test_every_filter_finds_its_jobs(full: Database) -> None:
    """Whatever the combination, a page is what a look at every row gives, newest id first."""
    middle = f"job_{base32(int(1e3 * (FIRST_S + COUNT // 2)), 10)}{ALPHABET[0] * 16}"
    with full.read() as session:
        for (number, wanted), before in itertools.product(enumerate(FILTERS), (None, middle)):
            found, following = list_jobs(session, OWNER, wanted, cursor=before, limit=PAGE)
            ids = [job.id for job in found]
            assert ids == expected(number, before), (wanted, before)
            rest = [] if following is None else expected(number, following)
            assert bool(rest) == bool(ids and expected(number, ids[-1])), "a cursor leads on"


def statements(database: Database, wanted: JobFilter) -> list[tuple[str, Any]]:
    """What a list sends to the database."""
    sent: list[tuple[str, Any]] = []

    def note(_c: Any, _cursor: Any, statement: str, parameters: Any, _context: Any, _many: Any) -> None:
        if "jobs" in statement:
            sent.append((statement, parameters))

    event.listen(database.engine, "before_cursor_execute", note)
    with database.read() as session:
        list_jobs(session, OWNER, wanted, cursor=None, limit=PAGE)
    event.remove(database.engine, "before_cursor_execute", note)
    return sent


@pytest.mark.parametrize("full", ["sqlite"], indirect=True)
def test_sqlite_reads_ranges_in_order(full: Database) -> None:
    """Jobs are found by an index that begins with the owner, in order: nothing is scanned or sorted."""
    for wanted in FILTERS:
        for statement, parameters in statements(full, wanted):
            with full.read() as session:
                explained = session.exec_driver_sql(f"EXPLAIN QUERY PLAN {statement}", parameters)
                plan = [row.detail for row in explained]
            steps = [step for step in plan if step.startswith(("SEARCH jobs", "SCAN jobs"))]
            assert steps, plan
            assert all(
                step.startswith("SEARCH jobs USING") and ("(owner=?" in step or "(id=?)" in step)
                for step in steps
            ), plan
            assert not [step for step in plan if "TEMP B-TREE" in step], plan


def visited(plan: dict[str, Any]) -> float:
    """Rows that the scans of a Postgres plan touched, those that a filter threw away included."""
    inner = sum(visited(part) for part in plan.get("Plans", ()))
    if "Scan" not in plan["Node Type"]:
        return inner
    return inner + plan["Actual Loops"] * (plan["Actual Rows"] + plan.get("Rows Removed by Filter", 0))


@pytest.mark.parametrize("full", ["postgres"], indirect=True)
def test_postgres_touches_few_rows(full: Database) -> None:
    """A page of any list by kind touches a small part of the owner's jobs."""
    for kind in KINDS:
        for statement, parameters in statements(full, JobFilter(**kind)):
            with full.read() as session:
                reported = session.exec_driver_sql(
                    f"EXPLAIN (ANALYZE, FORMAT JSON) {statement}", parameters
                ).scalar()
            plan = json.loads(reported) if isinstance(reported, str) else reported
            assert visited(plan[0]["Plan"]) <= MAX_READ_ROWS, (kind, plan)
