"""The rig on both pairs: SQLite with the embedded broker, Postgres with a broker behind a URL."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.faults.rig import Rig
from tests.servers import redis
from tests.servers.postgres import NoPostgres, PostgresServer

PAIRS = [
    pytest.param("sqlite-embedded"),
    pytest.param("postgres-redis", marks=pytest.mark.faults),
]


@pytest.fixture(scope="session")
def crashing_postgres() -> Iterator[PostgresServer]:
    """A Postgres server that tests may crash; the next test finds it running again."""
    try:
        server = PostgresServer()
    except NoPostgres as reason:
        pytest.skip(str(reason))
    yield server
    server.close()


@pytest.fixture(params=PAIRS)
def pair(request: pytest.FixtureRequest) -> str:
    """Which database and which broker."""
    name: str = request.param
    return name


def opened_rig(pair: str, request: pytest.FixtureRequest, folder: Path, root: Path) -> Rig:
    """Database and broker of a pair."""
    if pair == "sqlite-embedded":
        return Rig(folder, root, f"sqlite:///{folder / 'jobs.sqlite3'}", redis.embedded(folder))
    server = request.getfixturevalue("crashing_postgres")
    return Rig(folder, root, server.new_database(), redis.plain(folder / "broker"))


@pytest.fixture
def rig(pair: str, request: pytest.FixtureRequest, tmp_path: Path, root: Path) -> Iterator[Rig]:
    """Broker and job store; the test starts workers and API. At its end every promise must have been kept."""
    rig = opened_rig(pair, request, tmp_path, root)
    try:
        yield rig
        rig.settle()
        rig.ledger.assert_kept(rig.database)
    finally:
        rig.close()
