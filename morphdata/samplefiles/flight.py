"""What every sample flight must keep: one judge for the library, the command and the service."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise

from morphdata.samplefiles.fault import FileFault
from morphdata.samplefiles.titles import FLIGHT

MIN_ROWS = 3
MAX_ROWS = 100_000  # of one flight: 1000 s at 10 ms
LONGEST_FLIGHT_S = 600.0
SHORTEST_STEP_S = 1e-6
# no flight recorder counts from a start so long ago (11 days, s): beyond, the clock counts from an epoch
LATEST_START_S = 1e6
STEEPEST_PITCH = math.pi / 2.0  # rad; z-y-x Euler angles have no steeper one
LARGEST_ANGLE = 1000.0  # rad; of hinges, whose ranges are the aircraft's, and of full turns
ROUND_OFF = 1e-6  # rad; of an angle written in few digits

# a flight's columns as they are called inline in a JSON document
INLINE = {"t": "time_s", **{name: f"{name}_rad" for name in FLIGHT if name != "t"}}
SLOW_STEP_S = 0.5  # on average: nobody records a flight in which wings move so slowly
MILLISECONDS_HINT = (
    "its rows are {:.3g} s apart, which looks like milliseconds: give seconds, or name the unit in a file's "
    "title (t_ms)"
)
TOO_LONG_HINT = f"cut it to at most {LONGEST_FLIGHT_S:g} s, or check that time is in seconds"


def counts_from_epoch(first: float, factor: float | None = None) -> bool:
    """Whether a flight's first time, in a unit of `factor` s, is a date and no time since its start."""
    return LATEST_START_S < abs(first) * (1.0 if factor is None else factor) < math.inf


def from_first_row(times: Sequence[float], factor: float | None = None) -> Sequence[float]:
    """Times as they are, or, of a clock that counts from an epoch, counted from the first row.

    Whole numbers are subtracted as such: nanoseconds since 1970 have more digits than a float.

    >>> from_first_row([1714564800.0, 1714564800.5])
    [0.0, 0.5]
    """
    if not len(times) or not counts_from_epoch(times[0], factor):
        return times
    first = times[0]
    return [time - first for time in times]


def flight_faults(
    columns: Mapping[str, Sequence[float]], called: Mapping[str, str] | None = None
) -> Iterator[FileFault]:
    """What is wrong with the columns of one flight.

    Parameters
    ----------
    columns : t, phi, theta, psi and those of drives by their names, finite numbers; s and rad.
    called : what their owner calls them; `INLINE` and the like in a JSON document. Left out: as in a file.

    Yields
    ------
    FileFault : with the row (from 0), and the column's name as the title; none where it is about all.
    """
    called = called or {name: name for name in columns}
    angles = [name for name in (*FLIGHT, *columns) if name in columns and name != "t"]
    times = columns["t"]
    if not MIN_ROWS <= len(times) <= MAX_ROWS:
        yield FileFault(
            "too_short" if len(times) < MIN_ROWS else "too_many_rows",
            f"the flight has {len(times)} rows",
            f"give {MIN_ROWS} to {MAX_ROWS} rows; 10 ms between them are enough",
        )
        return
    for name in dict.fromkeys(angles):
        if len(columns[name]) != len(times):
            yield FileFault(
                "unequal_lengths",
                f"{called[name]} has {len(columns[name])} rows, {called['t']} has {len(times)}",
                f"give one {called[name]} for every time",
                title=name,
            )
    yield from _time_faults(times)
    for name in dict.fromkeys(angles):
        fault = angle_fault(name, columns[name], called[name])
        if fault is not None:
            yield fault


def _time_faults(times: Sequence[float]) -> Iterator[FileFault]:
    for row, (before, after) in enumerate(pairwise(times), start=1):
        if after - before < SHORTEST_STEP_S:
            yield FileFault(
                "time_not_rising",
                f"time does not increase at row {row}: it goes from {before:g} s to {after:g} s",
                f"sort the rows by time and drop repeated ones; steps must be at least {SHORTEST_STEP_S:g} s",
                row=row,
                title="t",
            )
            break
    duration_s = times[-1] - times[0]
    if duration_s > LONGEST_FLIGHT_S:
        step_s = duration_s / (len(times) - 1)
        hint = MILLISECONDS_HINT.format(step_s) if step_s > SLOW_STEP_S else TOO_LONG_HINT
        yield FileFault("too_long_a_flight", f"the flight takes {duration_s:g} s", hint, title="t")


def angle_fault(name: str, angles: Sequence[float], called: str) -> FileFault | None:
    """What is wrong with a column of angles, rad; None where nothing is."""
    limit, bound = (STEEPEST_PITCH, "pi/2") if name == "theta" else (LARGEST_ANGLE, f"{LARGEST_ANGLE:g} rad")
    row = next((row for row, angle in enumerate(angles) if abs(angle) > limit + ROUND_OFF), None)
    if row is None:
        return None
    return FileFault(
        "looks_like_degrees",
        f"{called} is {angles[row]:g} rad at row {row}, beyond {bound}",
        f"if the angles are in degrees, convert them, or name the unit in a file's title ({name}_deg)",
        row=row,
        title=name,
    )
