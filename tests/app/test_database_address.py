"""Addresses of databases: a file is created where requested, and unusable addresses are refused."""

from __future__ import annotations

import sqlite3
import sys
from contextlib import closing
from pathlib import Path

import pytest
from sqlalchemy import make_url

from app import database_address
from app.database import Database, downgrade, migration_config, upgrade
from app.database_address import UnusableAddress, require_usable, sqlite_url
from app.settings import UnsafeSettings, load_settings
from tests.folder_names import ALL_NESTED, FOLDER_NAMES


def test_the_database_lies_where_it_was_requested(tmp_path: Path) -> None:
    """Migrated up and down and read, in a folder of any name; nothing is made anywhere else."""
    folder = tmp_path / ALL_NESTED
    url = load_settings(data_dir=folder).database_url
    upgrade(url)
    assert (folder / "morphid.sqlite3").is_file()
    assert [each.name for each in tmp_path.iterdir()] == [FOLDER_NAMES[0]]
    with closing(sqlite3.connect(folder / "morphid.sqlite3")) as link:
        assert link.execute("SELECT count(*) FROM jobs").fetchone() == (0,)
    downgrade(url, "base")
    database = Database(url)
    with database.read() as session:
        assert session.exec_driver_sql("PRAGMA database_list").one()[2] == str(folder / "morphid.sqlite3")
    database.dispose()


@pytest.mark.parametrize("name", FOLDER_NAMES)
def test_an_address_names_the_file_again(name: str) -> None:
    """Written as text and read again, as between a service and its children."""
    file = Path("/somewhere") / name / "a.sqlite3"
    assert make_url(sqlite_url(file)).database == str(file)


def test_an_installation_may_have_a_percent_sign(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Alembic's configuration takes one for an interpolation."""
    import migrations

    elsewhere = tmp_path / "100%2F%(here)s" / "__init__.py"
    monkeypatch.setattr(migrations, "__file__", str(elsewhere))
    assert migration_config("sqlite://").get_main_option("script_location") == str(elsewhere.parent)


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("mysql://me:secretword@db/x", "Postgres and SQLite"),
        ("mssql+pyodbc://db/x", "Postgres and SQLite"),
        ("nosuch://db/x", "Postgres and SQLite"),
        ("postgresql+foo://me:secretword@127.0.0.1/x", "driver 'foo'"),
        ("postgresql+asyncpg://me:secretword@127.0.0.1/x", "driver 'asyncpg'"),
        ("sqlite+aiosqlite:///x", "driver 'aiosqlite'"),
        ("nonsense", "not a database URL"),
        ("postgresql://me:secretword@127.0.0.1:port/x", "not a database URL"),
        ("://", "not a database URL"),
        ("sqlite:/x.sqlite3", "not a database URL"),
    ],
)
def test_an_address_that_cannot_be_opened_is_a_sentence(url: str, words: str) -> None:
    """One sentence that names the variable, says what is possible, and keeps the password to itself."""
    with pytest.raises(UnsafeSettings, match=words) as caught:
        load_settings(database_url=url)
    sentence = str(caught.value)
    assert sentence.startswith("MORPHID_DATABASE_URL: ")
    assert "\n" not in sentence
    assert "secretword" not in sentence


def test_a_driver_without_its_package_is_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    """The installation without the server's packages."""
    monkeypatch.setattr(database_address, "find_spec", lambda _name: None)
    with pytest.raises(UnusableAddress, match=r"morphid\[server\]"):
        require_usable("postgresql://me@127.0.0.1/x")


@pytest.mark.parametrize(
    "url",
    [
        "postgres://me@db/x",
        "postgresql://me@db/x",
        "postgresql+psycopg://me@db/x",
        "sqlite://",
        "sqlite:///x",
    ],
)
def test_usual_addresses_are_usable(url: str) -> None:
    """All the ways to write the two."""
    require_usable(url)


def test_home_and_strangers(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """`~` is the home folder; a folder that is called `~name`, like nobody, is itself."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    assert load_settings(data_dir="~/x").data_dir == tmp_path / "x"
    assert (
        load_settings(data_dir="~nobody-has-this-name/x").data_dir == tmp_path / "~nobody-has-this-name" / "x"
    )
    assert load_settings(data_dir="x/../y").data_dir == tmp_path / "y"

    def nobody(_path: Path) -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "expanduser", nobody)
    with pytest.raises(UnsafeSettings, match="in full"):
        load_settings(data_dir="~/x")


def test_names_that_sqlite_reads_otherwise_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """SQLite takes file names in UTF-8: in another locale it would make another file."""
    monkeypatch.setattr(database_address.os, "fsencode", lambda path: str(path).encode("latin-1"))
    monkeypatch.setattr(sys, "getfilesystemencoding", lambda: "iso8859-1")
    with pytest.raises(UnusableAddress, match="PYTHONUTF8"):
        sqlite_url(Path("/tmp/Fluß/a.sqlite3"))  # noqa: S108 - nothing is made
    assert sqlite_url(Path("/x/a.sqlite3")) == "sqlite:////x/a.sqlite3"
