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
        return rated(step, now - begun_at, flights_before if counted else None, fraction_before)


def rated(step: Step, elapsed_s: float, flights_before: float | None, fraction_before: float) -> Document:
    """Give a step's progress with its rates since an earlier moment.

    Parameters
    ----------
    elapsed_s : since then.
    flights_before : flown by then, None for work that counts no flights.
    fraction_before : done by then, 0..1.
    """
    flights, fraction = float(step.progress.get("flights", 0)), float(step.progress.get("fraction", 0.0))
    timed, done = elapsed_s > 0.0 and flights_before is not None, fraction - fraction_before
    return {
        **step.progress,
        "flights_per_s": (flights - (flights_before or 0.0)) / elapsed_s if timed else None,
        "eta_s": elapsed_s * (1.0 - fraction) / done if done > 0.0 else None,
    }
