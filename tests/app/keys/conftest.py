"""A service that demands keys, on each database."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from app.settings import Settings
from tests.app.running_service import DEAD_BROKER, RunningService, running_service
from tests.servers.stores import migrated_sqlite


def _keyed(url: str) -> Settings:
    return Settings(
        database_url=url, broker_url=DEAD_BROKER, auth="keys", event_poll_s=0.02, max_body_bytes=2**23
    )


@pytest.fixture(scope="module", params=["sqlite", pytest.param("postgres", marks=pytest.mark.slow)])
def keyed_service(request: pytest.FixtureRequest) -> Iterator[RunningService]:
    """A running service that demands keys, once on each database; on Postgres among the long proofs."""
    if request.param == "sqlite":
        yield request.getfixturevalue("keyed_on_sqlite")
        return
    url = request.getfixturevalue("postgres_server").migrated_database()
    with running_service(_keyed(url)) as running:
        yield running


@pytest.fixture(scope="module")
def keyed_on_sqlite(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningService]:
    """A running service that demands keys on SQLite, for laws in which the database has no part."""
    url = migrated_sqlite(tmp_path_factory.mktemp("keyed") / "service.sqlite3")
    with running_service(_keyed(url)) as running:
        yield running
