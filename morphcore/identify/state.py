"""The complete state of a search, as a value and as bytes."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from morphcore.checkpoint import pack, unpack
from morphcore.evolution import EvolutionState
from morphcore.identify.polish import PolishState
from morphcore.swarm import SwarmState

Array = NDArray[np.float64]
Phase = Literal["baseline", "screen", "swarm", "evolution", "polish", "done"]

VERSION = "identification 3"  # of the checkpoint; a worker refuses one that it does not know


@dataclass(frozen=True)
class SearchState:
    """A search between two steps.

    phase : what comes next. best : (d,) search point with the least J so far. history : one row per
    generation. screened : whether candidates away from the physical guess were flown. step_s : of all
    flights; one that was chosen when the time was up follows from the inputs no more.
    """

    phase: Phase
    best: Array
    best_cost: float
    generation: int = 0
    flights: int = 0
    wall_s: float = 0.0
    history: tuple[dict[str, Any], ...] = ()
    swarm: SwarmState | None = field(default=None, repr=False)
    polish: PolishState | None = field(default=None, repr=False)
    evolution: EvolutionState | None = field(default=None, repr=False)
    screened: bool = False
    step_s: float | None = None


def encode(state: SearchState) -> bytes:
    """The state as bytes, exactly as it is."""
    return pack(state, VERSION)


def decode(checkpoint: bytes) -> SearchState:
    """The state that ``encode`` wrote.

    Raises
    ------
    UnreadableCheckpoint : the bytes are damaged or of another version.
    """
    return unpack(checkpoint, VERSION, _state)


def _state(tree: dict[str, Any]) -> SearchState:
    swarm, polish, evolution = tree.pop("swarm"), tree.pop("polish"), tree.pop("evolution")
    if swarm is not None:
        swarm = SwarmState(**{**swarm, "random": tuple(swarm["random"])})
    return SearchState(
        **{**tree, "history": tuple(tree["history"])},
        swarm=swarm,
        polish=None if polish is None else PolishState(**polish),
        evolution=None if evolution is None else EvolutionState(**evolution),
    )
