"""Checks of the rows of one flight."""

from __future__ import annotations

from itertools import pairwise

from app.errors import Fault
from app.schemas.samples import TrajectoryColumns

MAX_DURATION_S = 600.0
MIN_STEP_S = 1e-6
COLUMN_NAMES = tuple(TrajectoryColumns.model_fields)


def columns_faults(columns: TrajectoryColumns, pointer: str) -> list[Fault]:
    """Check that the columns are equally long and that time rises."""
    faults = []
    rows = len(columns.time_s)
    for name in COLUMN_NAMES:
        length = len(getattr(columns, name))
        if length != rows:
            faults.append(
                Fault(
                    "unequal_lengths",
                    f"{name} has {length} rows, time_s has {rows}.",
                    f"{pointer}/{name}",
                    f"Give one {name} for every time.",
                )
            )
    for row, (before, after) in enumerate(pairwise(columns.time_s), start=1):
        if after - before < MIN_STEP_S:
            faults.append(
                Fault(
                    "time_not_rising",
                    f"Time goes from {before:g} s to {after:g} s at row {row}.",
                    f"{pointer}/time_s/{row}",
                    f"Sort the rows by time and drop repeated ones; steps must be at least {MIN_STEP_S:g} s.",
                )
            )
            break
    duration = columns.time_s[-1] - columns.time_s[0]
    if duration > MAX_DURATION_S:
        faults.append(
            Fault(
                "too_long_a_flight",
                f"The flight takes {duration:g} s.",
                f"{pointer}/time_s",
                f"Cut it to at most {MAX_DURATION_S:g} s, or check that time is in seconds.",
            )
        )
    return faults
