"""Disk space reserved for writes that must succeed even on a full disk: cancelling, deleting, ending jobs."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable
from pathlib import Path

RESERVE_BYTES = 8 * 2**20
SLICE_BYTES = 2**17  # space for one such write: some twenty pages in the journal
STEP_BYTES = 2**14  # s after which unused space is taken back
SHARE = 8  # share of the free space that is reserved on a small disk
SUFFIX = "-reserve"


class Reserve:
    """A file next to an SQLite database whose blocks are given to the database when the disk is full.

    Writes that can wait never get them, so a disk that is full for those is not full for cancelling. Any
    number of processes may lend and fill at once: each step only makes the file shorter or longer.

    Parameters
    ----------
    database : Path
        The database's file.
    size_bytes : int
        Reserved if there is ample space.
    """

    def __init__(self, database: Path, size_bytes: int = RESERVE_BYTES) -> None:
        self.path = database.with_name(database.name + SUFFIX)
        self._size_bytes = size_bytes

    def fill(self) -> None:
        """Refill the missing part as far as space allows, without errors."""
        self._grow(lambda held, room: min(self._size_bytes, (room + held) // SHARE), SLICE_BYTES, os.O_CREAT)

    def take_back(self) -> None:
        """Take back the unused part of a slice, before another write uses it."""
        self._grow(lambda held, _room: min(held + SLICE_BYTES, self._size_bytes), STEP_BYTES)

    def _grow(self, size: Callable[[int, int], int], step: int, flags: int = 0) -> None:
        """Grow in steps to a size determined from the present one and the disk's free space, bytes."""
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
        """Release a slice for the next write; False if nothing is left."""
        with contextlib.suppress(OSError):
            held = self.path.stat().st_size
            if held > 0:
                os.truncate(self.path, max(held - SLICE_BYTES, 0))
                return True
        return False


def _add_blocks(descriptor: int, held: int, by: int) -> int:
    """Add real blocks: a hole in a file reserves no space."""
    if hasattr(os, "posix_fallocate"):
        os.posix_fallocate(descriptor, held, by)
        return by
    return os.pwrite(descriptor, os.urandom(by), held)
