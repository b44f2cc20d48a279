"""Fixtures of the whole house: the example data and a live service."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from app import on_end  # noqa: F401 - tests end jobs by the store's own functions
from tests import loopback_only
from tests.compilation import compile_before
from tests.live import LiveService

loopback_only.stay_here()
os.environ.setdefault("MPLBACKEND", "Agg")

ROOT = Path(__file__).resolve().parent.parent


def pytest_runtestloop(session: pytest.Session) -> None:
    """Compile first: the time limit of a test does not run yet."""
    if not session.config.option.collectonly:
        reporter = session.config.pluginmanager.get_plugin("terminalreporter")
        compile_before(session, print if reporter is None else reporter.write_line)


@pytest.fixture(autouse=True)
def _nothing_leaves_this_machine() -> Iterator[None]:
    """Fail the test in which, or before which, a thread wanted to talk to another machine."""
    yield
    seen, loopback_only.refused[:] = list(loopback_only.refused), []
    assert not seen, f"tests talk to this machine alone: {seen}"


@pytest.fixture(scope="session")
def root() -> Path:
    """The repository."""
    return ROOT


@pytest.fixture(scope="session")
def examples() -> Path:
    """The example aircraft, flight condition and sample flights."""
    return ROOT / "examples"


@pytest.fixture(scope="session")
def live_service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveService]:
    """One `morphid serve` for the whole run: API, worker and broker as users have them."""
    service = LiveService(tmp_path_factory.mktemp("live")).start()
    yield service
    service.stop()
