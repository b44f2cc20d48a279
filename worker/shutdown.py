"""Inform the pool's children of a requested shutdown.

Only the parent process receives SIGTERM; its children continue until their task ends, perhaps in an hour.
They inherit the reading end of a pipe; one byte in it, which is never read out, is the message to all of
them. A pipe has no name that others could use, and writing to it takes no lock in a signal handler.
"""

from __future__ import annotations

import contextlib
import os
import select

_ends: list[int] = []  # reading, writing; empty: not armed


def arm() -> None:
    """Make the pipe, in the parent, before it forks its pool."""
    disarm()
    _ends.extend(os.pipe())


def announce() -> None:
    """Write the byte for the children (called in a signal handler)."""
    with contextlib.suppress(OSError):
        for writing in _ends[1:]:
            os.write(writing, b"!")


def disarm() -> None:
    """Close the pipe once the pool has ended."""
    while _ends:
        os.close(_ends.pop())


def announced() -> bool:
    """Whether a shutdown was requested (called in a child)."""
    return any(select.select(_ends[:1], (), (), 0.0)[0]) if _ends else False
