"""Let the pool's children know that the worker is asked to end.

Celery tells only the parent process about SIGTERM; its children go on until their task ends, maybe in an
hour. A file whose name they inherit works for forked and for spawned children, and takes no lock in a
signal handler.
"""

from __future__ import annotations

import contextlib
import os
import tempfile
from pathlib import Path

VARIABLE = "MORPHID_STOP_FILE"


def arm() -> Path:
    """Choose the file, in the parent, before it starts its pool."""
    path = Path(tempfile.gettempdir()) / f"morphid-stop-{os.getuid()}-{os.getpid()}"
    path.unlink(missing_ok=True)
    os.environ[VARIABLE] = str(path)
    return path


def announce() -> None:
    """Tell the children (called in a signal handler)."""
    with contextlib.suppress(OSError, KeyError):
        Path(os.environ[VARIABLE]).touch()


def disarm() -> None:
    """Remove the file once the pool has ended."""
    with contextlib.suppress(OSError, KeyError):
        Path(os.environ[VARIABLE]).unlink(missing_ok=True)


def announced() -> bool:
    """Whether the worker is asked to end (called in a child)."""
    name = os.environ.get(VARIABLE)
    return name is not None and Path(name).exists()
