"""The complete state of a search, as a value and as bytes."""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import dataclass, field, fields
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from morphcore.errors import MorphError
from morphcore.identify.polish import PolishState
from morphcore.identify.swarm import SwarmState

Array = NDArray[np.float64]
Phase = Literal["baseline", "screen", "swarm", "polish", "done"]

FORMAT = 1  # of the checkpoint; a worker refuses one that it does not know


class UnreadableCheckpoint(MorphError):
    """A checkpoint is damaged or was written by another version."""

    code = "unreadable_checkpoint"


@dataclass(frozen=True)
class SearchState:
    """A search between two steps.

    phase : what comes next. best : (d,) search point with the least J so far. history : one row per
    generation.
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


def encode(state: SearchState) -> bytes:
    """The state as bytes: JSON for the small, arrays exactly as they are."""
    arrays: dict[str, Array] = {"best": state.best}
    header: dict[str, Any] = {
        "format": FORMAT,
        **{
            name: getattr(state, name)
            for name in ("phase", "best_cost", "generation", "flights", "wall_s", "history")
        },
    }
    for name, part in (("swarm", state.swarm), ("polish", state.polish)):
        if part is None:
            continue
        header[name] = {}
        for item in fields(part):
            value = getattr(part, item.name)
            if isinstance(value, np.ndarray):
                arrays[f"{name}.{item.name}"] = value
            elif (
                item.name == "random"
            ):  # numpy's legacy generator: name, key vector, position, cached normal deviate
                arrays[f"{name}.random"] = value[1]
                header[name]["random"] = [value[0], *value[2:]]
            else:
                header[name][item.name] = value
    out = io.BytesIO()
    np.savez(out, header=np.frombuffer(json.dumps(header).encode(), dtype=np.uint8), **arrays)  # type: ignore[arg-type]
    return out.getvalue()


def decode(checkpoint: bytes) -> SearchState:
    """The state that ``encode`` wrote.

    Raises
    ------
    UnreadableCheckpoint : the bytes are damaged or of another version.
    """
    try:
        with np.load(io.BytesIO(checkpoint), allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
        header = json.loads(arrays.pop("header").tobytes())
        known = header.pop("format") == FORMAT
    except (ValueError, KeyError, OSError, EOFError, zipfile.BadZipFile) as error:
        raise UnreadableCheckpoint(
            f"the checkpoint cannot be read: {error}", hint="start the identification anew"
        ) from None
    if not known:
        raise UnreadableCheckpoint(
            "the checkpoint is of another version", hint="start the identification anew"
        )
    swarm, polish = header.pop("swarm", None), header.pop("polish", None)
    if swarm is not None:
        random = swarm.pop("random")
        swarm = SwarmState(
            **swarm, **_part(arrays, "swarm"), random=(random[0], arrays["swarm.random"], *random[1:])
        )
    if polish is not None:
        polish = PolishState(**polish, **_part(arrays, "polish"))
    history = tuple(header.pop("history"))
    return SearchState(**header, best=arrays["best"], history=history, swarm=swarm, polish=polish)


def _part(arrays: dict[str, Array], name: str) -> dict[str, Any]:
    prefix = f"{name}."
    return {
        key.removeprefix(prefix): value
        for key, value in arrays.items()
        if key.startswith(prefix) and key != f"{prefix}random"
    }
