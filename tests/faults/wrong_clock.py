"""A process whose clock is wrong: `time.time` and `datetime.now` for everything imported in it."""

from __future__ import annotations

import datetime as dt
import os
import sys
import time
from typing import Any

CLIENTS = ("celery", "kombu", "billiard", "app.", "worker")
VARIABLE = "MORPHID_TEST_CLOCK_S"
_right_time = time.time
_right_time_ns = time.time_ns
_right_datetime = dt.datetime


def _error_s() -> float:
    return float(os.environ.get(VARIABLE, "0"))


class _WrongDatetime(_right_datetime):
    @classmethod
    def now(cls, tz: dt.tzinfo | None = None) -> Any:
        return _right_datetime.now(tz) + dt.timedelta(seconds=_error_s())

    @classmethod
    def utcnow(cls) -> Any:
        return _right_datetime.now(dt.UTC).replace(tzinfo=None) + dt.timedelta(seconds=_error_s())


def set_from_environment() -> None:
    """Put the clock wrong, also for modules that took `datetime` or `time` by name."""
    if not _error_s():
        return
    time.time = lambda: _right_time() + _error_s()
    time.time_ns = lambda: _right_time_ns() + int(1e9 * _error_s())
    for name, module in list(sys.modules.items()):
        if name.startswith(CLIENTS):
            for attribute, right, wrong in (
                ("datetime", _right_datetime, _WrongDatetime),
                ("time", _right_time, time.time),
            ):
                if getattr(module, attribute, None) is right:
                    setattr(module, attribute, wrong)
