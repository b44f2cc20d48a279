"""Units that titles of columns may name, with their factors to SI."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable

LONGEST_TITLE = 200
DEGREE = math.pi / 180.0
STANDARD_GRAVITY_M_S2 = 9.80665  # the unit g
KNOT_M_S = 1852.0 / 3600.0
FOOT_M = 0.3048
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


def _per_second(units: dict[str, float], power: str = "") -> dict[str, float]:
    """Units by the second, or by its square, in the ways that people write them."""
    ends = [f"{mark}{second}" for mark in ("/", "_") for second in (f"s{power}", f"s^{power}", f"sec{power}")]
    ends += [f"_s^-{power or 1}", f"_s-{power or 1}"]
    if power == "2":
        ends += ["/s²", "/s/s", "_s_s"]
    return {f"{unit}{end}": factor for unit, factor in units.items() for end in ends if end[-1] != "^"}


RATE_UNITS = {**_per_second(ANGLE_UNITS), "dps": DEGREE}  # -> rad/s
LENGTH_UNITS = {  # -> m
    **dict.fromkeys(("m", "metre", "metres", "meter", "meters"), 1.0),
    **dict.fromkeys(("mm", "millimetre", "millimetres", "millimeter", "millimeters"), 1e-3),
    "cm": 1e-2,
    "km": 1e3,
    **dict.fromkeys(("ft", "foot", "feet"), FOOT_M),
}
SPEED_UNITS = {  # -> m/s
    **_per_second({"m": 1.0, "mm": 1e-3, "cm": 1e-2, "ft": FOOT_M}),
    "mps": 1.0,
    **dict.fromkeys(("kt", "kts", "kn", "knot", "knots"), KNOT_M_S),
    **dict.fromkeys(("km/h", "km_h", "kmh", "kph"), 1.0 / 3.6),
    "fps": FOOT_M,
}
ACCELERATION_UNITS = {  # -> m/s^2
    **_per_second({"m": 1.0, "mm": 1e-3, "ft": FOOT_M}, "2"),
    "g": STANDARD_GRAVITY_M_S2,
    "mg": 1e-3 * STANDARD_GRAVITY_M_S2,
}
FORCE_UNITS = {  # -> N
    **dict.fromkeys(("n", "newton", "newtons"), 1.0),
    "kn": 1e3,
}
TORQUE_UNITS = {  # -> N m
    **dict.fromkeys(("nm", "n_m", "n*m", "n.m", "n·m"), 1.0),
    **dict.fromkeys(("knm", "kn_m", "kn*m", "kn.m"), 1e3),
}
FORCE_UNITS = {"n": 1.0, "kn": 1e3}  # -> N
LINE_LOAD_UNITS = {  # -> N/m
    **dict.fromkeys(("n_m", "n/m"), 1.0),
    **dict.fromkeys(("kn_m", "kn/m"), 1e3),
}
UNIT_IN_BRACKETS = re.compile(r"(?P<name>.+?)_*[\[({<](?P<unit>[^\[\](){}<>]*)[\])}>]")


def unit_pattern(units: Iterable[str], *, marked: bool = False) -> re.Pattern[str]:
    """A title with one of some units last, after a mark or in brackets.

    All of ``theta_deg``, ``theta [deg]``, ``theta/deg``, ``theta, deg`` and ``theta in deg`` match; so does
    ``thetadeg``, unless the unit must be ``marked``.
    """
    spelt = "|".join(map(re.escape, sorted(units, key=len, reverse=True)))
    if marked:
        return re.compile(rf"(?P<name>.+?)[_./,:;\[({{<-]+(?:in_)?_*(?P<unit>{spelt})_*[\])}}>]?")
    return re.compile(rf"(?P<name>.+?)(?:[_./,:;-]+in_|[_./,:;-]*)[\[({{<]?_*(?P<unit>{spelt})_*[\])}}>]?")


def plain(text: str) -> str:
    """A title or unit in small letters, its blanks as underscores."""
    return re.sub(r"\s+", "_", text[:LONGEST_TITLE].strip().strip('"').strip().lower())
