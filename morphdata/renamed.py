"""Renamed fields: documents accept the old spelling, and results contain both throughout version 0.2.

A parameter's name may have parts, ``right.stiffness_nm_rad.joint_1.edgewise``: the last one is looked up.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

RENAMED = {"centre_shift_m": "ac_offset_m", "ei_lag_n_m2": "ei_edge_n_m2", "lag": "edgewise"}
FORMER = {new: old for old, new in RENAMED.items()}
FORMER_NOTE = "Former name of `{name}`, accepted and written throughout version 0.2."


def current_name(name: str) -> str:
    """Return the current spelling of a field's or parameter's name.

    >>> current_name("stiffness_nm_rad.joint_1.lag")
    'stiffness_nm_rad.joint_1.edgewise'
    """
    return _with_last_part(name, RENAMED)


def former_name(name: str) -> str:
    """Return the old spelling of a name, or the name itself if it has none.

    >>> former_name("ac_offset_m"), former_name("profile_drag")
    ('centre_shift_m', 'profile_drag')
    """
    return _with_last_part(name, FORMER)


def current_names(names: Iterable[str]) -> list[str]:
    """Return each name once, in its current spelling.

    >>> current_names(["ac_offset_m", "lag_s", "centre_shift_m"])
    ['ac_offset_m', 'lag_s']
    """
    return list(dict.fromkeys(map(current_name, names)))


def both_spellings(names: Iterable[str]) -> list[str]:
    """Return the names of a result's list, followed by the old spellings of those that have one.

    >>> both_spellings(["ac_offset_m", "lag_s"])
    ['ac_offset_m', 'lag_s', 'centre_shift_m']
    """
    given = list(names)
    return list(dict.fromkeys([*given, *map(former_name, given)]))


def under_both_spellings(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return a result's object with current names, followed by the renamed entries under their old names.

    >>> under_both_spellings({"ac_offset_m": 0.002, "lag_s": 0.004})
    {'ac_offset_m': 0.002, 'lag_s': 0.004, 'centre_shift_m': 0.002}
    """
    current = {current_name(name): value for name, value in values.items()}
    return {**current, **{former_name(name): value for name, value in current.items()}}


def sent_name(name: str, document: Mapping[str, Any]) -> str:
    """Return the spelling of a field's name that a document uses."""
    former = former_name(name)
    return former if name not in document and former in document else name


def _with_last_part(name: str, table: Mapping[str, str]) -> str:
    *prefix, last = name.split(".")
    return ".".join([*prefix, table.get(last, last)])
