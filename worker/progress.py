"""Rate and remaining time of work."""

from __future__ import annotations

from collections.abc import Callable

from worker.operations import Document, Step


class Pace:
    """Adds rate and remaining time to progress; the flights of earlier attempts do not count.

    ``clock`` returns monotonic seconds.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._first: tuple[float, Document] | None = None  # time and progress at the first step

    def progress(self, step: Step) -> Document:
        """Return a step's progress with ``flights_per_s`` and ``eta_s``; None while unknown."""
        now = self._clock()
        self._first = self._first or (now, step.progress)
        return rated(step.progress, now - self._first[0], self._first[1])


def rated(progress: Document, elapsed_s: float, before: Document) -> Document:
    """Return progress with its rates since ``before``, the progress `elapsed_s` ago."""
    fraction, flown = progress.get("fraction", 0.0), before.get("flights")
    done = fraction - (before.get("fraction") or 0.0)
    timed = elapsed_s > 0.0 and flown is not None  # work that counts no flights has no rate
    return {
        **progress,
        "flights_per_s": (progress.get("flights", 0) - flown) / elapsed_s if timed else None,
        "eta_s": elapsed_s * (1.0 - fraction) / done if done > 0.0 else None,
    }
