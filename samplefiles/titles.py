"""Column titles: ``t`` or ``time_ms``, ``theta``, ``theta_deg`` or ``Theta [deg]``."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from samplefiles.fault import TITLES, FileFault, shown

FLIGHT = ("t", "sweep_left", "sweep_right", "phi", "theta", "psi")
MOST_COLUMNS = 1000  # a file of more is something else, or an attack
LONGEST_TITLE = 200
SYNONYMS = {"time": "t"}
TIME_UNITS = {"": 1.0, "s": 1.0, "ms": 1e-3}  # -> s
ANGLE_UNITS = {"": 1.0, "rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180.0}  # -> rad
UNIT = re.compile(r"(?P<name>.+?)_?[\[(]?(?P<unit>ms|s|rad|mrad|deg)[\])]?")


def meaning(title: str, names: Sequence[str]) -> tuple[str, float] | None:
    """The column of `names` that a title means and its factor to SI units; None for another column."""
    plain = title[:LONGEST_TITLE].strip().lower().replace(" ", "_")
    candidates = [(plain, "")]
    if match := UNIT.fullmatch(plain):
        candidates.append((match["name"].rstrip("_"), match["unit"]))
    for base, unit in candidates:
        name = SYNONYMS.get(base, base)
        factor = (TIME_UNITS if name == "t" else ANGLE_UNITS).get(unit)
        if name in names and factor is not None:
            return name, factor
    return None


def chosen(titles: Sequence[str], names: Sequence[str]) -> dict[str, tuple[int, float]]:
    """Find the columns that count.

    Returns
    -------
    Name -> position among `titles` and factor to SI units.

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
    found: dict[str, tuple[int, float]] = {}
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
            f"give the columns {', '.join(names)}; units may be in the names (theta_deg, t_ms)",
            title=TITLES,
        )
    return found
