"""Room kept for what must be written even on a full disk: the cancel of a job, a deletion, an end."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable
from pathlib import Path

RESERVE_BYTES = 8 * 2**20
SLICE_BYTES = 2**17  # what one such write may need: some twenty pages in the journal
STEP_BYTES = 2**14  # in which what was not needed is taken back
SHARE = 8  # of a small disk's free room only such a part is kept
SUFFIX = "-reserve"


class Reserve:
    """A file next to an SQLite database whose blocks are given to the database when the disk has no others.

    Writes that may wait never get them, so a disk that is full for them is not full for a cancel. Any number
    of processes may lend and fill at once: each step leaves a file that is merely shorter or longer.

    Parameters
    ----------
    database : Path
        The database's file.
    size_bytes : int
        Kept when there is ample room.
    """

    def __init__(self, database: Path, size_bytes: int = RESERVE_BYTES) -> None:
        self.path = database.with_name(database.name + SUFFIX)
        self._size_bytes = size_bytes

    def fill(self) -> None:
        """Take back what is missing, as far as there is room; silent where there is none."""
        self._grow(lambda held, room: min(self._size_bytes, (room + held) // SHARE), SLICE_BYTES, os.O_CREAT)

    def take_back(self) -> None:
        """Take back what is left of a slice, before somebody else's write finds it."""
        self._grow(lambda held, _room: min(held + SLICE_BYTES, self._size_bytes), STEP_BYTES)

    def _grow(self, size: Callable[[int, int], int], step: int, flags: int = 0) -> None:
        """Grow in steps to a size that follows from the present one and the disk's free room, bytes."""
        with contextlib.suppress(OSError):
            descriptor = os.open(self.path, os.O_RDWR | os.O_CLOEXEC | flags, 0o600)
            try:
                held = os.fstat(descriptor).st_size
                disk = os.fstatvfs(descriptor)
                wanted = size(held, disk.f_bavail * disk.f_frsize)
                while held < wanted:
                    held += _add_blocks(descriptor, held, min(step, wanted - held))
            finally:
                os.close(descriptor)

    def lend(self) -> bool:
        """Give a slice to whoever writes next; False when nothing is left."""
        with contextlib.suppress(OSError):
            held = self.path.stat().st_size
            if held > 0:
                os.truncate(self.path, max(held - SLICE_BYTES, 0))
                return True
        return False


def _add_blocks(descriptor: int, held: int, by: int) -> int:
    """Add blocks that are really there: a hole in a file keeps no room."""
    if hasattr(os, "posix_fallocate"):
        os.posix_fallocate(descriptor, held, by)
        return by
    return os.pwrite(descriptor, os.urandom(by), held)
