"""The complete state of a study, as a value and as bytes."""

from __future__ import annotations

import base64
import json
from dataclasses import dataclass
from typing import Literal

from morphcore.identify.state import UnreadableCheckpoint
from morphcore.identify.study_row import StudyRow

Phase = Literal["search", "result", "timing", "done"]

FORMAT = 1  # of the checkpoint; a worker refuses one that it does not know


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
    rounds: tuple[tuple[float, ...], ...] = ()
    plan_s: float | None = None
    generation: int = 0
    flights: int = 0
    wall_s: float = 0.0


def encode(state: StudyState) -> bytes:
    """The state as bytes; numbers are written so that they come back exactly."""
    header = {
        **vars(state),
        "format": FORMAT,
        "rows": [row.to_document() for row in state.rows],
        "search": None if state.search is None else base64.b64encode(state.search).decode("ascii"),
    }
    return json.dumps(header).encode()


def decode(checkpoint: bytes, links: tuple[int, ...]) -> StudyState:
    """The state that ``encode`` wrote for a study of these numbers of links.

    Raises
    ------
    UnreadableCheckpoint : the bytes are damaged, of another version, or of another study.
    """
    try:
        header = json.loads(checkpoint)
        if header.pop("format") != FORMAT:
            raise UnreadableCheckpoint("the checkpoint is of another version", hint="start the study anew")
        header["links"] = tuple(header["links"])
        header["rows"] = tuple(StudyRow(**row) for row in header["rows"])
        header["rounds"] = tuple(tuple(times) for times in header["rounds"])
        if header["search"] is not None:
            header["search"] = base64.b64decode(header["search"], validate=True)
        state = StudyState(**header)
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise UnreadableCheckpoint(
            f"the checkpoint cannot be read: {error}", hint="start the study anew"
        ) from None
    if state.links != links:
        raise UnreadableCheckpoint(
            f"the checkpoint is of a study of {list(state.links)} links, not {list(links)}",
            hint="give the request that the study was begun with",
        )
    return state
