"""How long the walk is that stands for a flight.

Apart from the worker's module, whose import replaces what this process can do.
"""

from __future__ import annotations

STEPS_PER_S = 10  # of a flight's duration: sets the length of a walk in a request


def flight_steps(duration_s: float) -> int:
    """Steps of the walk that stands for a flight of this duration."""
    return round(STEPS_PER_S * duration_s)
