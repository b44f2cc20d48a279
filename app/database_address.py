"""The address of a database as text: written so that the file lies where it should, or refused."""

from __future__ import annotations

import os
import sys
from importlib.util import find_spec
from pathlib import Path

# what the statements and the connection's options are written for, and the package of each driver
DRIVERS = {
    "sqlite": {"pysqlite": "sqlite3"},
    "postgresql": {"psycopg": "psycopg", "psycopg2": "psycopg2"},
}
EXAMPLES = "postgresql://user:password@host:5432/name, or sqlite:////folder/file.sqlite3"


class UnusableAddress(ValueError):
    """The address names no database that this installation can open; the message holds no password."""


def sqlite_url(file: Path) -> str:
    """Give the URL of an SQLite file, whatever characters its folders have in their names.

    Raises
    ------
    UnusableAddress
        SQLite would look for another file: it reads names as UTF-8, and this process encodes them otherwise.
    """
    from sqlalchemy import URL  # lazy, here and below: settings are read where no database is

    if os.fsencode(file) != str(file).encode("utf-8", "replace"):
        shown = os.fsencode(file).decode("utf-8", "replace")
        raise UnusableAddress(
            f"SQLite cannot open the path {shown} in this locale ({sys.getfilesystemencoding()}). "
            "Set PYTHONUTF8=1, or choose a folder with a name in ASCII."
        )
    return URL.create("sqlite", database=str(file)).render_as_string(hide_password=False)


def normal_url(url: str) -> str:
    """Name the driver that is installed: ``postgres://`` and ``postgresql://`` mean psycopg 3."""
    for prefix in ("postgres://", "postgresql://"):
        if url.startswith(prefix):
            return "postgresql+psycopg://" + url.removeprefix(prefix)
    return url


def require_usable(url: str) -> None:
    """Look at an address without opening it.

    Raises
    ------
    UnusableAddress
        It is no URL, or is of a database or a driver that is not known or not installed.
    """
    from sqlalchemy import make_url
    from sqlalchemy.exc import ArgumentError

    try:
        parsed = make_url(normal_url(url))
    except (ArgumentError, ValueError):  # the second: of a port that is no number
        raise UnusableAddress(f"this is not a database URL. Write {EXAMPLES}.") from None
    backend, _, driver = parsed.drivername.partition("+")
    known = DRIVERS.get(backend)
    if known is None:
        raise UnusableAddress(
            f"there is no support for {backend!r}, only for Postgres and SQLite. Write {EXAMPLES}."
        )
    driver = driver or next(iter(known))
    if driver not in known:
        raise UnusableAddress(
            f"the driver {driver!r} of {backend} is not supported. Leave it out: {backend}://..."
        )
    if find_spec(known[driver]) is None:
        raise UnusableAddress(
            f"the package {known[driver]} of the driver {driver!r} is missing. pip install 'morphid[server]'."
        )
