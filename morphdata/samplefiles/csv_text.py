"""Flights as text tables: CSV with commas, semicolons or tabs, decimal points or commas, and comments."""

from __future__ import annotations

import codecs
import csv
import io
import math
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import chain
from typing import BinaryIO

from morphdata.channels import is_channel
from morphdata.samplefiles.cells import Clock, Numbers
from morphdata.samplefiles.channel_columns import is_gap
from morphdata.samplefiles.channel_titles import channel_meant, channel_unit_factor, channel_units
from morphdata.samplefiles.columns import FlightColumns, Wanted, gathered, not_finite
from morphdata.samplefiles.comments import is_comment, is_octave, uncommented
from morphdata.samplefiles.fault import FileFault, octave_text, shown
from morphdata.samplefiles.frames import QUATERNION
from morphdata.samplefiles.titles import chosen, drive_meant, known_units, meaning, unit_factor

LONGEST_LINE = 64 * 1024  # characters; one endless line must not fill the memory
LONGEST_FILE = 1_000_000  # lines, blank ones too
LONGEST_TITLES = 128 * 1024  # characters of a title line with line ends inside its quotes
HEAD_BYTES = 64 * 1024  # that tell the encoding
DELIMITERS = (",", ";", "\t")

Found = dict[str, tuple[int, float | None]]


def read_csv(stream: BinaryIO, wanted: Wanted) -> FlightColumns:
    """Read a title line and rows of numbers.

    Cells are separated by commas, semicolons or tabs, whichever gives the titles. Between semicolons or
    tabs, and in quotes, decimals may have commas. Comments and blank lines are passed over; a row of units
    may stand below the titles.

    Raises
    ------
    FileFault : naming line and column.
    """
    text = io.TextIOWrapper(stream, encoding=_encoding(stream), newline="")
    try:
        return _read(_Lines(text), wanted)
    except (csv.Error, UnicodeError) as error:
        raise FileFault(
            "not_csv", f"this is not CSV text: {error}", "save it as comma separated text in UTF-8"
        ) from None
    finally:
        text.detach()  # the stream is the caller's to close


def _encoding(stream: BinaryIO) -> str:
    """UTF-8, UTF-16 with its mark, or Latin-1: an older program's sign of degree."""
    head = stream.read(HEAD_BYTES)
    stream.seek(0)
    zeros = head.count(0)
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) and zeros > len(head) // 3:
        return "utf-16"  # and of the letters that titles are made of
    try:
        codecs.getincrementaldecoder("utf-8")().decode(head)
    except UnicodeDecodeError:
        binary = any(byte < ord("\t") for byte in head)
        return "utf-8" if binary else "latin-1"
    return "utf-8-sig"


class _Lines:
    """Lines of a text, counted from 1: `number` is that of the last one."""

    def __init__(self, text: io.TextIOWrapper) -> None:
        self._text = text
        self.number = 0

    def __iter__(self) -> Iterator[str]:
        while line := self._text.readline(LONGEST_LINE + 1):
            self.number += 1
            if len(line) > LONGEST_LINE:
                raise FileFault(
                    "line_too_long",
                    "a line is too long to be a row of numbers",
                    "give a CSV file with line ends",
                )
            if self.number > LONGEST_FILE:
                raise FileFault(
                    "too_many_rows", f"the file has more than {LONGEST_FILE} lines", "split the flight"
                )
            yield line


def _read(lines: _Lines, wanted: Wanted) -> FlightColumns:
    head, titles = _head(lines, wanted)
    delimiter, cells, found = _titled(titles, wanted)
    rest = (line for line in lines if not is_comment(line, "" if delimiter == ";" else ";"))
    table = _Table(cells, found, wanted)
    # where the titles stand in a comment, the first line is a row already
    for row in csv.reader(chain([head] if head != titles else [], rest), delimiter=delimiter):
        if any(cell.strip() for cell in row):
            table.add(row, lines.number)
    return table.columns()


