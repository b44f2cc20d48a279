"""``morphid db``."""

from __future__ import annotations

from pathlib import Path

import pytest
from sqlalchemy import create_engine, inspect, text
from typer.testing import CliRunner

from morphid.exits import Exit
from morphid.main import app

RUNNER = CliRunner()


def tables(url: str) -> set[str]:
    """Give the names of a database's tables."""
    engine = create_engine(url)
    try:
        return set(inspect(engine).get_table_names())
    finally:
        engine.dispose()


def test_up_and_down(tmp_path: Path) -> None:
    """Up makes the tables, down to base takes every one of them away."""
    url = f"sqlite:///{tmp_path / 'a.sqlite3'}"
    environment = {"MORPHID_DATABASE_URL": url}
    assert RUNNER.invoke(app, ["db", "upgrade"], env=environment).exit_code == Exit.OK
    assert "jobs" in tables(url)
    assert RUNNER.invoke(app, ["db", "downgrade", "base"], env=environment).exit_code == Exit.OK
    assert tables(url) <= {"alembic_version"}


def test_an_absent_database_is_a_sentence() -> None:
    """When no Postgres answers, the error names the variable to correct."""
    url = "postgresql://nobody@127.0.0.1:1/morphid"
    ended = RUNNER.invoke(app, ["db", "upgrade"], env={"MORPHID_DATABASE_URL": url})
    assert ended.exit_code == Exit.ENVIRONMENT
    assert "MORPHID_DATABASE_URL" in ended.stderr


def test_a_database_of_the_future_is_a_sentence(tmp_path: Path) -> None:
    """A database that a newer version has migrated is left alone."""
    url = f"sqlite:///{tmp_path / 'a.sqlite3'}"
    environment = {"MORPHID_DATABASE_URL": url}
    RUNNER.invoke(app, ["db", "upgrade"], env=environment)
    engine = create_engine(url)
    with engine.begin() as connection:
        connection.execute(text("UPDATE alembic_version SET version_num = 'from_the_future'"))
    engine.dispose()
    ended = RUNNER.invoke(app, ["db", "upgrade"], env=environment)
    assert ended.exit_code == Exit.ENVIRONMENT
    assert "newer version" in ended.stderr


@pytest.mark.parametrize("words", [["db", "upgrade"], ["keys", "ls"], ["ready"], ["serve"], ["audit", "ls"]])
@pytest.mark.parametrize("url", ["mysql://me@127.0.0.1/x", "postgresql+foo://me@127.0.0.1/x", "nonsense"])
def test_an_unknown_database_is_a_sentence(words: list[str], url: str, tmp_path: Path) -> None:
    """Every command that opens one says which there are, before it does anything."""
    environment = {"MORPHID_DATABASE_URL": url, "MORPHID_DATA_DIR": str(tmp_path / "x")}
    ended = RUNNER.invoke(app, words, env=environment)
    assert ended.exit_code == Exit.USAGE
    assert ended.stderr.startswith("error: MORPHID_DATABASE_URL: ")
    assert "postgresql:" in ended.stderr
    assert list(tmp_path.iterdir()) == []
