"""The complete state of a study, as a value and as bytes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from morphcore.identify.study_row import StudyRow
from morphcore.search.checkpoint import UnreadableCheckpoint, pack, stored, unpack
from morphdata.links import LinksPerWing

Phase = Literal["search", "result", "timing", "done"]

VERSION = "study 5"  # of the checkpoint; another one is not read


@stored
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
    links: tuple[LinksPerWing, ...]
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
    """Return the state as bytes."""
    return pack(state, VERSION)


def decode(checkpoint: bytes, links: tuple[LinksPerWing, ...]) -> StudyState:
    """Return the state that `encode` wrote for a study of these numbers of links.

    Raises
    ------
    UnreadableCheckpoint : the bytes are damaged, of another version, or of another study.
    """
    state = unpack(checkpoint, VERSION, StudyState)
    if state.links != links:
        raise UnreadableCheckpoint(
            f"the checkpoint is of a study of {list(state.links)} links, not {list(links)}",
            hint="give the request that the study was begun with",
        )
    return state
