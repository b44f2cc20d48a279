"""Releases disk space that deleted rows leave in an SQLite file, a little at a time.

Postgres does this itself (autovacuum): the space is reused, and files shrink at their ends.
"""

from __future__ import annotations

import logging
import sqlite3
from contextlib import closing

from sqlalchemy import text

from app.database import Database

INCREMENTAL = 2  # value of PRAGMA auto_vacuum if pages can be released
SLICE_PAGES = 500  # 2 MB moved in one transaction, during which other writers wait
KEPT_PAGES = 250  # 1 MB is kept for the next rows

log = logging.getLogger(__name__)


def give_back(database: Database) -> bool:
    """Return one slice of free pages to the disk; return whether more are left."""
    if database.engine.dialect.name != "sqlite":
        return False
    with database.read() as session:
        free = int(session.scalar(text("PRAGMA freelist_count")) or 0) - KEPT_PAGES
        if free <= 0 or session.scalar(text("PRAGMA auto_vacuum")) != INCREMENTAL:
            return False
    more = free > SLICE_PAGES
    with closing(database.engine.raw_connection()) as connection:
        # a script, because this takes one step per page and the driver makes only one for a statement without
        # rows
        connection.cursor().executescript(f"PRAGMA incremental_vacuum({min(free, SLICE_PAGES)})")
        if not more:
            # moves the journal into the file, which is then truncated, as far as no reader needs older pages
            connection.cursor().execute("PRAGMA wal_checkpoint(PASSIVE)")
    return more


def make_shrinkable(database: Database) -> None:
    """Rewrite a file of an earlier version, once, so that its pages can be released.

    This needs as much free space as the file takes. If there is too little, or another process keeps the
    database open, the file stays as it is until the next start.
    """
    if database.engine.dialect.name != "sqlite":
        return
    with database.read() as session:
        if session.scalar(text("PRAGMA auto_vacuum")) == INCREMENTAL:
            return
    with closing(database.engine.raw_connection()) as connection:
        try:
            cursor = connection.cursor()
            cursor.execute(f"PRAGMA auto_vacuum = {INCREMENTAL}")
            cursor.execute("VACUUM")
        except sqlite3.OperationalError as error:
            log.warning("the database file cannot shrink yet: %s", error)
