"""Column titles: ``t``, ``time_ms``, ``theta_deg``, ``Theta [deg]``, ``theta (°)``, ``phi/deg``."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence

from morphdata.channels import is_channel
from morphdata.samplefiles.channel_titles import channel_meant
from morphdata.samplefiles.fault import TITLES, FileFault, shown
from morphdata.samplefiles.frames import EULER, QUATERNION
from morphdata.samplefiles.units import (
    ANGLE_UNITS,
    LENGTH_UNITS,
    TIME_UNITS,
    UNIT_IN_BRACKETS,
    plain,
    unit_pattern,
)

FLIGHT = ("t", "sweep_left", "sweep_right", "phi", "theta", "psi")
SWEEPS = ("sweep_left", "sweep_right")
ATTITUDE = ("t", "phi", "theta", "psi")  # without these there is no flight
DRIVE = re.compile(r"[a-z][a-z0-9_]{0,45}")  # the name of a hinge, and its side
MAX_COLUMNS = 1000  # a file of more is something else, or an attack
NUMBERED = re.compile(r"q_?\[?([0-3])\]?")  # q0, q_0, q[0]: of a quaternion in an order that nobody knows
SYNONYMS = {"time": "t"}
# the unit last, after a mark or in brackets: theta_deg, theta [deg], theta/deg, theta, deg, theta in deg
UNIT = unit_pattern((*TIME_UNITS, *ANGLE_UNITS))
# of a drive that slides: words end in m too, so a mark stands before the unit
LENGTH = unit_pattern(LENGTH_UNITS, marked=True)


def unit_factor(name: str, unit: str) -> float | None:
    """The factor to SI units of a unit of the column `name`, in brackets or not; None for an unknown one."""
    bare = plain(unit).strip("[](){}<>_")
    return (TIME_UNITS if name == "t" else ANGLE_UNITS).get(bare)


def meaning(title: str, names: Sequence[str]) -> tuple[str, float | None] | None:
    """The column of `names` that a title means and its factor to SI units; None for another column.

    The factor is None where the title names no unit.

    >>> meaning("Theta [rad]", FLIGHT), meaning("time", FLIGHT), meaning("q", FLIGHT)
    (('theta', 1.0), ('t', None), None)
    """
    whole = plain(title)
    name = SYNONYMS.get(whole, whole)
    if name in names:
        return name, None
    match = UNIT.fullmatch(whole)
    if match is None:
        return None
    base = match["name"].rstrip("_")
    name = SYNONYMS.get(base, base)
    factor = unit_factor(name, match["unit"])
    return (name, factor) if name in names and factor is not None else None


def drive_meant(title: str) -> tuple[str, float | None] | None:
    """The drive that a title could mean and its factor to rad or m, None where it names no unit.

    >>> drive_meant("Fold_left [deg]"), drive_meant("cant"), drive_meant("span_mm"), drive_meant("p_rad_s")
    (('fold_left', 0.017453292519943295), ('cant', None), ('span', 0.001), None)
    """
    if channel_meant(title) is not None:
        return None
    whole = plain(title)
    factor = None
    match = LENGTH.fullmatch(whole)
    if match is not None and _could_be_a_drive(match["name"].rstrip("_")):
        return match["name"].rstrip("_"), LENGTH_UNITS[match["unit"]]
    match = UNIT.fullmatch(whole)
    if match is not None:
        whole = match["name"].rstrip("_")
        factor = ANGLE_UNITS.get(match["unit"])
        if factor is None:
            return None
    return (whole, factor) if _could_be_a_drive(whole) else None


def slides(title: str) -> bool:
    """Whether a title that could mean a drive says that it slides: its unit is one of length."""
    return drive_meant(title) is not None and LENGTH.fullmatch(plain(title)) is not None


def drive_in_brackets(title: str) -> str | None:
    """The drive that a title could mean whose unit in brackets is none that is read; None for all others."""
    match = UNIT_IN_BRACKETS.fullmatch(plain(title))
    name = None if match is None else match["name"].rstrip("_")
    return name if name and _could_be_a_drive(name) else None


def _could_be_a_drive(name: str) -> bool:
    known = name in ATTITUDE or name in SYNONYMS or is_channel(name)
    return DRIVE.fullmatch(name) is not None and not known


def chosen(
    titles: Sequence[str], names: Sequence[str], optional: Sequence[str] = ()
) -> dict[str, tuple[int, float | None]]:
    """Find the columns that count.

    Parameters
    ----------
    titles : of all columns.
    names : the columns that are wanted; a quaternion may stand in the place of phi, theta, psi.
    optional : those of them that may be missing.

    Returns
    -------
    Name -> position among `titles` and factor to SI units, None where the title names no unit.

    Raises
    ------
    FileFault : two titles mean the same, or one is missing.
    """
    if len(titles) > MAX_COLUMNS:
        raise FileFault(
            "too_many_columns",
            f"the file has {len(titles)} columns",
            f"keep the {len(names)} that count: {', '.join(names)}",
        )
    found: dict[str, tuple[int, float | None]] = {}
    attitude = set(ATTITUDE) <= set(names)
    for position, title in enumerate(titles):
        meant = meaning(title, (*names, *QUATERNION) if attitude else names)
        if meant is None:
            continue
        name, factor = meant
        if name in found:
            former = shown(titles[found[name][0]])
            raise FileFault(
                "column_twice",
                f"the columns {former!r} and {shown(title)!r} both give {name}",
                "keep one of them",
                title=TITLES,
            )
        found[name] = position, factor
    left_out = _other_attitude(found) if attitude else ()
    found = {name: column for name, column in found.items() if name not in left_out}
    missing = [name for name in names if name not in {*found, *left_out, *optional}]
    if missing:
        raise missing_columns(titles, names, missing)
    return found


def _other_attitude(found: Collection[str]) -> tuple[str, ...]:
    """Which columns of attitude do not count: Euler angles come first, if they are complete."""
    has_quaternion = all(name in found for name in QUATERNION)
    return EULER if has_quaternion and not all(name in found for name in EULER) else QUATERNION


def missing_columns(titles: Sequence[str], names: Sequence[str], missing: Sequence[str]) -> FileFault:
    """The fault of a file that lacks some of the columns `names`."""
    return FileFault(
        "missing",
        f"there is no column {', '.join(missing)}",
        _way_out(titles, names, missing),
        title=TITLES,
    )


def _way_out(titles: Sequence[str], names: Sequence[str], missing: Sequence[str]) -> str:
    """What to do about missing columns: where one stands there in a unit that is not read, that."""
    numbered = [title for title in titles if NUMBERED.fullmatch(plain(title))]
    if len(numbered) == len(QUATERNION) and set(EULER) & set(missing):
        return (
            f"{', '.join(map(shown, numbered))} may be a quaternion in the order w, x, y, z or x, y, z, w: "
            "declare which (--quaternion wxyz), or name its columns qw, qx, qy, qz"
        )
    for title in titles:
        match = UNIT_IN_BRACKETS.fullmatch(plain(title))
        if match and SYNONYMS.get(match["name"], match["name"]) in missing:
            return f"the unit of {shown(title)!r} is not read: {known_units(match['name'])}"
    drives = "; other drives of the aircraft by their names" if SWEEPS[0] in names else ""
    return f"give the columns {', '.join(names)}{drives}; units may be in the names (theta_deg, t_ms)"


def known_units(name: str) -> str:
    """The units that a column may be in, for people."""
    return "give s, ms, us or ns" if SYNONYMS.get(name, name) == "t" else "give rad, mrad or deg"
