"""Schedules written as CSV files: the angles of drives over time."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from morphcore.simulate.schedule import Schedule
from morphdata.samplefiles.csv_table import write_table

Array = NDArray[np.float64]


def write_schedule_csv(schedules: Mapping[str, Schedule], time_s: Array, path: str | Path) -> None:
    """Write the angles of drives, by name, at times (k,), s; `load_schedules` reads them back."""
    angles = [schedule.motion(time_s).angle for schedule in schedules.values()]
    with Path(path).open("w", newline="", encoding="utf-8") as stream:
        # twelve digits: second differences of rows 10 ms apart are accurate to 1e-7 rad/s^2
        rows = ([f"{value:.12g}" for value in row] for row in zip(time_s, *angles, strict=True))
        write_table(stream, ("t", *schedules), rows)
