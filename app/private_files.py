"""Files with secrets, private from their first byte: mode 0600 in folders of mode 0700."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import IO

PRIVATE_FILE = 0o600
PRIVATE_FOLDER = 0o700
PRIVATE_UMASK = 0o077  # umask of processes that write such files by other means
OTHERS = 0o077


def make_private_folder(path: Path) -> None:
    """Make a folder and its missing parents, for this user only."""
    if not path.is_dir():
        make_private_folder(path.parent)
        path.mkdir(mode=PRIVATE_FOLDER, exist_ok=True)


def touch_private(path: Path) -> None:
    """Make an empty file for this user only, or remove other users' access to an existing one.

    An existing file is not opened: closing an SQLite file drops all locks that this process has on it, and
    another process would consider itself the last one and delete the journal (sqlite.org/howtocorrupt.html).
    """
    try:
        os.close(os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, PRIVATE_FILE))
    except FileExistsError:
        close_to_others(path)


def open_private(path: Path, mode: str) -> IO[str]:
    """Open a text file for writing (``w``) or appending (``a``) as `touch_private` makes it."""
    return open(path, mode, encoding="utf-8", opener=lambda name, flags: _opened(Path(name), flags))


def close_to_others(path: Path) -> bool:
    """Remove other users' access to a file or folder; return whether they had any."""
    found = path.stat()
    if not found.st_mode & OTHERS or found.st_uid != os.geteuid():
        return False
    path.chmod(stat.S_IMODE(found.st_mode) & ~OTHERS)
    return True


def _opened(path: Path, flags: int) -> int:
    descriptor = os.open(path, flags | os.O_CREAT | os.O_CLOEXEC, PRIVATE_FILE)
    found = os.fstat(descriptor)
    if found.st_mode & OTHERS and stat.S_ISREG(found.st_mode) and found.st_uid == os.geteuid():
        os.fchmod(descriptor, stat.S_IMODE(found.st_mode) & ~OTHERS)  # an earlier version made it
    return descriptor
