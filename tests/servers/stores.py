"""Migrated, empty databases: migrated once a run, then copied."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from app.database import upgrade
from app.database_address import sqlite_url
from app.private_files import touch_private


@cache
def _migrated_file() -> bytes:
    with TemporaryDirectory(prefix="morphid-template-") as folder:
        file = Path(folder) / "store.sqlite3"
        upgrade(sqlite_url(file))
        return file.read_bytes()  # the whole store: the last connection to close empties the journal into it


def migrated_sqlite(file: Path) -> str:
    """Make an SQLite file at the newest revision, without rows, and give its URL."""
    touch_private(file)
    file.write_bytes(_migrated_file())
    return f"sqlite:///{file}"