def _head(lines: _Lines, wanted: Wanted) -> tuple[str, str]:
    """The first line that is no comment, and the titles.

    Both are mostly the same; numpy writes the titles into a comment.
    """
    commented = ""
    for line in lines:
        if is_octave(line):
            raise octave_text()
        if not line.strip():
            continue
        if is_comment(line, ";") and not _fits(line, wanted):
            commented = uncommented(line) if _fits(uncommented(line), wanted) else commented
            continue
        head = _with_quoted_ends(line, lines)
        return head, commented if commented and not _fits(head, wanted) else head
    if commented:
        raise _no_rows()
    raise FileFault("empty_file", "the file is empty", "give a CSV file with a title line")


def _with_quoted_ends(line: str, lines: _Lines) -> str:
    """A title line with the lines that its quotes go on in."""
    further = iter(lines)
    while line.count('"') % 2 and (more := next(further, "")):
        line += more
        if len(line) > LONGEST_TITLES:
            raise FileFault(
                "not_csv",
                "this is not CSV text: a quoted title does not end",
                "close the quotes of the titles",
            )
    return line


def _cells(line: str, delimiter: str) -> list[str]:
    row = next(csv.reader(io.StringIO(line, newline=""), delimiter=delimiter), [])
    return [cell.strip() for cell in row]


def _fits(line: str, wanted: Wanted) -> bool:
    """Whether a line names all columns that are wanted."""
    try:
        _titled(line, wanted)
    except (FileFault, csv.Error):
        return False
    return True


def _titled(line: str, wanted: Wanted) -> tuple[str, list[str], Found]:
    """The delimiter that gives the columns, all titles, and the columns that count.

    Raises
    ------
    FileFault : no delimiter gives them; as of the one that gives most.
    """
    names = (*wanted.names, *QUATERNION)

    def known(delimiter: str) -> int:
        called = map(wanted.declared.called, _cells(line, delimiter))
        return sum(meaning(cell, names) is not None for cell in called)

    delimiter = max(DELIMITERS, key=lambda mark: (known(mark), line.count(mark)))
    cells = wanted.called(_cells(line, delimiter))
    return delimiter, cells, chosen(cells, wanted.names, wanted.optional)


def _no_rows() -> FileFault:
    return FileFault("no_rows", "the file holds no rows", "give a title line and rows of numbers")


@dataclass
class _Column:
    """One column, and how its cells are read."""

    position: int
    title: str
    factor: float | None = None
    numbers: Numbers = field(default_factory=Numbers)
    values: array[float] = field(default_factory=lambda: array("d"))
    fault: FileFault | None = None
    may_have_gaps: bool = False


