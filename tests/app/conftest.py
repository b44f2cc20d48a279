"""Databases for the tests of the service: real SQLite files and a real Postgres server."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from app.database import Database
from app.settings import Settings
from tests.app.running_service import DEAD_BROKER, RunningService, running_service
from tests.servers.postgres import GivenPostgres, NoPostgres, open_postgres
from tests.servers.stores import migrated_sqlite


@pytest.fixture(scope="session")
def postgres_server() -> Iterator[GivenPostgres]:
    """A Postgres server that lives as long as the test run, or the one that the environment names."""
    try:
        server = open_postgres()
    except NoPostgres as reason:
        pytest.skip(str(reason))
    yield server
    server.close()


@pytest.fixture(params=["sqlite", "postgres"])
def database_url(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """URL of an empty database, once per kind."""
    if request.param == "sqlite":
        return f"sqlite:///{tmp_path / 'store.sqlite3'}"
    return request.getfixturevalue("postgres_server").new_database()


@pytest.fixture(params=["sqlite", "postgres"])
def migrated_url(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[str]:
    """URL of a migrated database without rows, once per kind."""
    if request.param == "sqlite":
        yield migrated_sqlite(tmp_path / "store.sqlite3")
        return
    server = request.getfixturevalue("postgres_server")
    url = server.migrated_database()
    yield url
    server.take_back(url)


@pytest.fixture
def database(migrated_url: str) -> Iterator[Database]:
    """A migrated database without rows, once per kind."""
    database = Database(migrated_url)
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


@pytest.fixture(scope="session")
def shared_service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningService]:
    """A running service on SQLite for all folders whose tests do not mind other tests' rows.

    Such a folder says so: its conftest gives this one out as `service`.
    """
    url = migrated_sqlite(tmp_path_factory.mktemp("shared") / "service.sqlite3")
    with running_service(_settings(url)) as running:
        yield running


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningService]:
    """A running service on SQLite, one per test file."""
    url = migrated_sqlite(tmp_path_factory.mktemp("service") / "service.sqlite3")
    with running_service(_settings(url)) as running:
        yield running


@pytest.fixture(scope="module", params=["sqlite", pytest.param("postgres", marks=pytest.mark.slow)])
def any_service(request: pytest.FixtureRequest) -> Iterator[RunningService]:
    """A running service, once on each database; on Postgres among the long proofs.

    The laws of the store itself are proved on both databases in every run (`database`).
    """
    if request.param == "sqlite":
        yield request.getfixturevalue("service")
        return
    url = request.getfixturevalue("postgres_server").migrated_database()
    with running_service(_settings(url)) as running:
        yield running
