"""Ctrl-C as a question that work asks, not as an exception from anywhere."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


class Interrupt:
    """Whether Ctrl-C was pressed."""

    def __init__(self) -> None:
        self.seen = False

    def __call__(self) -> bool:
        """Ask."""
        return self.seen


@contextmanager
def first_interrupt() -> Iterator[Interrupt]:
    """Note the first Ctrl-C instead of dying of it; the second one kills as ever.

    Python's own exception may come while the compiler calls back to have a kernel loaded, and is lost there.
    """
    interrupt = Interrupt()
    before = signal.getsignal(signal.SIGINT)

    def note(_number: int, _frame: FrameType | None) -> None:
        interrupt.seen = True
        signal.signal(signal.SIGINT, before)

    signal.signal(signal.SIGINT, note)
    try:
        yield interrupt
    finally:
        signal.signal(signal.SIGINT, before)
