"""Kernels are compiled before the first test, so that no test's time limit includes the compiler."""

from __future__ import annotations

import fcntl
import hashlib
import os
import platform
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
KERNEL_FREE = (
    "app",
    "conformance",
    "docs",
    "house",
    "morphdata",
)  # folders of tests that call no compiled code
REMEMBERED = "morphid/compiled_kernels"  # key in pytest's cache
COMPILING = "compiling kernels (a minute, once; before the tests and outside their time limits)"
COMPILE = "from morphcore.warming import warm_up, warm_up_further; warm_up(); warm_up_further()"


def needs_kernels(paths: Iterable[Path]) -> bool:
    """Whether any of these test files may call compiled code."""
    tests = ROOT / "tests"
    return any(path.relative_to(tests).parts[0] not in KERNEL_FREE for path in paths)


def fingerprint() -> str:
    """Identify the compiled code: the compiler, its cache, and the sources as distinguished by it."""
    sources = sorted(path for path in (ROOT / "morphcore").rglob("*.py") if "kernels" in path.parts)
    parts = [version("numba"), platform.python_version(), os.environ.get("NUMBA_CACHE_DIR", "")]
    for path in sources:
        seen = path.stat()
        parts.append(f"{path} {seen.st_mtime_ns} {seen.st_size}")
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def compile_kernels() -> None:
    """Compile all kernels in a process of its own; they stay in the compiler's cache."""
    subprocess.run([sys.executable, "-c", COMPILE], cwd=ROOT, check=True)


def compile_before(
    session: pytest.Session, say: Callable[[str], None], compiling: Callable[[], None] = compile_kernels
) -> None:
    """Compile the kernels unless no collected test needs them or this was done before.

    Of several test runs that begin at once, one compiles and the others wait for it.

    Parameters
    ----------
    session : pytest.Session
        After collection.
    say : callable
        Shown to waiting processes.
    compiling : callable
        What compiles.
    """
    cache = getattr(session.config, "cache", None)  # not with `-p no:cacheprovider`
    if os.environ.get("NUMBA_DISABLE_JIT") == "1" or not needs_kernels(item.path for item in session.items):
        return
    if cache is None:
        say(COMPILING)
        compiling()
        return
    with alone(Path(cache.mkdir("morphid")) / "compiling.lock"):
        if cache.get(REMEMBERED, None) != fingerprint():
            say(COMPILING)
            compiling()
            cache.set(REMEMBERED, fingerprint())


@contextmanager
def alone(file: Path) -> Iterator[None]:
    """Wait until no other process is in such a block with the same file; one that dies leaves it."""
    with file.open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield
