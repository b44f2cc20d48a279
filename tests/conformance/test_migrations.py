"""Migrations up, down and up again with a row in every table, on each database."""

from __future__ import annotations

from typing import Any

from alembic.script import ScriptDirectory
from sqlalchemy import JSON, Column, Engine, LargeBinary, MetaData, Table, insert, select

from app.database import Database, downgrade, migration_config, upgrade
from app.tables import webhooks
from app.webhooks.addresses import destination_of
from app.webhooks.repository import list_webhooks

KEY = "k"  # every row's, so that foreign keys hold
STATUS = {"jobs": "queued", "job_chunks": "open"}  # what check constraints allow


def revisions(url: str) -> list[str]:
    """Every revision, oldest first."""
    script = ScriptDirectory.from_config(migration_config(url))
    return [item.revision for item in script.walk_revisions()][::-1]


def tables_of(engine: Engine) -> list[Table]:
    """The tables that are there, parents first."""
    found = MetaData()
    found.reflect(engine)
    return [table for table in found.sorted_tables if table.name != "alembic_version"]


def value_for(table: Table, column: Column[Any]) -> Any:
    """Something that fits into a column."""
    if column.name == "status":
        return STATUS.get(table.name, KEY)
    if isinstance(column.type, JSON):
        return {"a": [1]}
    if isinstance(column.type, LargeBinary):
        return b"\x00\xff"
    kind = column.type.python_type
    return KEY if kind is str else kind(1)


def fill(engine: Engine) -> dict[str, dict[str, Any]]:
    """Write a row with every column set into every table; give the rows."""
    rows = {}
    with engine.begin() as connection:
        for table in tables_of(engine):
            rows[table.name] = {column.name: value_for(table, column) for column in table.columns}
            connection.execute(insert(table).values(rows[table.name]))
    return rows


def rows_of(engine: Engine) -> dict[str, list[dict[str, Any]]]:
    """Every row of every table."""
    with engine.connect() as connection:
        return {
            table.name: [dict(row) for row in connection.execute(select(table)).mappings()]
            for table in tables_of(engine)
        }


def assert_kept(engine: Engine, rows: dict[str, dict[str, Any]]) -> None:
    """What was written is still there in the tables and columns that are."""
    for name, found in rows_of(engine).items():
        expected = rows.get(name)
        if expected is None:
            continue  # a new table: empty, or filled from what was there
        assert len(found) == 1, name
        for column in expected.keys() & found[0].keys():
            assert found[0][column] == expected[column], f"{name}.{column}"


def test_rows_outlive_every_migration(database_url: str) -> None:
    """From each revision up to the newest and back: the rows of that revision's tables stay as they are."""
    known = revisions(database_url)
    for revision in known:
        upgrade(database_url, revision)
        database = Database(database_url)
        rows = fill(database.engine)
        for target, move in ((known[-1], upgrade), (revision, downgrade), (known[-1], upgrade)):
            database.dispose()
            move(database_url, target)
            assert_kept(database.engine, rows)
        database.dispose()
        downgrade(database_url, "base")
        assert tables_of(database.engine) == [], "the way down leaves nothing"
        database.dispose()


def test_webhooks_of_before_need_no_challenge(database_url: str) -> None:
    """Webhooks that were there before receivers had to answer go on being sent to."""
    upgrade(database_url, "0002")
    database = Database(database_url)
    row = {"id": "hook_1", "owner": "me", "url": "https://example.com:8443/x", "events": ["job.failed"]}
    with database.engine.begin() as connection:
        (table,) = (table for table in tables_of(database.engine) if table.name == "webhooks")
        connection.execute(insert(table).values(**row, secret="whsec_x", failures=0, created_at=7.0))
    upgrade(database_url)
    with database.read() as session:
        (shown,) = list_webhooks(session, "me")
        found = session.execute(select(webhooks)).one()
    database.dispose()
    assert shown.enabled
    assert found.verified_at == found.created_at
    assert found.destination == destination_of(row["url"])
