"""Threads and compiled kernels of one worker process.

The thread count is set by environment variables before numba is imported. Kernels are compiled or loaded from
the cache in the pool's child, in the background, while it already accepts jobs: run in the parent, they would
break its forks.
"""

from __future__ import annotations

import contextlib
import logging
import os
import stat
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path

log = logging.getLogger(__name__)

CGROUP_CPU_LIMIT = Path("/sys/fs/cgroup/cpu.max")  # "<quota> <period>" in microseconds, or "max <period>"


def usable_cores() -> int:
    """Count the cores this process may use: affinity, and the container's quota rounded up."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    try:
        quota, period = CGROUP_CPU_LIMIT.read_text("ascii").split()
        if quota != "max":
            cores = min(cores, -(-int(quota) // int(period)))
    except (OSError, ValueError):
        pass  # no readable quota
    return max(1, cores)


def share_cores(concurrency: int, *, cores: int | None = None) -> int:
    """Return each concurrent job's share of the cores (by default all usable ones), at least one thread."""
    return max(1, (usable_cores() if cores is None else cores) // max(1, concurrency))


def prepare_environment(threads: int) -> None:
    """Set the thread count of this process and its forks; no effect once numba is imported."""
    if "numba" in sys.modules:
        return  # its threads may be running already; numba refuses to change their number
    os.environ["NUMBA_NUM_THREADS"] = str(threads)
    # the kernels distribute blocks over threads themselves; a second pool would compete for the cores
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    os.environ.setdefault("MPLBACKEND", "Agg")
    ensure_cache()


def ensure_cache() -> None:
    """Point numba and matplotlib to a folder of the user if their default folders are not writable."""
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    if chosen and not takes_files(Path(chosen)):
        _keep_kernels_elsewhere(f"NUMBA_CACHE_DIR {chosen} cannot be written")
    elif not chosen and not any(takes_files(folder) for folder in _own_cache_folders()):
        _keep_kernels_elsewhere("neither this installation nor a home folder can hold compiled kernels")
    # without one, matplotlib makes a temporary folder at each start and warns
    if not os.environ.get("MPLCONFIGDIR") and not takes_files(_home("XDG_CONFIG_HOME", ".config")):
        folder = os.environ.get("NUMBA_CACHE_DIR") or _private_folder()
        if folder is not None:
            os.environ["MPLCONFIGDIR"] = str(folder)


def takes_files(folder: Path) -> bool:
    """Whether a file can actually be created there: permission bits do not show read-only or full disks.

    For a folder that does not exist yet, the nearest existing parent is tried.
    """
    try:
        there = next(each for each in (folder, *folder.absolute().parents) if each.exists())
        with tempfile.TemporaryFile(dir=there) as file:
            file.write(b"x" * 4096)
    except OSError:
        return False
    return True


def _own_cache_folders() -> Iterator[Path]:
    """Numba's default folders for compiled code: next to the source, else in the user's cache."""
    library = find_spec("morphcore")  # found, not imported
    if library is not None and library.origin is not None:
        yield Path(library.origin).parent / "__pycache__"
    yield _home("XDG_CACHE_HOME", ".cache")


def _home(variable: str, name: str) -> Path:
    return Path(os.environ.get(variable) or os.path.expanduser(f"~/{name}"))  # noqa: PTH111 - Path.expanduser raises without a home


def _keep_kernels_elsewhere(reason: str) -> None:
    folder = _private_folder()
    if folder is None:
        return  # morphcore.jit then compiles in each process and logs a warning
    log.warning(
        "%s; they are kept in %s. Set NUMBA_CACHE_DIR to a folder that this user may write", reason, folder
    )
    os.environ["NUMBA_CACHE_DIR"] = str(folder)


def _private_folder() -> Path | None:
    """A temporary folder private to this user, so that no foreign code is run. None if it cannot be made."""
    try:
        folder = Path(tempfile.gettempdir()) / f"morphid-kernels-{os.getuid()}"
        with contextlib.suppress(FileExistsError):
            folder.mkdir(mode=0o700)
        found = folder.lstat()
        if stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid() and not found.st_mode & 0o077:
            return folder
        return Path(tempfile.mkdtemp(prefix="morphid-kernels-"))
    except OSError:
        return None


class Kernels:
    """The compiled kernels of this process, prepared once, in the background.

    ``warm_up(threads)`` compiles or loads those that most jobs need; ``further()`` the others, once jobs may
    run. Each job uses ``threads`` numeric threads.
    """

    def __init__(
        self, warm_up: Callable[[int], object], threads: int, further: Callable[[], object] | None = None
    ) -> None:
        self.threads = threads
        self._warm_up = warm_up
        self._further = further
        self._done = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Start in the background; a second call does nothing."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="warm-up", daemon=True)
            self._thread.start()

    @property
    def ready(self) -> bool:
        """Whether the warm-up is over."""
        return self._done.is_set()

    def wait(self, stop: Callable[[], bool], *, poll_s: float = 0.2) -> bool:
        """Wait for the end of the warm-up; return False if ``stop()`` returned True first."""
        self.start()
        while not self._done.wait(poll_s):
            if stop():
                return False
        return True

    def _run(self) -> None:
        try:
            self._warm_up(self.threads)
        except Exception:
            # the job itself will fail in the same way and report it to the user
            log.exception("the numeric kernels could not be prepared")
        finally:
            self._done.set()
        if self._further is not None:
            try:
                self._further()
            except Exception:
                log.exception("the further numeric kernels could not be prepared")


def warm_up_library(threads: int) -> None:
    """Compile or load the kernels of morphcore that identifications need."""
    import morphcore

    morphcore.warm_up(threads)


def warm_up_library_further() -> None:
    """Compile or load its other kernels."""
    import morphcore

    morphcore.warm_up_further()
