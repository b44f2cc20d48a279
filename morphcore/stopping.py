"""Long work that is asked to stop, by an argument or by whoever runs it, and that says what it is about."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar

from morphdata.faults import Interrupted

__all__ = ["Deadline", "Interrupted", "Stop", "check_stop", "listening", "one_at_a_time", "say", "stoppable"]

Stop = Callable[[], bool]
Value = TypeVar("Value")


class Deadline:
    """A question to stop that answers yes when somebody else does, or when the time is up.

    Parameters
    ----------
    seconds : from now; None: for ever. stop : of somebody else. clock : seconds that only rise.

    Attributes
    ----------
    passed : whether it was the time that stopped the work.
    """

    def __init__(
        self, seconds: float | None, stop: Stop | None = None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._stop, self._clock = stop, clock
        self._end_s = math.inf if seconds is None else clock() + seconds
        self.passed = False

    def __call__(self) -> bool:
        """Ask."""
        if self._stop is not None and self._stop():
            return True
        self.passed = self.passed or self._clock() >= self._end_s
        return self.passed

    def before_it(self, work: Callable[[Stop], Value], otherwise: Value) -> Value:
        """Return what work gives if it ends in time, else another value.

        Raises
        ------
        Interrupted : somebody else stopped the work.
        """
        try:
            return work(self)
        except Interrupted:
            if not self.passed:
                raise
            return otherwise


_listener: ContextVar[Callable[[str], None] | None] = ContextVar("listener", default=None)


@contextmanager
def listening(listener: Callable[[str], None]) -> Iterator[None]:
    """Let `listener` hear what long work of the block is about between its steps, in this thread."""
    token = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(token)


def say(message: str) -> None:
    """Tell whoever listens what begins now: a few words for a line of progress."""
    listener = _listener.get()
    if listener is not None:
        listener(message)


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


def check_stop(stop: Stop | None = None) -> None:
    """Ask whether to go on.

    Raises
    ------
    Interrupted : `stop` or the surrounding block says no.
    """
    surrounding = _surrounding.get()
    if (stop is not None and stop()) or (surrounding is not None and surrounding()):
        raise Interrupted


def one_at_a_time(stop: Stop | None = None) -> Stop:
    """What `check_stop` asks here, as one question for several threads, which ask it in turn."""
    lock, surrounding = threading.Lock(), _surrounding.get()

    def ask() -> bool:
        with lock:
            return (stop is not None and stop()) or (surrounding is not None and surrounding())

    return ask
