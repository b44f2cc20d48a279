"""The first run on a cold clone compiles outside the tests' time limits."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor, wait
from pathlib import Path
from threading import Event
from types import SimpleNamespace
from typing import Any

import pytest

from tests.compilation import ROOT, compile_before


class Memory:
    """Pytest's cache for one test.

    Parameters
    ----------
    folder : of its files.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.values: dict[str, Any] = {}

    def mkdir(self, name: str) -> Path:
        """Make a folder of that name."""
        (self.folder / name).mkdir(exist_ok=True)
        return self.folder / name

    def get(self, key: str, default: Any) -> Any:
        """Give what was kept."""
        return self.values.get(key, default)

    def set(self, key: str, value: Any) -> None:
        """Keep a value."""
        self.values[key] = value


def session_of(memory: Memory, *files: str) -> Any:
    """A session that collected a test of each of these files."""
    items = [SimpleNamespace(path=ROOT / "tests" / file) for file in files]
    return SimpleNamespace(items=items, config=SimpleNamespace(cache=memory))


def test_kernels_are_compiled_once_before_the_tests_that_need_them(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A cold clone compiles before its first test, the next run does not; an empty cache does again."""
    monkeypatch.delenv("NUMBA_DISABLE_JIT", raising=False)
    memory, said, compiled = Memory(tmp_path), [], []

    def run(*files: str) -> int:
        compiled.clear()
        compile_before(session_of(memory, *files), said.append, lambda: compiled.append(True))
        return len(compiled)

    assert run("app/test_main.py", "morphdata/samplefiles/test_csv.py") == 0  # these call no compiled code
    assert run("app/test_main.py", "simulate/test_flight.py") == 1
    assert said
    assert run("simulate/test_flight.py") == 0
    monkeypatch.setenv("NUMBA_CACHE_DIR", "/elsewhere")
    assert run("simulate/test_flight.py") == 1


def test_runs_that_begin_at_once_compile_once(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The second of two waits until the first has compiled, and then has nothing to do."""
    monkeypatch.delenv("NUMBA_DISABLE_JIT", raising=False)
    memory, compiled = Memory(tmp_path), []
    begun, finish = Event(), Event()

    def compiling() -> None:
        compiled.append(True)
        begun.set()
        assert finish.wait(20.0)

    def run() -> None:
        compile_before(session_of(memory, "simulate/test_flight.py"), str, compiling)

    with ThreadPoolExecutor(2) as runs:
        first = runs.submit(run)
        assert begun.wait(20.0)
        second = runs.submit(run)
        assert not wait([second], 0.2).done
        finish.set()
        first.result()
        second.result()
    assert len(compiled) == 1


def test_a_failed_compilation_is_not_remembered(tmp_path: Path) -> None:
    """What broke off is tried again by the next run."""
    memory = Memory(tmp_path)

    def breaks() -> None:
        raise RuntimeError("no room")

    with pytest.raises(RuntimeError):
        compile_before(session_of(memory, "simulate/test_flight.py"), str, breaks)
    assert memory.values == {}
