"""Reading a sample flight from CSV text, whatever units its column names carry."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterator
from typing import TextIO

from app.errors import Fault, InvalidRequest
from app.schemas.fields import MAX_ROWS

MAX_COLUMNS = 256
MAX_LINE_CHARACTERS = 20_000

QUANTITIES = {
    "t": "time_s",
    "time": "time_s",
    "sweep_left": "sweep_left_rad",
    "sweep_right": "sweep_right_rad",
    "phi": "phi_rad",
    "theta": "theta_rad",
    "psi": "psi_rad",
}
SCALES = {
    "time_s": {"": 1.0, "s": 1.0, "ms": 1e-3},
    "angle": {"": 1.0, "rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180.0},
}
UNIT = re.compile(r"^(?P<quantity>.+?)_?[\[(]?(?P<unit>ms|s|rad|mrad|deg)[\])]?$")


def _column(title: str) -> tuple[str, float] | None:
    """Read a column title: the column of ours that it means and its scale to SI, or None."""
    plain = title.strip().strip("\ufeff").lower().replace(" ", "_")
    candidates = [(plain, "")]
    if match := UNIT.match(plain):
        candidates.append((match["quantity"].rstrip("_"), match["unit"]))
    for quantity, unit in candidates:
        name = QUANTITIES.get(quantity)
        if name is None:
            continue
        scale = SCALES["time_s" if name == "time_s" else "angle"].get(unit)
        if scale is not None:
            return name, scale
    return None


def read_csv(text: TextIO, pointer: str = "/file") -> dict[str, list[float]]:
    """Read the six columns of a flight.

    Parameters
    ----------
    text
        CSV with a title line; columns ``t, sweep_left, sweep_right, phi, theta, psi``, optionally with a unit
        (``theta_deg``, ``t_ms``); others are ignored.
    pointer
        Where faults point to; ``{pointer}/{row}/{column}``, rows counted from 0 after the title line.

    Returns
    -------
    dict
        Columns by their names in JSON, s and rad.

    Raises
    ------
    InvalidRequest
        Naming row and column.
    """
    rows = csv.reader(_bounded(text, pointer))
    titles = _next_row(rows, pointer)
    if titles is None:
        raise InvalidRequest.of(
            [Fault("empty_file", "The file is empty.", pointer, "Send a CSV with a title line.")]
        )
    if len(titles) > MAX_COLUMNS:
        raise InvalidRequest.of(
            [
                Fault(
                    "too_many_columns",
                    f"The file has {len(titles)} columns.",
                    pointer,
                    "Keep the six that count.",
                )
            ]
        )
    wanted = _wanted(titles, pointer)
    columns: dict[str, list[float]] = {name: [] for name, _, _ in wanted}
    number = 0
    while (row := _next_row(rows, pointer)) is not None:
        if not any(cell.strip() for cell in row):
            continue
        if number == MAX_ROWS:
            raise InvalidRequest.of(
                [
                    Fault(
                        "too_many_rows",
                        f"More than {MAX_ROWS} rows.",
                        pointer,
                        "10 ms between rows are enough.",
                    )
                ]
            )
        for name, position, scale in wanted:
            columns[name].append(_number(row, position, titles[position], f"{pointer}/{number}") * scale)
        number += 1
    return columns


def _bounded(text: TextIO, pointer: str) -> Iterator[str]:
    while line := text.readline(MAX_LINE_CHARACTERS + 1):
        if len(line) > MAX_LINE_CHARACTERS:
            raise InvalidRequest.of(
                [
                    Fault(
                        "line_too_long",
                        "A line is too long to be a row of numbers.",
                        pointer,
                        "Send a CSV file.",
                    )
                ]
            )
        yield line


def _next_row(rows: Iterator[list[str]], pointer: str) -> list[str] | None:
    try:
        return next(rows, None)
    except (csv.Error, UnicodeDecodeError) as error:
        raise InvalidRequest.of(
            [
                Fault(
                    "not_csv",
                    f"This is not CSV text: {error}.",
                    pointer,
                    "Save it as comma separated UTF-8 text.",
                )
            ]
        ) from None


def _wanted(titles: list[str], pointer: str) -> list[tuple[str, int, float]]:
    """Find the columns that count: (name, position, scale to SI)."""
    found: dict[str, tuple[str, int, float]] = {}
    for position, title in enumerate(titles):
        meaning = _column(title)
        if meaning is None:
            continue
        name, scale = meaning
        if name in found:
            raise InvalidRequest.of(
                [Fault("column_twice", f"Two columns give {name}.", f"{pointer}/titles", "Keep one of them.")]
            )
        found[name] = (name, position, scale)
    missing = [name for name in dict.fromkeys(QUANTITIES.values()) if name not in found]
    if missing:
        raise InvalidRequest.of(
            [
                Fault(
                    "missing",
                    f"There is no column for {name}.",
                    f"{pointer}/titles",
                    "Title line: t, sweep_left, sweep_right, phi, theta, psi (or with units: theta_deg).",
                )
                for name in missing
            ]
        )
    return list(found.values())


def _number(row: list[str], position: int, title: str, pointer: str) -> float:
    cell = row[position].strip() if position < len(row) else ""
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        shown = cell[:40] or "nothing"
        raise InvalidRequest.of(
            [
                Fault(
                    "finite_number",
                    f"{title.strip()[:60]} is {shown!r}, not a finite number.",
                    f"{pointer}/{title.strip()[:60]}",
                    "Repair or remove the row.",
                )
            ]
        )
    return value
