"""Long work that is asked to stop: by an argument, or by whoever runs the calls that take none."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

Stop = Callable[[], bool]


class Interrupted(Exception):
    """The caller's ``stop`` said so between two chunks."""


_surrounding: ContextVar[Stop | None] = ContextVar("stop", default=None)


@contextmanager
def stoppable(stop: Stop) -> Iterator[None]:
    """Let every flight and every picture of the block ask `stop`, in this thread.

    Results and plots are made by plain functions; made for many samples they take longer than somebody who
    cancels should wait.
    """
    token = _surrounding.set(stop)
    try:
        yield
    finally:
        _surrounding.reset(token)


def heed(stop: Stop | None = None) -> None:
    """Ask whether to go on.

    Raises
    ------
    Interrupted : `stop` or the surrounding block says no.
    """
    surrounding = _surrounding.get()
    if (stop is not None and stop()) or (surrounding is not None and surrounding()):
        raise Interrupted


def one_at_a_time(stop: Stop | None = None) -> Stop:
    """What `heed` asks here, as one question for several threads, which ask it in turn."""
    lock, surrounding = threading.Lock(), _surrounding.get()

    def ask() -> bool:
        with lock:
            return (stop is not None and stop()) or (surrounding is not None and surrounding())

    return ask
