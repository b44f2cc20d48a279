"""The columns of one flight as they come out of a file."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from morphdata.samplefiles.fault import FileFault, shown
from morphdata.samplefiles.flight import MOST_ROWS, from_first_row
from morphdata.samplefiles.titles import FLIGHT

Numbers = Iterable[float]


@dataclass(frozen=True)
class Wanted:
    """What a reader is asked for.

    Parameters
    ----------
    names : the columns that must be there; given in SI units.
    others : whether further columns of numbers are given too, as they are.
    most_rows : a longer file is refused.
    """

    names: tuple[str, ...] = FLIGHT
    others: bool = False
    most_rows: int = MOST_ROWS

    def too_many_rows(self) -> FileFault:
        """The fault of a file that is too long."""
        return FileFault(
            "too_many_rows",
            f"the file has more than {self.most_rows} rows",
            "10 ms between rows are enough: leave out rows, or split the flight",
        )


@dataclass(frozen=True)
class FlightColumns:
    """Columns of numbers, equally long.

    Attributes
    ----------
    values : the wanted ones by name, SI units.
    others : further ones by their own titles, units as they are.
    lines : of a text file the line of each row, from 1; else empty.
    """

    values: dict[str, array[float]]
    others: dict[str, array[float]] = field(default_factory=dict)
    lines: Sequence[int] = ()


def column_in_si(name: str, values: Sequence[float], factor: float | None, title: str) -> array[float]:
    """A flight's column in SI units; time from the first row where its clock counts from an epoch.

    Raises
    ------
    FileFault : naming the first row that is no finite number.
    """
    return in_si(from_first_row(values, factor) if name == "t" else values, factor, title)


def in_si(values: Numbers, factor: float | None, title: str) -> array[float]:
    """Values times `factor`; FileFault names the first row that is no finite number."""
    scale = 1.0 if factor is None else factor
    scaled = array("d", values if scale == 1.0 else (value * scale for value in values))
    if not all(map(math.isfinite, scaled)):
        row = next(number for number, value in enumerate(scaled) if not math.isfinite(value))
        raise not_finite(title, scaled[row], row)
    return scaled


def not_finite(title: str, value: object, row: int, line: int | None = None) -> FileFault:
    """The fault of a cell that is no finite number."""
    said = "missing" if value is None or value == "" else repr(shown(value))
    return FileFault(
        "finite_number",
        f"{shown(title)} is {said}, not a finite number",
        "remove or repair the row",
        row=row,
        line=line,
        title=title,
    )


def equally_long(columns: FlightColumns, titles: dict[str, str]) -> FlightColumns:
    """The columns, if they are of one length; FileFault names the odd one by its title."""
    names = list(columns.values)
    rows = len(columns.values[names[0]])
    for name in names[1:]:
        if len(columns.values[name]) != rows:
            raise FileFault(
                "unequal_lengths",
                f"{shown(titles[name])} has {len(columns.values[name])} rows, "
                f"{shown(titles[names[0]])} has {rows}",
                "give equal lengths",
                title=titles[name],
            )
    return columns
