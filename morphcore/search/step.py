"""What long work shows of each of its steps."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Step:
    """What one step of a search, a study or an optimisation leaves.

    Attributes
    ----------
    phase : what the step did.
    generation : steps so far.
    fraction : of the whole work, 0..1.
    best_cost : least J so far of the search that ran last, rad^2.
    flights : flown so far, one per parameter set and sample, or per schedule.
    message : for people.
    checkpoint : complete state; ``steps(checkpoint)`` goes on to the bit-identical result.
    """

    phase: str
    generation: int
    fraction: float
    best_cost: float
    flights: int
    message: str
    checkpoint: bytes
