"""The children of a worker are informed of its shutdown, and by no one else."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from worker import shutdown


@pytest.fixture(autouse=True)
def _armed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A worker's pipe, and a folder of everybody's that is empty."""
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", None)
    shutdown.arm()
    yield
    shutdown.disarm()


def seen_in_a_child() -> bool:
    """Fork as Celery's pool does, and check there."""
    child = os.fork()
    if child == 0:
        os._exit(int(shutdown.announced()))
    return bool(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))


def test_every_child_learns_of_it() -> None:
    """Those that were there and those that come later, again and again."""
    assert not seen_in_a_child()
    shutdown.announce()
    assert [seen_in_a_child() for _ in range(3)] == [True] * 3
    shutdown.announce()
    assert seen_in_a_child()


def test_a_worker_that_was_not_armed_knows_of_nothing() -> None:
    """Announcing without a pipe, or after its end, is no error."""
    shutdown.disarm()
    shutdown.announce()
    assert not shutdown.announced()


def test_nothing_lies_where_others_could_write(tmp_path: Path) -> None:
    """The message has no name: no file in the folder for temporary ones, and no name in the environment."""
    shutdown.announce()
    assert shutdown.announced()
    assert not list(tmp_path.iterdir())
    assert not any(str(tmp_path) in value for name, value in os.environ.items() if name != "TMPDIR")
