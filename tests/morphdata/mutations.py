"""Documents that are wrong in one to three places, drawn by hypothesis out of right ones."""

from __future__ import annotations

import copy
import math
from typing import Any

from hypothesis import strategies as st

Place = tuple[str | int, ...]

ODD: tuple[Any, ...] = (
    None, True, False, 0, -1, 1, 2, 0.5, 3.0, 3.5, 1e-12, 1e9, -1e9, 1e300, 10**30,
    "", "1.0", "auto", "hold", "ä\n", [], [0.0], [1.0, 2.0, 3.0], [[1.0]], {}, {"kind": "hold"},
)  # fmt: skip
FACTORS = (-1.0, 0.0, 1e-9, 1e-3, 0.1, 0.5, 1.001, 2.0, 10.0, 1e3, 1e6, 1e12)
EXTRA = (
    "chrod_m",
    "kind",
    "span_m",
    "name",
    "a/b~c",
    "role",
    "",
    "fold_left_rad",
    "sweep_deg",
    "x_rad",
    "p_rad_s",
    "qz",
    "frames",
)
# keys of schedules, and columns of drives: one in the place of another
DRIVE_KEYS = ("both", "left", "right", "sweep", "fold", "sweep_left", "fold_right", "elevator", "cant_left")
COLUMN_UNITS = ("_rad", "_deg", "_mrad", "")


def places(document: Any, here: Place = ()) -> list[Place]:
    """Every place in a document, the whole first."""
    inner = (
        document.items()
        if isinstance(document, dict)
        else enumerate(document)
        if isinstance(document, list)
        else ()
    )
    return [here, *(place for key, value in inner for place in places(value, (*here, key)))]


def at(document: Any, place: Place) -> Any:
    """The value at a place."""
    for key in place:
        document = document[key]
    return document


@st.composite
def mutated(draw: st.DrawFn, examples: tuple[dict[str, Any], ...]) -> dict[str, Any]:
    """Draw one of the examples with one to three changes."""
    document = copy.deepcopy(draw(st.sampled_from(examples)))
    for _ in range(draw(st.integers(1, 3))):
        every = places(document)
        if len(every) == 1:
            break
        _change(draw, document, draw(st.sampled_from(every[1:])))
    return document


def _change(draw: st.DrawFn, document: Any, place: Place) -> None:
    *before, key = place
    parent = at(document, tuple(before))
    value = parent[key]
    kind = draw(st.sampled_from(["drop", "retype", "perturb", "perturb", "extra", "swap", "twice", "rename"]))
    if kind == "drop":
        del parent[key]
    elif kind == "perturb" and isinstance(value, int | float) and not isinstance(value, bool):
        scaled = value * draw(st.sampled_from(FACTORS))
        parent[key] = scaled if abs(scaled) < math.inf else value  # JSON has no infinity
    elif kind == "extra" and isinstance(value, dict):
        value[draw(st.sampled_from([*EXTRA, *(name[::-1] for name in value)]))] = _odd(draw)
    elif kind == "swap":
        other = draw(st.sampled_from(list(parent) if isinstance(parent, dict) else range(len(parent))))
        parent[key], parent[other] = parent[other], value
    elif kind == "rename" and isinstance(parent, dict):
        unit = draw(st.sampled_from(COLUMN_UNITS)) if isinstance(value, list) else ""
        parent[draw(st.sampled_from(DRIVE_KEYS)) + unit] = parent.pop(key)
    elif kind == "twice" and isinstance(value, list):
        value.extend(copy.deepcopy(value))
    else:
        parent[key] = _odd(draw)


def _odd(draw: st.DrawFn) -> Any:
    return copy.deepcopy(draw(st.sampled_from(ODD)))  # further changes go into it
