"""How fast work goes and when it may end."""

from __future__ import annotations

from collections.abc import Iterator

from worker.operations import Step
from worker.progress import Pace


def ticking() -> Iterator[float]:
    """Give 0, 10, 20 seconds and so on."""
    now = 0.0
    while True:
        yield now
        now += 10.0


def test_rate_and_remaining_time_are_those_of_this_attempt() -> None:
    """Resumed at a half, 100 flights and 10 s later at three quarters: 10 a second, 10 s to go."""
    pace = Pace(ticking().__next__)
    first = pace.progress(Step({"fraction": 0.5, "flights": 500}, b"x"))
    assert (first["flights_per_s"], first["eta_s"]) == (None, None)
    second = pace.progress(Step({"fraction": 0.75, "flights": 600}, b"x"))
    assert (second["flights_per_s"], second["eta_s"]) == (10.0, 10.0)


def test_work_without_flights_has_no_rate() -> None:
    """A single flight counts none: its remaining time is shown, but not a rate of zero."""
    pace = Pace(ticking().__next__)
    pace.progress(Step({"fraction": 0.0}, b""))
    second = pace.progress(Step({"fraction": 0.5}, b""))
    assert (second["flights_per_s"], second["eta_s"]) == (None, 10.0)
