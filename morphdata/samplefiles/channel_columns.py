"""The columns of channels in a file: converted to SI, with gaps where a value is missing."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable, Mapping, Sequence

from morphdata.samplefiles.channel_titles import channel_in_brackets, channel_meant, channel_units
from morphdata.samplefiles.fault import FileFault, shown

MAX_CHANNELS = 64
MAX_CHANNEL_NUMBERS = 2_000_000  # in all columns of channels: 20 of the longest flight
LARGEST_VALUE = 1e9  # SI units
GAPS = frozenset(("", "nan", "na", "n/a", "null", "none", "-"))  # cells without a value


def is_gap(cell: str) -> bool:
    """Whether a cell of a text table says that there is no value.

    >>> is_gap(" "), is_gap("NaN"), is_gap("0"), is_gap("x")
    (True, True, False, False)
    """
    return cell.strip().lower() in GAPS


def without_gaps(values: Iterable[float | None]) -> array[float]:
    """A column as numbers, with NaN where there is no value."""
    return array("d", (math.nan if value is None else value for value in values))


def with_gaps(values: Iterable[float]) -> list[float | None]:
    """A column as it stands in JSON, with None where there is no value."""
    return [None if math.isnan(value) else value for value in values]


def channel_columns(
    titles: Sequence[str],
    read: Mapping[str, array[float]],
    units: Mapping[str, float | FileFault],
    faults: Mapping[str, FileFault],
) -> tuple[dict[str, array[float]], dict[str, FileFault]]:
    """Columns of channels by their names, SI units, and what is wrong with those that cannot be used.

    Parameters
    ----------
    titles : of all columns that may be channels.
    read : columns by title, units as they are; NaN is a gap.
    units : of columns by title, where the unit stands apart from the title: factor to SI, or what is wrong.
    faults : what is wrong with columns that could not be read, by title.
    """
    found: dict[str, array[float]] = {}
    unreadable: dict[str, FileFault] = {}
    from_titles: dict[str, str] = {}
    for title in titles:
        meant = channel_meant(title)
        if meant is None:
            facts = channel_in_brackets(title)
            if facts is not None:
                detail = f"the unit of {shown(title)!r} is not read"
                unreadable[facts.name] = FileFault("unknown_unit", detail, channel_units(facts.name))
            continue
        name, factor = meant
        unit = units.get(title, factor)
        fault = _twice(from_titles.get(name), title, name) or faults.get(title)
        fault = unit if isinstance(unit, FileFault) else fault
        if fault is None and title not in read:
            fault = FileFault("not_numbers", f"{shown(title)} does not hold numbers", "give numbers, or gaps")
        if fault is None and not isinstance(unit, FileFault):
            found[name] = _scaled(read[title], unit)
            fault = _fault(title, found[name], len(found))
        from_titles[name] = title
        if fault is not None:
            unreadable[name] = fault
            found.pop(name, None)
    return found, unreadable


def _scaled(values: array[float], factor: float | None) -> array[float]:
    return values if factor in (None, 1.0) else array("d", (factor * value for value in values))


def _twice(former: str | None, title: str, name: str) -> FileFault | None:
    if former is None:
        return None
    detail = f"the columns {shown(former)!r} and {shown(title)!r} both give {name}"
    return FileFault("column_twice", detail, "keep one of them")


def _fault(title: str, values: array[float], count: int) -> FileFault | None:
    """What is wrong with a channel's column, SI units; None where nothing is."""
    if count > MAX_CHANNELS or count * len(values) > MAX_CHANNEL_NUMBERS:
        detail = f"{shown(title)} is not read: the file has too many channels"
        return FileFault("too_many_columns", detail, "leave out those that nobody needs")
    beyond = next((row for row, value in enumerate(values) if abs(value) > LARGEST_VALUE), None)
    if beyond is not None:  # infinity, too
        detail = f"{shown(title)} is {values[beyond]:g}"
        return FileFault("out_of_range", detail, "remove or repair the value", row=beyond, title=title)
    if all(map(math.isnan, values)):
        return FileFault("no_values", f"{shown(title)} holds no value", "leave the column out", title=title)
    return None
