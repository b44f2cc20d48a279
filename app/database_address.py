"""Database addresses: normalised so that the file is where it should be, or refused."""

from __future__ import annotations

import os
import sys
from importlib.util import find_spec
from pathlib import Path

# the supported databases, and the package of each driver
DRIVERS = {
    "sqlite": {"pysqlite": "sqlite3"},
    "postgresql": {"psycopg": "psycopg", "psycopg2": "psycopg2"},
}
EXAMPLES = "postgresql://user:password@host:5432/name, or sqlite:////folder/file.sqlite3"


class UnusableAddress(ValueError):
    """This installation cannot open a database at the address; the message contains no password."""


def sqlite_url(file: Path) -> str:
    """Return the URL of an SQLite file, for any characters in the names of its folders.

    Raises
    ------
    UnusableAddress
        SQLite would open another file: it reads names as UTF-8, and this process encodes them differently.
    """
    from sqlalchemy import URL  # lazy, here and below: settings are also read where there is no database

    if os.fsencode(file) != str(file).encode("utf-8", "replace"):
        shown = os.fsencode(file).decode("utf-8", "replace")
        raise UnusableAddress(
            f"SQLite cannot open the path {shown} in this locale ({sys.getfilesystemencoding()}). "
            "Set PYTHONUTF8=1, or choose a folder with a name in ASCII."
        )
    return URL.create("sqlite", database=str(file)).render_as_string(hide_password=False)


def normal_url(url: str) -> str:
    """Add the installed driver: ``postgres://`` and ``postgresql://`` mean psycopg 3."""
    for prefix in ("postgres://", "postgresql://"):
        if url.startswith(prefix):
            return "postgresql+psycopg://" + url.removeprefix(prefix)
    return url


def require_usable(url: str) -> None:
    """Check an address without opening it.

    Raises
    ------
    UnusableAddress
        It is not a URL, or its database or driver is unknown or not installed.
    """
    from sqlalchemy import make_url
    from sqlalchemy.exc import ArgumentError

    try:
        parsed = make_url(normal_url(url))
    except (ArgumentError, ValueError):  # the second: the port is not a number
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
