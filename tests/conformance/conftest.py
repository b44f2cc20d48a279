"""Both pairs: SQLite and Postgres, the embedded broker and one behind a Redis URL.

``MORPHID_TEST_DATABASE_URL`` and ``MORPHID_TEST_BROKER_URL`` put servers of this machine in the place of
the second ones: a Postgres database whose user may create databases, and an empty Redis database.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from morphid.supervisor import Supervisor
from tests.app.conftest import database_url, postgres_server
from tests.servers import redis

__all__ = ["broker_url", "database_url", "own_broker", "postgres_server"]

GIVEN_BROKER = "MORPHID_TEST_BROKER_URL"
SERVERS = {"embedded": redis.embedded, "redis-url": redis.plain}


class OwnBroker:
    """A broker that a test may stop and start again.

    Parameters
    ----------
    kind : ``embedded`` or ``redis-url``.
    folder : for its files.
    """

    def __init__(self, kind: str, folder: Path) -> None:
        self._server = SERVERS[kind](folder)
        self.url = self._server.url
        self._supervisor = Supervisor(folder / "logs", report=lambda _sentence: None)
        self._child = self._supervisor.start(self._server.spec)
        self.wait()

    def wait(self) -> None:
        """Wait until it takes commands."""
        assert self._supervisor.wait_until(self._child, self._server.answers, 10.0), self._child.last_words()

    def restart(self) -> None:
        """Stop it and start it again."""
        self._child.stop()
        self._child.start()
        self.wait()

    def close(self) -> None:
        """End it."""
        self._supervisor.stop()


@pytest.fixture(params=list(SERVERS))
def own_broker(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[OwnBroker]:
    """A fresh broker of each kind."""
    broker = OwnBroker(request.param, tmp_path)
    yield broker
    broker.close()


@pytest.fixture(params=list(SERVERS))
def broker_url(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[str]:
    """Address of a broker of each kind, or of the one that the environment names."""
    given = os.environ.get(GIVEN_BROKER)
    if request.param == "redis-url" and given:
        yield given
        return
    broker = OwnBroker(request.param, tmp_path)
    yield broker.url
    broker.close()
