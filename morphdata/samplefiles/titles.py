"""Column titles: ``t``, ``time_ms``, ``theta_deg``, ``Theta [deg]``, ``theta (°)``, ``phi/deg``."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from morphdata.samplefiles.fault import TITLES, FileFault, shown

FLIGHT = ("t", "sweep_left", "sweep_right", "phi", "theta", "psi")
MOST_COLUMNS = 1000  # a file of more is something else, or an attack
LONGEST_TITLE = 200
SYNONYMS = {"time": "t"}
DEGREE = math.pi / 180.0
TIME_UNITS = {  # -> s
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds"), 1.0),
    **dict.fromkeys(("ms", "msec", "millisecond", "milliseconds"), 1e-3),
    **dict.fromkeys(("us", "µs", "μs", "usec", "microsecond", "microseconds"), 1e-6),
    **dict.fromkeys(("ns", "nsec", "nanosecond", "nanoseconds"), 1e-9),
}
ANGLE_UNITS = {  # -> rad
    **dict.fromkeys(("rad", "rads", "radian", "radians"), 1.0),
    **dict.fromkeys(("mrad", "milliradian", "milliradians"), 1e-3),
    # signs of degree, of ordinals (typed in its place) and of rings above
    **dict.fromkeys(("deg", "degs", "degree", "degrees", "°", "º", "˚"), DEGREE),
}
_UNITS = "|".join(sorted((*TIME_UNITS, *ANGLE_UNITS), key=len, reverse=True))
# the unit last, after a mark or in brackets: theta_deg, theta [deg], theta/deg, theta, deg, theta in deg
UNIT = re.compile(rf"(?P<name>.+?)[_./,:;-]*(?:in_)?[\[({{<]?_*(?P<unit>{_UNITS})_*[\])}}>]?")
BRACKETS = re.compile(r"(?P<name>.+?)_*[\[({<](?P<unit>[^\[\](){}<>]*)[\])}>]")


def plain(text: str) -> str:
    """A title or unit in small letters, its blanks as underscores."""
    return re.sub(r"\s+", "_", text[:LONGEST_TITLE].strip().strip('"').strip().lower())


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


def chosen(titles: Sequence[str], names: Sequence[str]) -> dict[str, tuple[int, float | None]]:
    """Find the columns that count.

    Returns
    -------
    Name -> position among `titles` and factor to SI units, None where the title names no unit.

    Raises
    ------
    FileFault : two titles mean the same, or one is missing.
    """
    if len(titles) > MOST_COLUMNS:
        raise FileFault(
            "too_many_columns",
            f"the file has {len(titles)} columns",
            f"keep the {len(names)} that count: {', '.join(names)}",
        )
    found: dict[str, tuple[int, float | None]] = {}
    for position, title in enumerate(titles):
        meant = meaning(title, names)
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
    missing = [name for name in names if name not in found]
    if missing:
        raise FileFault(
            "missing",
            f"there is no column {', '.join(missing)}",
            _way_out(titles, names, missing),
            title=TITLES,
        )
    return found


def _way_out(titles: Sequence[str], names: Sequence[str], missing: Sequence[str]) -> str:
    """What to do about missing columns: where one stands there in a unit that is not read, that."""
    for title in titles:
        match = BRACKETS.fullmatch(plain(title))
        if match and SYNONYMS.get(match["name"], match["name"]) in missing:
            return f"the unit of {shown(title)!r} is not read: {known_units(match['name'])}"
    return f"give the columns {', '.join(names)}; units may be in the names (theta_deg, t_ms)"


def known_units(name: str) -> str:
    """The units that a column may be in, for people."""
    return "give s, ms, us or ns" if SYNONYMS.get(name, name) == "t" else "give rad, mrad or deg"
