"""The complete state of a study, as a value and as bytes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from morphcore.checkpoint import UnreadableCheckpoint, pack, unpack
from morphcore.identify.study_row import StudyRow

Phase = Literal["search", "result", "timing", "done"]

VERSION = "study 1"  # of the checkpoint; a worker refuses one that it does not know


@dataclass(frozen=True)
class StudyState:
    """A study between two steps.

    phase : what comes next: a step of the running identification, its result, a round of timing. links : the
    numbers of links studied, in their order. rows : of those that are done. search : checkpoint of the
    identification that runs. share : how far that is, 0..1. budget_s : its part of the time, s.
    rounds : wall time of one flight of the rigid model and of each number of links, s, for each round.
    generation, flights : of all identifications together. wall_s : s.
    """

    phase: Phase
    links: tuple[int, ...]
    rows: tuple[StudyRow, ...] = ()
    search: bytes | None = None
    share: float = 0.0
    best_cost: float = 0.0
    budget_s: float | None = None
    rounds: tuple[tuple[float | None, ...], ...] = ()
    plan_s: float | None = None
    generation: int = 0
    flights: int = 0
    wall_s: float = 0.0


def encode(state: StudyState) -> bytes:
    """The state as bytes."""
    search = None if state.search is None else np.frombuffer(state.search, dtype=np.uint8)
    return pack({**vars(state), "search": search}, VERSION)


def decode(checkpoint: bytes, links: tuple[int, ...]) -> StudyState:
    """The state that ``encode`` wrote for a study of these numbers of links.

    Raises
    ------
    UnreadableCheckpoint : the bytes are damaged, of another version, or of another study.
    """
    state = unpack(checkpoint, VERSION, _state)
    if state.links != links:
        raise UnreadableCheckpoint(
            f"the checkpoint is of a study of {list(state.links)} links, not {list(links)}",
            hint="give the request that the study was begun with",
        )
    return state


def _state(tree: dict[str, Any]) -> StudyState:
    """The state out of its tree, in which tuples have become lists and rows dicts."""
    search = tree.pop("search")
    return StudyState(
        **{
            **tree,
            "links": tuple(tree["links"]),
            "rows": tuple(StudyRow(**row) for row in tree["rows"]),
            "search": None if search is None else search.tobytes(),
            "rounds": tuple(tuple(times) for times in tree["rounds"]),
        }
    )
