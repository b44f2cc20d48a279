"""The complete state of an optimisation, as a value and as bytes."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from morphcore.checkpoint import pack, unpack
from morphcore.optimise.descent import DescentState
from morphcore.optimise.ease import EaseState
from morphcore.optimise.goals import Found, Task
from morphcore.optimise.search import SearchState
from morphcore.swarm import SwarmState

Array = NDArray[np.float64]
Phase = Literal["search", "verify", "done"]

VERSION = "optimise 1"  # of the checkpoint; a worker refuses one that it does not know


@dataclass(frozen=True)
class Verified:
    """One schedule's flight in the flexible model.

    euler : (k, 3) rad at the rows of the window; none where the flight failed, as ``failure`` says.
    warnings : of the flight, as documents.
    """

    schedule: str
    euler: Array
    wall_s: float
    failure: str = ""
    warnings: tuple[dict[str, Any], ...] = ()


@dataclass(frozen=True)
class OptimisationState:
    """An optimisation between two steps.

    phase : what comes next. task, search : the search that runs. found : those that are done. verified :
    flights of the flexible model that are done. history : one row for each step of a search. search_s : wall
    time of the searches, s; wall_s : of everything. step_s : of the flights, once it is chosen.
    """

    phase: Phase
    task: Task | None = None
    search: SearchState | None = None
    found: tuple[Found, ...] = ()
    verified: tuple[Verified, ...] = ()
    generation: int = 0
    flights: int = 0
    search_s: float = 0.0
    wall_s: float = 0.0
    history: tuple[dict[str, Any], ...] = field(default=(), repr=False)
    step_s: float | None = None


def encode(state: OptimisationState) -> bytes:
    """The state as bytes."""
    return pack(state, VERSION)


def decode(checkpoint: bytes) -> OptimisationState:
    """The state that ``encode`` wrote.

    Raises
    ------
    UnreadableCheckpoint : the bytes are damaged or of another version.
    """
    return unpack(checkpoint, VERSION, _state)


def _state(tree: dict[str, Any]) -> OptimisationState:
    task, search = tree.pop("task"), tree.pop("search")
    return OptimisationState(
        task=None if task is None else Task(**task),
        search=None if search is None else _search(search),
        found=tuple(Found(**item) for item in tree.pop("found")),
        verified=tuple(
            Verified(**item | {"warnings": tuple(item.get("warnings", ()))}) for item in tree.pop("verified")
        ),
        history=tuple(tree.pop("history")),
        **tree,
    )


def _search(tree: dict[str, Any]) -> SearchState:
    swarm, descent, ease = tree.pop("swarm"), tree.pop("descent"), tree.pop("ease")
    if swarm is not None:
        swarm = SwarmState(**swarm | {"random": tuple(swarm["random"])})
    return SearchState(
        **tree,
        swarm=swarm,
        descent=None if descent is None else DescentState(**descent),
        ease=None if ease is None else EaseState(**ease),
    )
