"""Times of many calls, in numbers that are printed and judged."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class Times:
    """Percentiles of some times, ms."""

    count: int
    p50_ms: float
    p95_ms: float
    worst_ms: float

    @classmethod
    def of(cls, times_s: Iterable[float]) -> Times:
        """Sum up times in s."""
        ordered = sorted(1e3 * time_s for time_s in times_s)
        return cls(
            len(ordered), statistics.median(ordered), ordered[int(0.95 * (len(ordered) - 1))], ordered[-1]
        )

    def __str__(self) -> str:
        return (
            f"p50 {self.p50_ms:6.1f} ms, p95 {self.p95_ms:6.1f} ms, worst {self.worst_ms:6.1f} ms "
            f"of {self.count}"
        )


def timed(call: Callable[[], object]) -> float:
    """How long a call takes, s."""
    begun = time.perf_counter()
    call()
    return time.perf_counter() - begun
