"""How fast the work goes and when it may end."""

from __future__ import annotations

from collections.abc import Callable

from worker.operations import Document, Step


class Pace:
    """Adds rate and remaining time to a step's progress.

    Only this attempt's flights count: a resumed job begins with those of its predecessors.

    Parameters
    ----------
    clock : seconds that only rise.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._first: tuple[float, float, float] | None = None  # time s, flights, fraction

    def progress(self, step: Step) -> Document:
        """Give the step's progress with ``flights_per_s`` and ``eta_s`` (None while unknown).

        Work that counts no flights has no rate.
        """
        now = self._clock()
        counted = "flights" in step.progress
        flights = float(step.progress.get("flights", 0))
        fraction = float(step.progress.get("fraction", 0.0))
        if self._first is None:
            self._first = (now, flights, fraction)
        begun_at, flights_before, fraction_before = self._first
        elapsed_s, done = now - begun_at, fraction - fraction_before
        return {
            **step.progress,
            "flights_per_s": (flights - flights_before) / elapsed_s if counted and elapsed_s > 0.0 else None,
            "eta_s": elapsed_s * (1.0 - fraction) / done if done > 0.0 else None,
        }
