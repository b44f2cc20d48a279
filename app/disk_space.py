"""Disk space that deleted rows leave in an SQLite file, given back a little at a time.

Postgres does this by itself (autovacuum): the room is used again, and files shrink at their ends.
"""

from __future__ import annotations

import logging
import sqlite3
from contextlib import closing

from sqlalchemy import text

from app.database import Database

INCREMENTAL = 2  # what PRAGMA auto_vacuum answers where pages can be given back
SLICE_PAGES = 500  # 2 MB moved in one transaction, while which other writers wait
KEPT_PAGES = 250  # 1 MB stays for the next rows

log = logging.getLogger(__name__)


def give_back(database: Database) -> bool:
    """Give one slice of free pages back to the disk; return whether more are left."""
    if database.engine.dialect.name != "sqlite":
        return False
    with database.read() as session:
        free = int(session.scalar(text("PRAGMA freelist_count")) or 0) - KEPT_PAGES
        if free <= 0 or session.scalar(text("PRAGMA auto_vacuum")) != INCREMENTAL:
            return False
    more = free > SLICE_PAGES
    with closing(database.engine.raw_connection()) as connection:
        # a script, for this is a step a page, and of a statement without rows the driver makes one step
        connection.cursor().executescript(f"PRAGMA incremental_vacuum({min(free, SLICE_PAGES)})")
        if not more:
            # the journal goes into the file, which is cut then, as far as nobody reads what is older
            connection.cursor().execute("PRAGMA wal_checkpoint(PASSIVE)")
    return more


def make_shrinkable(database: Database) -> None:
    """Write a file of an earlier version anew, once, so that its pages can be given back.

    Needs as much room again as the file takes. Where there is too little, or another process holds on to the
    database, the file stays as it is until the next start.
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
