"""Flights as CSV text."""

from __future__ import annotations

import csv
import io
import math
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import BinaryIO

from samplefiles.columns import FlightColumns, Wanted, not_finite
from samplefiles.fault import FileFault
from samplefiles.titles import chosen

LONGEST_LINE = 64 * 1024  # characters; one endless line must not fill the memory
LONGEST_FILE = 1_000_000  # lines, blank ones too


@dataclass
class _Column:
    position: int
    title: str
    factor: float
    values: array[float] = field(default_factory=lambda: array("d"))


def read_csv(stream: BinaryIO, wanted: Wanted) -> FlightColumns:
    """Read a title line and rows of numbers, UTF-8, separated by commas.

    Raises
    ------
    FileFault : naming line and column.
    """
    text = io.TextIOWrapper(stream, encoding="utf-8-sig", newline="")
    try:
        return _read(csv.reader(_bounded(text)), wanted)
    except (csv.Error, UnicodeDecodeError) as error:
        raise FileFault(
            "not_csv", f"this is not CSV text: {error}", "save it as comma separated text in UTF-8"
        ) from None
    finally:
        text.detach()  # the stream is the caller's to close


def _bounded(text: io.TextIOWrapper) -> Iterator[str]:
    for _ in range(LONGEST_FILE):
        line = text.readline(LONGEST_LINE + 1)
        if not line:
            return
        if len(line) > LONGEST_LINE:
            raise FileFault(
                "line_too_long", "a line is too long to be a row of numbers", "give a CSV file with line ends"
            )
        yield line
    raise FileFault("too_many_rows", f"the file has more than {LONGEST_FILE} lines", "split the flight")


def _read(rows: Iterator[list[str]], wanted: Wanted) -> FlightColumns:
    titles = [title.strip() for title in next(rows, [])]
    if not titles:
        raise FileFault("empty_file", "the file is empty", "give a CSV file with a title line")
    try:
        found = chosen(titles, wanted.names)
    except FileFault as fault:
        if fault.code == "missing" and len(titles) == 1 and any(mark in titles[0] for mark in ";\t"):
            fault.hint = "separate the cells by commas (and decimals by points)"
        raise
    columns = {
        name: _Column(position, titles[position], factor) for name, (position, factor) in found.items()
    }
    others = _others(titles, {column.position for column in columns.values()}) if wanted.others else []
    lines = array("q")
    for row in rows:
        if not any(cell.strip() for cell in row):
            continue
        line: int = rows.line_num  # type: ignore[attr-defined]  # csv.reader's own
        if len(lines) == wanted.most_rows:
            raise wanted.too_many_rows()
        if len(row) != len(titles):
            raise FileFault(
                "uneven_row",
                f"{len(row)} cells under {len(titles)} titles",
                "every row must be as long as the title line",
                row=len(lines),
                line=line,
            )
        for column in columns.values():
            value = _number(row[column.position])
            if not math.isfinite(value):
                raise not_finite(column.title, row[column.position].strip(), len(lines), line)
            column.values.append(value * column.factor)
        others = [column for column in others if _append(column, row)]
        lines.append(line)
    if not lines:
        raise FileFault("no_rows", "the file holds no rows", "give a title line and rows of numbers")
    return FlightColumns(
        values={name: columns[name].values for name in wanted.names},
        others={column.title: column.values for column in others},
        lines=lines,
    )


def _number(cell: str) -> float:
    """The number in a cell; NaN for all else (``1_000`` is a number in Python, not in a table)."""
    try:
        return math.nan if "_" in cell else float(cell)
    except ValueError:
        return math.nan


def _others(titles: Sequence[str], taken: set[int]) -> list[_Column]:
    return [
        _Column(position, title, 1.0)
        for position, title in enumerate(titles)
        if position not in taken and title
    ]


def _append(column: _Column, row: Sequence[str]) -> bool:
    """Whether a further column still holds nothing but numbers."""
    value = _number(row[column.position])
    column.values.append(value)
    return math.isfinite(value)
