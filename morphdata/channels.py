"""The output channels of a flight for documents: names, units and meanings.

The computation of a channel is under the same name in ``morphcore/simulate/channels.py``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

PART = re.compile(r"[a-z0-9_]{1,200}")  # of a surface's or drive's name in a column
Per = Literal["", "surface", "strip", "drive", "point"]


@dataclass(frozen=True)
class ChannelFacts:
    """Facts about one channel.

    Attributes
    ----------
    name : str
        Name in requests, and of its column; if there are several columns, each is ``name_part``.
    unit : str
        Unit of its values, "1" if dimensionless; the suffix of names in JSON documents: ``alpha_rad``,
        ``nz``.
    description : str
        One-line description, with frame and sign.
    per : {"", "surface", "strip", "drive", "point"}
        Whether it has one column, or one for each surface, strip of a surface or drive. The column of the
        surface "right wing" is ``tip_z_right_wing``: its name in small letters and digits, underscores
        between (see `column_parts`); its strips are numbered from the root, ``section_cl_right_wing_1``. A
        channel of points has its own column for the reference point and one for each given point, ``fz_imu``.
    default : bool
        Whether a flight has it if no channels are requested.
    fitted : bool
        Whether an identification can fit it as a measured channel of sample flights. Position and horizontal
        velocity start anew with every simulated flight, and loads are no sensor's reading.
    needs_gravity : bool
        Whether it is a multiple of the weight and so undefined without gravity.
    side : {"", "left", "right"}
        The side whose first hinged surface it is of; an aircraft without one lacks it.
    """

    name: str
    unit: str
    description: str
    per: Per = ""
    default: bool = False
    fitted: bool = True
    needs_gravity: bool = False
    side: Literal["", "left", "right"] = ""


CHANNELS: list[ChannelFacts] = [
    ChannelFacts("p", "rad/s", "Roll rate, body axes.", default=True),
    ChannelFacts("q", "rad/s", "Pitch rate, body axes.", default=True),
    ChannelFacts("r", "rad/s", "Yaw rate, body axes.", default=True),
    ChannelFacts("vx", "m/s", "Velocity of the reference point, north.", default=True, fitted=False),
    ChannelFacts("vy", "m/s", "Velocity of the reference point, east.", default=True, fitted=False),
    ChannelFacts("vz", "m/s", "Velocity of the reference point, down.", default=True),
    ChannelFacts("x", "m", "Position of the reference point, north.", default=True, fitted=False),
    ChannelFacts("y", "m", "Position of the reference point, east.", default=True, fitted=False),
    ChannelFacts("z", "m", "Position of the reference point, down.", default=True, fitted=False),
    ChannelFacts(
        "tip_left_z",
        "m",
        "Tip of the first hinged left surface below its root, along z of the body axes.",
        default=True,
        side="left",
    ),
    ChannelFacts(
        "tip_right_z",
        "m",
        "Tip of the first hinged right surface below its root, along z of the body axes.",
        default=True,
        side="right",
    ),
    ChannelFacts(
        "alpha", "rad", "Angle of attack of the body relative to the air, wind subtracted: atan2(w, u)."
    ),
    ChannelFacts(
        "beta", "rad", "Sideslip relative to the air, wind subtracted: asin(v / V), air from the right."
    ),
    ChannelFacts("airspeed", "m/s", "Speed of the reference point relative to the air, wind subtracted."),
    ChannelFacts("fx", "m/s^2", "Specific force, body x (forward).", per="point"),
    ChannelFacts("fy", "m/s^2", "Specific force, body y (right).", per="point"),
    ChannelFacts("fz", "m/s^2", "Specific force, body z (down): -g at rest.", per="point"),
    ChannelFacts("nx", "1", "Load factor forward: fx / g.", per="point", needs_gravity=True),
    ChannelFacts("ny", "1", "Load factor to the right: fy / g.", per="point", needs_gravity=True),
    ChannelFacts(
        "nz", "1", "Load factor upward: -fz / g, +1 in level flight.", per="point", needs_gravity=True
    ),
    ChannelFacts("tip_z", "m", "Tip below its root along z of the body axes.", per="surface"),
    ChannelFacts("tip_twist", "rad", "Elastic twist of the tip against the root, nose up.", per="surface"),
    ChannelFacts(
        "hinge_torque",
        "N m",
        "Torque of the drive's motors, along its positive coordinate.",
        per="drive",
        fitted=False,
    ),
    ChannelFacts(
        "drive_force",
        "N",
        "Force of the motors of a drive that slides, along its extension.",
        per="drive",
        fitted=False,
    ),
    ChannelFacts(
        "root_shear",
        "N",
        "Force of the loads on the surface, upward along -z of its root's axes.",
        per="surface",
        fitted=False,
    ),
    ChannelFacts(
        "root_bending",
        "N m",
        "Moment of the loads on the surface about its root, that bends the tip up.",
        per="surface",
        fitted=False,
    ),
    ChannelFacts(
        "root_torsion",
        "N m",
        "Moment of the loads on the surface about its elastic axis, nose up.",
        per="surface",
        fitted=False,
    ),
    ChannelFacts(
        "surface_lift",
        "N",
        "Lift of the surface: force of the air across the flight path, upward in the plane of symmetry.",
        per="surface",
        fitted=False,
    ),
    ChannelFacts(
        "surface_drag",
        "N",
        "Drag of the surface: force of the air against the flight path.",
        per="surface",
        fitted=False,
    ),
    ChannelFacts(
        "surface_side_force",
        "N",
        "Side force of the surface: force of the air across the flight path, to the right.",
        per="surface",
        fitted=False,
    ),
    ChannelFacts(
        "section_lift",
        "N/m",
        "Lift per length of span of the strip, normal to its own motion.",
        per="strip",
        fitted=False,
    ),
    ChannelFacts(
        "section_cl", "1", "Lift coefficient of the strip, by its own speed.", per="strip", fitted=False
    ),
]


def channel_facts(name: str) -> ChannelFacts:
    """Find a channel by its name.

    Raises
    ------
    LookupError
        There is none of this name.
    """
    for each in CHANNELS:
        if each.name == name:
            return each
    raise LookupError(f"there is no channel {name!r}, only {', '.join(each.name for each in CHANNELS)}")


def default_channels() -> list[str]:
    """Names of the default channels of a flight."""
    return [each.name for each in CHANNELS if each.default]


def column_parts(names: Iterable[str]) -> list[str]:
    """Parts of column names for surfaces or drives: small letters, digits and underscores, all different.

    Examples
    --------
    >>> column_parts(["right wing", "Right-Wing", "V-tail"])
    ['right_wing', 'right_wing_2', 'v_tail']
    """
    found: list[str] = []
    for name in names:
        plain = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_") or "part"
        part, number = plain, 2
        while part in found:
            part, number = f"{plain}_{number}", number + 1
        found.append(part)
    return found


def document_name(column: str) -> str:
    """Name of a column in JSON documents, with its unit as suffix; columns of no channel keep their names.

    Examples
    --------
    >>> document_name("tip_z_right_wing"), document_name("nz"), document_name("stamp")
    ('tip_z_right_wing_m', 'nz', 'stamp')
    """
    for each in CHANNELS:
        if _is_of(each, column):
            return "_".join([column, *unit_words(each.unit)])
    return column


def channel_of(column: str) -> ChannelFacts | None:
    """Find the channel that a column is of; None for other columns.

    Examples
    --------
    >>> channel_of("tip_z_right_wing").unit, channel_of("fold_left")
    ('m', None)
    """
    return next((each for each in CHANNELS if _is_of(each, column)), None)


def is_channel(column: str) -> bool:
    """Whether a column belongs to a channel.

    Examples
    --------
    >>> is_channel("nz"), is_channel("tip_z_right_wing"), is_channel("fold_left")
    (True, True, False)
    """
    return channel_of(column) is not None


def channel_field(field: str) -> tuple[str, float] | None:
    """Column and factor to SI of a channel's field in a JSON document; None for other fields.

    The unit stands at the end of the field's name. Angles and rates may be in degrees.

    Examples
    --------
    >>> channel_field("p_rad_s"), channel_field("nz"), channel_field("p_rad")
    (('p', 1.0), ('nz', 1.0), None)
    """
    for each in CHANNELS:
        end = "".join(f"_{word}" for word in unit_words(each.unit))
        ends = {end: 1.0} | ({end.replace("rad", "deg"): math.pi / 180.0} if "rad" in end else {})
        for spelt, factor in ends.items():
            if field.endswith(spelt) and _is_of(each, field.removesuffix(spelt)):
                return field.removesuffix(spelt), factor
    return None


def _is_of(channel: ChannelFacts, column: str) -> bool:
    stem = f"{channel.name}_"
    of_part = column.startswith(stem) and PART.fullmatch(column.removeprefix(stem)) is not None
    return column == channel.name or bool(channel.per and of_part)


def unit_words(unit: str) -> list[str]:
    """Words by which names end in a unit.

    Examples
    --------
    >>> unit_words("m/s^2"), unit_words("N m"), unit_words("1")
    (['m', 's2'], ['nm'], [])
    """
    return [] if unit == "1" else unit.lower().replace(" ", "").replace("^", "").split("/")
