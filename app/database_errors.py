"""Why a transaction failed: the database is away or full, or the statement was wrong."""

from __future__ import annotations

import sqlite3
from enum import Enum

from sqlalchemy.exc import DBAPIError, InterfaceError, OperationalError
from sqlalchemy.exc import TimeoutError as PoolTimeout

# https://www.postgresql.org/docs/current/errcodes-appendix.html
POSTGRES_DISK_FULL = "53100"
POSTGRES_PASSING = ("08", "40", "53", "55", "57", "58")
# of these classes: connection, rollback, resources, locks, operator, system
POSTGRES_STANDBY = "25006"  # writes are refused: the former primary answers after a switch-over
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
    """Why a transaction failed though its statements are right."""

    AWAY = "away"  # it restarts, cannot be reached, or was too busy: the same transaction may pass later
    FULL = "full"  # there is no room for what should be written


def trouble_of(error: BaseException) -> DatabaseTrouble | None:
    """Classify the trouble that the database has; None when the fault is in the statement itself."""
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
    # the driver itself gives no code: no connection, or one that broke
    broken = isinstance(error, (OperationalError, InterfaceError))
    return DatabaseTrouble.AWAY if broken and not state else None


def _sqlite_trouble(error: sqlite3.Error) -> DatabaseTrouble | None:
    code = getattr(error, "sqlite_errorcode", None)
    if code is None:
        return None
    if code & PRIMARY_CODE == sqlite3.SQLITE_FULL:
        return DatabaseTrouble.FULL
    return DatabaseTrouble.AWAY if code & PRIMARY_CODE in SQLITE_PASSING else None
