"""What a failed transaction says about the database, and what is reported to the client."""

from __future__ import annotations

import asyncio
import sqlite3
from pathlib import Path

import httpx
import pytest
from fastapi import FastAPI
from sqlalchemy import create_engine, text
from sqlalchemy.exc import DBAPIError, IntegrityError, OperationalError, ProgrammingError
from sqlalchemy.exc import TimeoutError as PoolTimeout

from app.database_errors import DatabaseTrouble, trouble_of
from app.http.problems import install_problem_handlers


class PostgresError(Exception):
    """What the driver raises, as far as anybody looks at it."""

    def __init__(self, sqlstate: str | None) -> None:
        super().__init__(sqlstate)
        self.sqlstate = sqlstate


@pytest.mark.parametrize(
    ("sqlstate", "kind", "expected"),
    [
        (None, OperationalError, DatabaseTrouble.AWAY),  # no connection
        ("57P01", OperationalError, DatabaseTrouble.AWAY),  # shut down by an administrator
        ("57P03", OperationalError, DatabaseTrouble.AWAY),  # starting up
        ("40P01", OperationalError, DatabaseTrouble.AWAY),  # deadlock
        ("40001", OperationalError, DatabaseTrouble.AWAY),  # serialisation
        ("55P03", OperationalError, DatabaseTrouble.AWAY),  # lock_timeout
        ("57014", OperationalError, DatabaseTrouble.AWAY),  # statement_timeout
        ("53300", OperationalError, DatabaseTrouble.AWAY),  # too many connections
        ("25006", DBAPIError, DatabaseTrouble.AWAY),  # a standby
        ("53100", OperationalError, DatabaseTrouble.FULL),
        ("23505", IntegrityError, None),
        ("42P01", ProgrammingError, None),
    ],
)
def test_postgres(sqlstate: str | None, kind: type[DBAPIError], expected: DatabaseTrouble | None) -> None:
    """Restarts, deadlocks, timeouts and standbys pass; a full disk is full; a wrong statement is wrong."""
    assert trouble_of(kind("UPDATE", {}, PostgresError(sqlstate))) is expected


def test_sqlite(tmp_path: Path) -> None:
    """A lock, a full file and a missing table are three different things."""
    path = tmp_path / "a.sqlite3"
    engine = create_engine(f"sqlite:///{path}", connect_args={"timeout": 0.01})
    with engine.begin() as connection:
        connection.execute(text("CREATE TABLE a (b BLOB)"))
    holder = sqlite3.connect(path, isolation_level=None)
    holder.execute("BEGIN EXCLUSIVE")
    found = []
    for statement in ("SELECT * FROM a", "INSERT INTO a VALUES (zeroblob(1000000))", "SELECT * FROM missing"):
        try:
            with engine.begin() as connection:
                connection.execute(text("PRAGMA max_page_count = 3"))
                connection.execute(text(statement))
        except DBAPIError as error:
            found.append(trouble_of(error))
        if holder.in_transaction:
            holder.execute("ROLLBACK")
    holder.close()
    engine.dispose()
    assert found == [DatabaseTrouble.AWAY, DatabaseTrouble.FULL, None]


def test_an_exhausted_pool_passes() -> None:
    """More requests at once than connections: come back later."""
    assert trouble_of(PoolTimeout()) is DatabaseTrouble.AWAY
    assert trouble_of(ValueError()) is None


@pytest.mark.parametrize(
    ("sqlstate", "status", "code", "retry"),
    [
        ("57P01", 503, "database_unavailable", "2"),
        ("53100", 503, "storage_full", "60"),
        ("42P01", 500, "internal_error", None),
    ],
)
def test_what_a_client_is_reported(sqlstate: str, status: int, code: str, retry: str | None) -> None:
    """A database that is away or full is 503 with `Retry-After`; a fault of ours stays a 500."""
    app = FastAPI()
    install_problem_handlers(app)

    @app.get("/")
    def fail() -> None:
        raise OperationalError("UPDATE", {}, PostgresError(sqlstate))

    async def ask() -> httpx.Response:
        transport = httpx.ASGITransport(app, raise_app_exceptions=False)
        async with httpx.AsyncClient(transport=transport, base_url="http://here") as client:
            return await client.get("/")

    answer = asyncio.run(ask())
    assert (answer.status_code, answer.json()["code"]) == (status, code)
    assert answer.headers.get("Retry-After") == retry
