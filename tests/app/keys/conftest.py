"""A service that demands keys, on each database."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from app.settings import Settings
from tests.app.running_service import DEAD_BROKER, RunningService, running_service


def _keyed(url: str) -> Settings:
    return Settings(
        database_url=url, broker_url=DEAD_BROKER, auth="keys", event_poll_s=0.02, max_body_bytes=2**23
    )


@pytest.fixture(scope="module", params=["sqlite", "postgres"])
def keyed_service(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[RunningService]:
    """A running service that demands keys, once on each database."""
    if request.param == "sqlite":
        url = f"sqlite:///{tmp_path_factory.mktemp('keyed') / 'service.sqlite3'}"
    else:
        url = request.getfixturevalue("postgres_server").new_database()
    with running_service(_keyed(url)) as running:
        yield running


@pytest.fixture(scope="module")
def keyed_on_sqlite(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningService]:
    """The same on SQLite only, for laws in which the database has no part."""
    folder = tmp_path_factory.mktemp("keyed")
    with running_service(_keyed(f"sqlite:///{folder / 'service.sqlite3'}")) as running:
        yield running
