"""Why a transaction failed: the database is unavailable or full, or the statement was wrong."""

from __future__ import annotations

import sqlite3
from enum import Enum

from sqlalchemy.exc import DBAPIError, InterfaceError, OperationalError
from sqlalchemy.exc import TimeoutError as PoolTimeout

# https://www.postgresql.org/docs/current/errcodes-appendix.html
POSTGRES_DISK_FULL = "53100"
POSTGRES_PASSING = ("08", "40", "53", "55", "57", "58")
# of these classes: connection, rollback, resources, locks, operator, system
POSTGRES_STANDBY = "25006"  # writes are refused: a former primary answers after a switch-over
# https://www.sqlite.org/rescode.html, primary codes
SQLITE_PASSING = frozenset(
    {
        sqlite3.SQLITE_BUSY,
        sqlite3.SQLITE_LOCKED,
        sqlite3.SQLITE_IOERR,
        sqlite3.SQLITE_CANTOPEN,
        sqlite3.SQLITE_PROTOCOL,
        sqlite3.SQLITE_NOMEM,
    }
)
PRIMARY_CODE = 0xFF  # SQLite's extended codes keep the primary one in the low byte


class DatabaseTrouble(Enum):
    """Why a transaction failed although its statements are correct."""

    AWAY = "away"  # it restarts, is unreachable, or was too busy: the same transaction may succeed later
    FULL = "full"  # there is no space for the write


def trouble_of(error: BaseException) -> DatabaseTrouble | None:
    """Classify the database's trouble; None if the statement itself is at fault."""
    if isinstance(error, PoolTimeout):
        return DatabaseTrouble.AWAY
    if not isinstance(error, DBAPIError):
        return None
    if isinstance(error.orig, sqlite3.Error):
        return _sqlite_trouble(error.orig)
    state = getattr(error.orig, "sqlstate", None) or ""
    if state == POSTGRES_DISK_FULL:
        return DatabaseTrouble.FULL
    if state.startswith(POSTGRES_PASSING) or state == POSTGRES_STANDBY or error.connection_invalidated:
        return DatabaseTrouble.AWAY
    # no code from the driver: no connection, or a broken one
    broken = isinstance(error, (OperationalError, InterfaceError))
    return DatabaseTrouble.AWAY if broken and not state else None


def _sqlite_trouble(error: sqlite3.Error) -> DatabaseTrouble | None:
    code = getattr(error, "sqlite_errorcode", None)
    if code is None:
        return None
    if code & PRIMARY_CODE == sqlite3.SQLITE_FULL:
        return DatabaseTrouble.FULL
    return DatabaseTrouble.AWAY if code & PRIMARY_CODE in SQLITE_PASSING else None
