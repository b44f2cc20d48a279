"""Waiting for what another thread or process will have done soon."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")


def until(
    wanted: Callable[[], T],
    within_s: float = 20.0,
    every_s: float = 0.02,
    *,
    seen: Callable[[], object] = str,
) -> T:
    """Poll until the result is true and return it; fail with what is ``seen`` instead."""
    deadline = time.monotonic() + within_s
    while not (answer := wanted()):
        assert time.monotonic() < deadline, f"not within {within_s:g} s: {seen()}"
        time.sleep(every_s)
    return answer
