"""The progress report of one step of long work."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Step:
    """One completed step of a search, a study or an optimisation.

    Attributes
    ----------
    phase : kind of work done by the step.
    generation : number of steps so far.
    fraction : completed share of the whole work, 0..1.
    best_cost : minimum J so far of the latest search, rad^2.
    flights : number flown so far, one per parameter set and sample, or per schedule.
    message : human-readable.
    checkpoint : complete state; ``steps(checkpoint)`` continues to the bit-identical result.
    """

    phase: str
    generation: int
    fraction: float
    best_cost: float
    flights: int
    message: str
    checkpoint: bytes
