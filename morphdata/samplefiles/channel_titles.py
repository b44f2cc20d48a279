"""Titles of the columns of channels: ``p``, ``q_deg_s``, ``Tip_right_z [mm]``, ``airspeed (kt)``."""

from __future__ import annotations

import re

from morphdata.channels import ChannelFacts, channel_of
from morphdata.samplefiles.units import (
    ACCELERATION_UNITS,
    ANGLE_UNITS,
    FORCE_UNITS,
    LENGTH_UNITS,
    RATE_UNITS,
    SPEED_UNITS,
    TORQUE_UNITS,
    UNIT_IN_BRACKETS,
    plain,
    unit_pattern,
)

FACTORS = {  # SI unit of a channel -> units that its columns may be in, and the factors to SI
    "rad/s": RATE_UNITS,
    "rad": ANGLE_UNITS,
    "m/s": SPEED_UNITS,
    "m": LENGTH_UNITS,
    "m/s^2": ACCELERATION_UNITS,
    "N m": TORQUE_UNITS,
    "N": FORCE_UNITS,
    "1": {"1": 1.0, "-": 1.0, "g": 1.0},
}
PATTERNS = {unit: unit_pattern(factors) for unit, factors in FACTORS.items()}


def channel_meant(title: str) -> tuple[str, float | None] | None:
    """The column of a channel that a title means and its factor to SI, None where it names no unit.

    >>> channel_meant("q_deg_s"), channel_meant("Tip_right_z [mm]"), channel_meant("fold_left")
    (('q', 0.017453292519943295), ('tip_right_z', 0.001), None)
    """
    whole = plain(title)
    # the unit first: `tip_z_wing_mm` is the column of the surface `wing`
    for unit, pattern in PATTERNS.items():
        match = pattern.fullmatch(whole)
        facts = None if match is None else channel_of(_base(match))
        if match is not None and facts is not None and facts.unit == unit:
            return _base(match), FACTORS[unit][match["unit"]]
    return (whole, None) if channel_of(whole) is not None else None


def channel_in_brackets(title: str) -> ChannelFacts | None:
    """The channel that a title means whose unit in brackets is none that is read; None for all others."""
    match = UNIT_IN_BRACKETS.fullmatch(plain(title))
    return None if match is None or channel_meant(title) is not None else channel_of(_base(match))


def channel_unit_factor(column: str, unit: str) -> float | None:
    """The factor to SI of a unit of a channel's column, in brackets or not; None for one that is not read."""
    facts = channel_of(column)
    bare = plain(unit).strip("[](){}<>_")
    return None if facts is None else FACTORS[facts.unit].get(bare)


def channel_units(column: str) -> str:
    """The units that a channel's column may be in, for people."""
    facts = channel_of(column)
    return "give SI units" if facts is None else f"give {', '.join(list(FACTORS[facts.unit])[:4])}"


def _base(match: re.Match[str]) -> str:
    return match["name"].rstrip("_")
