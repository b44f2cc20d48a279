"""Threads and kernels of a worker process."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from worker import numerics
from worker.numerics import Kernels, prepare_environment, share_cores


@pytest.mark.parametrize(
    ("cores", "concurrency", "threads"), [(8, 1, 8), (8, 3, 2), (2, 4, 1), (1, 1, 1), (7, 2, 3)]
)
def test_concurrent_jobs_share_the_cores(cores: int, concurrency: int, threads: int) -> None:
    """Threads times jobs never exceed the cores, unless there are more jobs than cores: then each has one."""
    assert share_cores(concurrency, cores=cores) == threads


@pytest.fixture
def fresh_process(monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """An environment of its own, in a process that has not imported numba."""
    environment: dict[str, str] = {}
    monkeypatch.setattr(os, "environ", environment)
    monkeypatch.delitem(sys.modules, "numba", raising=False)
    return environment


def test_thread_counts_are_fixed_for_children(fresh_process: dict[str, str]) -> None:
    """Children inherit the kernels' thread count, and one thread for every pool beneath them."""
    prepare_environment(3)
    assert fresh_process["NUMBA_NUM_THREADS"] == "3"
    assert fresh_process["OPENBLAS_NUM_THREADS"] == "1"


def test_an_unwritable_cache_is_replaced(fresh_process: dict[str, str], tmp_path: Path) -> None:
    """A cache folder that cannot be written gives way to one that can; a good one stays."""
    fresh_process["NUMBA_CACHE_DIR"] = str(tmp_path / "good")
    prepare_environment(1)
    assert fresh_process["NUMBA_CACHE_DIR"] == str(tmp_path / "good")
    (tmp_path / "file").touch()
    fresh_process["NUMBA_CACHE_DIR"] = str(tmp_path / "file" / "under")
    prepare_environment(1)
    assert os.access(fresh_process["NUMBA_CACHE_DIR"], os.W_OK)


@pytest.fixture
def homeless(fresh_process: dict[str, str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """An installation that nobody can write, for a user without a home; gives the temporary folder."""
    monkeypatch.setattr(numerics, "find_spec", lambda _name: None)
    fresh_process["HOME"] = "/dev/null/home"  # not even root makes folders there
    (tmp_path / "tmp").mkdir()
    monkeypatch.setattr(numerics.tempfile, "tempdir", str(tmp_path / "tmp"))
    return tmp_path / "tmp"


def test_without_a_place_for_kernels_one_sentence_names_the_variable(
    homeless: Path, fresh_process: dict[str, str], caplog: pytest.LogCaptureFixture
) -> None:
    """They go to a private temporary folder, matplotlib's files too; the next process finds them there."""
    prepare_environment(1)
    chosen = Path(fresh_process["NUMBA_CACHE_DIR"])
    assert chosen.parent == homeless
    assert chosen.stat().st_mode & 0o077 == 0
    assert fresh_process["MPLCONFIGDIR"] == str(chosen)
    (record,) = caplog.records
    assert "Set NUMBA_CACHE_DIR" in record.getMessage()
    assert "\n" not in record.getMessage()
    del fresh_process["NUMBA_CACHE_DIR"]
    prepare_environment(1)
    assert fresh_process["NUMBA_CACHE_DIR"] == str(chosen)


def test_compiled_code_of_others_is_not_run(homeless: Path, fresh_process: dict[str, str]) -> None:
    """A folder of that name that others may write, or a link, is left alone."""
    taken = homeless / f"morphid-kernels-{os.getuid()}"
    taken.mkdir()
    taken.chmod(0o777)
    prepare_environment(1)
    first = fresh_process.pop("NUMBA_CACHE_DIR")
    assert first != str(taken)
    taken.rmdir()
    taken.symlink_to(first)
    prepare_environment(1)
    assert fresh_process["NUMBA_CACHE_DIR"] not in {first, str(taken)}


def test_a_home_is_enough(
    fresh_process: dict[str, str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """With a home folder numba finds its own place, and nothing is said."""
    monkeypatch.setattr(numerics, "find_spec", lambda _name: None)
    fresh_process["HOME"] = str(tmp_path)
    prepare_environment(1)
    assert {"NUMBA_CACHE_DIR", "MPLCONFIGDIR"}.isdisjoint(fresh_process)


def test_kernels_warm_up_once() -> None:
    """However often a process starts them, the kernels are prepared once."""
    calls: list[int] = []
    kernels = Kernels(calls.append, threads=2)
    kernels.start()
    assert kernels.wait(lambda: False)
    assert kernels.wait(lambda: False)
    assert calls == [2]


def test_waiting_for_kernels_can_be_stopped() -> None:
    """A wait for the compiler ends on a stop."""
    release = threading.Event()
    kernels = Kernels(lambda _threads: release.wait(10.0), threads=1)
    assert not kernels.wait(lambda: True, poll_s=0.01)
    release.set()


def test_a_failing_warm_up_does_not_block() -> None:
    """If the kernels cannot be prepared, the job itself fails and reports it."""

    def broken(_threads: int) -> None:
        raise OSError("no cache directory")

    assert Kernels(broken, threads=1).wait(lambda: False)


def test_further_kernels_follow_once_jobs_may_run() -> None:
    """Jobs do not wait for the kernels that few of them need, nor for trouble with them."""
    order: list[str] = []
    waiting, came = threading.Event(), threading.Event()

    def further() -> None:
        assert waiting.wait(10.0)
        order.append("further")
        came.set()
        raise RuntimeError("no beams today")

    kernels = Kernels(lambda _threads: order.append("first"), 1, further)
    assert kernels.wait(lambda: False, poll_s=0.01)
    assert order == ["first"]
    waiting.set()
    assert came.wait(10.0)
    assert kernels.ready


def test_the_parent_process_loads_no_compiler(root: Path) -> None:
    """The pool's parent imports the whole worker without numba: its forks stay sound."""
    program = "import sys, worker.celery_app, worker.tasks; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program], cwd=root, check=False).returncode == 0


def strangers_folder(path: Path) -> None:
    """A folder that others may write to."""
    path.mkdir(mode=0o777)
    path.chmod(0o777)


def link_into_our_home(path: Path) -> None:
    """A link of another user's to a folder of ours."""
    home = path.parent / "home"
    home.mkdir(mode=0o700)
    path.symlink_to(home)


@pytest.mark.parametrize("trap", [strangers_folder, link_into_our_home, Path.touch])
def test_a_prepared_name_is_not_used_for_kernels(
    fresh_process: dict[str, str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    trap: Callable[[Path], None],
) -> None:
    """Compiled code goes to no place that somebody else has prepared under the name that we would take."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    prepared = tmp_path / f"morphid-kernels-{os.getuid()}"
    trap(prepared)
    fresh_process["NUMBA_CACHE_DIR"] = "/proc/no/such/place"
    prepare_environment(1)
    chosen = Path(fresh_process["NUMBA_CACHE_DIR"])
    assert chosen.parent == tmp_path
    assert chosen != prepared
    assert chosen.lstat().st_mode & 0o777 == 0o700
