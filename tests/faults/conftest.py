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


@pytest.fixture
def rig(pair: str, request: pytest.FixtureRequest, tmp_path: Path, root: Path) -> Iterator[Rig]:
    """Broker and job store; the test starts workers and API. At its end every promise must have been kept."""
    if pair == "sqlite-embedded":
        rig = Rig(tmp_path, root, f"sqlite:///{tmp_path / 'jobs.sqlite3'}", redis.embedded(tmp_path))
    else:
        server = request.getfixturevalue("crashing_postgres")
        rig = Rig(tmp_path, root, server.new_database(), redis.plain(tmp_path / "broker"))
    try:
        yield rig
        rig.settle()
        rig.ledger.assert_kept(rig.database)
    finally:
        rig.close()
