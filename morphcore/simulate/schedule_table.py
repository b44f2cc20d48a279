"""Schedules as CSV files: the hinge angles of both sides over time."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from morphcore.errors import InvalidInput
from morphcore.simulate.file_columns import read_file_columns
from morphcore.simulate.schedule import Schedule, Tabulated
from morphdata.samplefiles.csv_table import write_table
from morphdata.samplefiles.flight import MOST_ROWS

Array = NDArray[np.float64]

SCHEDULE_COLUMNS = ("t", "sweep_left", "sweep_right")
LEAST_ROWS = 3  # fewer do not tell how the hinge moves between them


def load_schedule_csv(path: str | Path) -> dict[str, Tabulated]:
    """Read a morph schedule: the columns t, sweep_left, sweep_right.

    Units in the names are accepted (``t_ms``, ``sweep_left_deg``); other columns are not looked at, so that a
    sample flight is a schedule too.

    Returns
    -------
    ``{"left": ..., "right": ...}``, the hinge histories of the two sides, s and rad.

    Raises
    ------
    InvalidInput : a column is missing or holds something that is not a finite number, there are too few rows,
        or time does not rise.
    """
    table = read_file_columns(path, SCHEDULE_COLUMNS)
    columns = table.values
    time_s = columns["t"]
    if not LEAST_ROWS <= time_s.size <= MOST_ROWS:
        raise InvalidInput(f"{path} holds {time_s.size} rows", hint=f"give {LEAST_ROWS} to {MOST_ROWS} rows")
    falls = np.flatnonzero(np.diff(time_s) <= 0.0)
    if falls.size:
        raise InvalidInput(
            f"{table.place(falls[0] + 1)}: time does not rise",
            hint="sort the rows by time and drop doubles",
        )
    return {side: Tabulated(time_s, columns[f"sweep_{side}"]) for side in ("left", "right")}


def write_schedule_csv(schedules: Mapping[str, Schedule], time_s: Array, path: str | Path) -> None:
    """Write the hinge angles of both sides at times (k,), s; `load_schedule_csv` reads them back."""
    angles = [schedules[side].motion(time_s).angle for side in ("left", "right")]
    with Path(path).open("w", newline="", encoding="utf-8") as stream:
        # twelve digits: second differences of rows 10 ms apart are right to 1e-7 rad/s^2
        rows = ([f"{value:.12g}" for value in row] for row in zip(time_s, *angles, strict=True))
        write_table(stream, SCHEDULE_COLUMNS, rows)
