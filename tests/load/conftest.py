"""The rig of the fault suite under load, on both pairs; figures are printed as they come."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.faults.conftest import crashing_postgres, opened_rig
from tests.faults.rig import Rig

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
    rig = opened_rig(pair, request, tmp_path, root)
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
