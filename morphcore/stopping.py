"""Stop requests to long work, by an argument or by the surrounding block, and its progress messages."""

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
    """A stop function that returns True when another one does, or when the time is up.

    Parameters
    ----------
    seconds : from now; None: no limit. stop : the other stop function. clock : monotonic, s.

    Attributes
    ----------
    passed : whether the time limit stopped the work.
    """

    def __init__(
        self, seconds: float | None, stop: Stop | None = None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._stop, self._clock = stop, clock
        self._end_s = math.inf if seconds is None else clock() + seconds
        self.passed = False

    def __call__(self) -> bool:
        """Return whether to stop."""
        if self._stop is not None and self._stop():
            return True
        self.passed = self.passed or self._clock() >= self._end_s
        return self.passed

    def before_it(self, work: Callable[[Stop], Value], otherwise: Value) -> Value:
        """Return the result of work if it finishes in time, otherwise another value.

        Raises
        ------
        Interrupted : the other stop function stopped the work.
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
    """Pass progress messages of the block's long work to `listener`, in this thread."""
    token = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(token)


def say(message: str) -> None:
    """Report to the listener what starts now, in a few words for a progress line."""
    listener = _listener.get()
    if listener is not None:
        listener(message)


_surrounding: ContextVar[Stop | None] = ContextVar("stop", default=None)


@contextmanager
def stoppable(stop: Stop) -> Iterator[None]:
    """Let every flight and every figure of the block check `stop`, in this thread.

    Results and plots are made by plain functions; for many samples they take longer than a user who cancels
    should wait.
    """
    token = _surrounding.set(stop)
    try:
        yield
    finally:
        _surrounding.reset(token)


def check_stop(stop: Stop | None = None) -> None:
    """Check whether to continue.

    Raises
    ------
    Interrupted : `stop` or the surrounding block requests a stop.
    """
    surrounding = _surrounding.get()
    if (stop is not None and stop()) or (surrounding is not None and surrounding()):
        raise Interrupted


def one_at_a_time(stop: Stop | None = None) -> Stop:
    """Return the stop functions that apply here as one, which several threads may call, one at a time."""
    lock, surrounding = threading.Lock(), _surrounding.get()

    def ask() -> bool:
        with lock:
            return (stop is not None and stop()) or (surrounding is not None and surrounding())

    return ask
