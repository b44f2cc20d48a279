"""The rig of the fault suite under load, on both pairs; figures are printed as they come."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.faults.conftest import crashing_postgres
from tests.faults.rig import Rig
from tests.servers import redis

__all__ = ["crashing_postgres"]

Tell = Callable[[str], None]


@pytest.fixture(params=["sqlite-embedded", "postgres-redis"])
def pair(request: pytest.FixtureRequest) -> str:
    """Which database and which broker."""
    name: str = request.param
    return name


@pytest.fixture
def rig(pair: str, request: pytest.FixtureRequest, tmp_path: Path, root: Path) -> Iterator[Rig]:
    """Broker and job store; the test starts workers and API."""
    if pair == "sqlite-embedded":
        rig = Rig(tmp_path, root, f"sqlite:///{tmp_path / 'jobs.sqlite3'}", redis.embedded(tmp_path))
    else:
        server = request.getfixturevalue("crashing_postgres")
        rig = Rig(tmp_path, root, server.new_database(), redis.plain(tmp_path / "broker"))
    try:
        yield rig
    finally:
        rig.close()


@pytest.fixture
def tell(pair: str, capsys: pytest.CaptureFixture[str]) -> Tell:
    """Print a figure past pytest's capture."""

    def print_line(line: str) -> None:
        with capsys.disabled():
            print(f"\n  {pair:16} {line}", end="")

    return print_line
