"""Columns of CSV files by name, with units in the names: ``t`` or ``time_ms``, ``theta`` or ``theta_deg``."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from morphcore.errors import InvalidInput

Array = NDArray[np.float64]

DEGREE = np.pi / 180.0
UNITS = {"deg": DEGREE, "rad": 1.0, "s": 1.0, "ms": 1e-3}  # -> SI
SHOWN_CHARACTERS = 40  # of a cell that is no number


@dataclass(frozen=True)
class CsvColumns:
    """A CSV file as text: ``header`` (c,), ``rows`` (k) of c cells, ``lines`` (k,) on which they stand."""

    path: Path
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]

    def quantities(self, names: Sequence[str]) -> dict[str, Array]:
        """The named columns in SI units, each (k,); of two columns of one name, the first.

        Raises
        ------
        InvalidInput : a column is missing, or a cell of one is not a finite number.
        """
        found: dict[str, Array] = {}
        for number, title in enumerate(self.header):
            name, factor = standard_name(title)
            if name in names and name not in found:
                found[name] = self._numbers(number) * factor
        missing = [name for name in names if name not in found]
        if missing:
            raise InvalidInput(
                f"{self.path} has no column {', '.join(missing)}",
                hint=f"give the columns {', '.join(names)}; units may be in the names (theta_deg, t_ms)",
            )
        return found

    def others(self, names: Sequence[str]) -> dict[str, Array]:
        """Further columns of numbers under their own titles, units as they are; words are passed over."""
        seen: set[str] = set()
        found: dict[str, Array] = {}
        for number, title in enumerate(self.header):
            name, _ = standard_name(title)
            if name in names and name not in seen:
                seen.add(name)
                continue
            with suppress(InvalidInput):
                found[title] = self._numbers(number)
        return found

    def _numbers(self, column: int) -> Array:
        values = np.empty(len(self.rows))
        for number, row in enumerate(self.rows):
            try:
                values[number] = float(row[column])
            except ValueError:
                values[number] = np.nan
            if not np.isfinite(values[number]):
                raise InvalidInput(
                    f"{self.path}, line {self.lines[number]}: {self.header[column]} is "
                    f"{row[column][:SHOWN_CHARACTERS]!r}, not a finite number",
                    hint="remove or repair the row",
                )
        return values


def read_csv_columns(path: str | Path) -> CsvColumns:
    """Read a CSV file with a header.

    Raises
    ------
    InvalidInput : it is missing, is not text, holds no rows, or a row is not as long as the header.
    """
    path = Path(path)
    try:
        # a spreadsheet's byte order mark is no part of the first name
        with path.open(newline="", encoding="utf-8-sig") as stream:
            reader = csv.reader(stream)
            header = tuple(name.strip() for name in next(reader, []))
            numbered = [(reader.line_num, tuple(row)) for row in reader if row]
    except FileNotFoundError:
        raise InvalidInput(f"{path} does not exist", hint="check the path") from None
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InvalidInput(f"{path} cannot be read: {error}", hint="give a CSV file in UTF-8") from None
    if not numbered:
        raise InvalidInput(f"{path} holds no rows", hint="give a CSV file with a header and rows of numbers")
    for line, row in numbered:
        if len(row) != len(header):
            raise InvalidInput(
                f"{path}, line {line}: {len(row)} cells under {len(header)} names",
                hint="every row must be as long as the header",
            )
    lines, rows = zip(*numbered, strict=True)
    return CsvColumns(path, header, rows, lines)


def standard_name(title: str) -> tuple[str, float]:
    """The name of a column without its unit, and the factor to SI units: ``theta_deg`` -> ``theta``."""
    match = re.fullmatch(r"(.+?)_(deg|rad|s|ms)", title)
    base, factor = (title, 1.0) if match is None else (match[1], UNITS[match[2]])
    return ("t" if base == "time" else base), factor