class _Table:
    """Rows on their way to columns."""

    def __init__(self, titles: Sequence[str], found: Found, wanted: Wanted) -> None:
        self._titles, self._wanted = titles, wanted
        self._numbers = Numbers()
        self._columns = {
            name: _Column(position, titles[position], factor, self._numbers)
            for name, (position, factor) in found.items()
        }
        taken = {column.position for column in self._columns.values()}
        further = [title for position, title in enumerate(titles) if position not in taken]
        read = set(wanted.further(further))
        self._others = [
            _Column(position, title, may_have_gaps=channel_meant(title) is not None)
            for position, title in enumerate(titles)
            if position not in taken and title in read
        ]
        self._sound = self._others  # as far as they hold nothing but numbers
        self._units: dict[str, float | FileFault] = {}
        self._clock: Clock | None = None
        self._lines = array("q")
        self._units_read = False

    def add(self, row: Sequence[str], line: int) -> None:
        """Take a row that stands on a line."""
        if len(self._lines) == self._wanted.max_rows:
            raise self._wanted.too_many_rows()
        if len(row) != len(self._titles):
            raise self._uneven(row, line)
        if not len(self._lines) and not self._units_read and self._are_units(row):
            self._units_read = True
            self._take_units(row, line)
            return
        try:
            for name, column in self._columns.items():
                value = self._time(column, row) if name == "t" else self._value(column, row)
                if not math.isfinite(value):
                    raise not_finite(column.title, row[column.position].strip(), len(self._lines), line)
                column.values.append(value)
        except FileFault as fault:
            fault.line = line
            raise
        self._sound = [column for column in self._sound if _append(column, row, len(self._lines), line)]
        self._lines.append(line)

    def columns(self) -> FlightColumns:
        """All that was read."""
        if not self._lines:
            raise _no_rows()
        self._numbers.require_decimals()
        columns = FlightColumns(
            values={name: column.values for name, column in self._columns.items()},
            others={column.title: column.values for column in self._sound if self._is_read_right(column)},
            lines=self._lines,
        )
        taken = {column.position for column in self._columns.values()}
        titles = [title for position, title in enumerate(self._titles) if position not in taken]
        faults = {column.title: column.fault for column in self._others if column.fault is not None}
        return gathered(self._wanted, titles, columns, self._units, faults)

    def _value(self, column: _Column, row: Sequence[str]) -> float:
        value = self._numbers.read(row[column.position])
        return value if column.factor is None else value * column.factor

    def _time(self, column: _Column, row: Sequence[str]) -> float:
        if self._clock is None:
            self._clock = Clock(1.0 if column.factor is None else column.factor, self._numbers)
        return self._clock.read(row[column.position])

    def _are_units(self, row: Sequence[str]) -> bool:
        """Whether a row names units: no number and no date in any cell that counts, and words in some."""
        cells = [row[column.position].strip() for column in self._columns.values()]
        words = [cell for cell in cells if cell.strip("-")]
        return bool(words) and not any(_holds_digit(cell) or _is_no_number(cell) for cell in words)

    def _take_units(self, row: Sequence[str], line: int) -> None:
        for name, column in self._columns.items():
            cell = row[column.position].strip()
            if not cell.strip("-"):
                continue
            factor = unit_factor(name, cell)
            if factor is None:
                raise FileFault(
                    "unknown_unit",
                    f"the unit {shown(cell)!r} of {shown(column.title)} is not supported",
                    known_units(name),
                    line=line,
                    title=column.title,
                )
            if column.factor not in (None, factor):
                raise FileFault(
                    "two_units",
                    f"the row of units gives another unit for {shown(column.title)}: {shown(cell)!r}",
                    "say the unit once",
                    line=line,
                    title=column.title,
                )
            column.factor = factor
        for column in self._others:
            cell = row[column.position].strip()
            meant = drive_meant(column.title) or channel_meant(column.title)
            if cell.strip("-") and meant is not None:
                self._units[column.title] = _further_unit(*meant, cell, column.title, line)

    def _uneven(self, row: Sequence[str], line: int) -> FileFault:
        hint = "every row must be as long as the title line"
        if len(row) > len(self._titles) and "." not in "".join(row):
            hint += "; decimals with commas need semicolons or tabs between the cells"
        return FileFault(
            "uneven_row",
            f"{len(row)} cells under {len(self._titles)} titles",
            hint,
            row=len(self._lines),
            line=line,
        )

    def _is_read_right(self, column: _Column) -> bool:
        """Whether a further column's decimal mark is the table's, so that its commas are no thousands'."""
        own, table = column.numbers, self._numbers
        try:
            if not table.proven:
                own.require_decimals()
        except FileFault as fault:
            column.fault = fault
            return False
        return not (own.comma and table.point) and not (own.point and table.comma)


def _holds_digit(cell: str) -> bool:
    return any(character.isdigit() for character in cell)


def _is_no_number(cell: str) -> bool:
    return cell.strip("+-").lower() in ("nan", "inf", "infinity", "na", "null", "none")


def _further_unit(name: str, factor: float | None, cell: str, title: str, line: int) -> float | FileFault:
    """The factor to SI that a row of units gives for a drive's or a channel's column, or what is wrong."""
    channel = is_channel(name)
    given = channel_unit_factor(name, cell) if channel else unit_factor(name, cell)
    if given is None or factor not in (None, given):
        said = "is not supported" if given is None else "differs from that in its title"
        known = channel_units(name) if channel else known_units(name)
        return FileFault(
            "unknown_unit" if given is None else "two_units",
            f"the unit {shown(cell)!r} of {shown(title)} {said}",
            known if given is None else "say the unit once",
            line=line,
            title=title,
        )
    return given


def _append(column: _Column, row: Sequence[str], number: int, line: int) -> bool:
    """Whether a further column still holds nothing but numbers; else its fault says where it does not."""
    try:
        value = column.numbers.read(row[column.position])
    except FileFault as fault:
        column.fault = fault
        return False
    column.values.append(value)
    if not math.isfinite(value) and not (column.may_have_gaps and is_gap(row[column.position])):
        column.fault = not_finite(column.title, row[column.position].strip(), number, line)
    return column.fault is None
