"""What the columns of a sample show by themselves: frozen or saturated sensors, repeated rows, gaps."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from morphcore.simulate.trajectory import Trajectory
from morphcore.validity import ResultWarning
from morphdata.measurement import ANGLES

Array = NDArray[np.float64]

MIN_RUN = 5  # rows with one value that are no coincidence
MIN_MOTION_RAD = 1e-3  # of an angle that moves at all; above what most attitude sensors resolve
MOVED_SHARE = (
    0.05  # of an angle's range: a model that moves so far while a column stands still contradicts it
)
RESOLUTION_STEPS = 3.0  # a quantised column stands still for as long as its angle stays between two steps
JUMP_STEPS = 4.0  # times the usual step of a column: no drive moves so far in one row
USUAL_PERCENTILE = 90.0  # of the steps of the rows in which a column moves
MIN_REPEATED_SHARE = 0.02  # of the rows
GAP_STEPS = 10.0  # times the usual time step
MIN_GAP_S = 0.1
GAP_MOTION = 0.2  # of a drive's range


class Run(NamedTuple):
    """Rows first..last, both included, in which a column has one value."""

    first: int
    last: int

    @property
    def rows(self) -> int:
        """How many."""
        return self.last - self.first + 1


def constant_runs(values: Array, minimum: int = MIN_RUN) -> list[Run]:
    """All runs of at least so many equal values, in their order.

    Examples
    --------
    >>> import numpy as np
    >>> constant_runs(np.array([0.0, 1.0, 1.0, 1.0, 2.0]), 3)
    [Run(first=1, last=3)]
    """
    ends = np.flatnonzero(np.diff(values) != 0.0)
    firsts, lasts = np.append(0, ends + 1), np.append(ends, values.size - 1)
    return [Run(int(a), int(b)) for a, b in zip(firsts, lasts, strict=True) if b - a + 1 >= minimum]


def column_warnings(sample: Trajectory, pointer: str, reference: Array | None) -> Iterator[ResultWarning]:
    """Look at all columns of one sample.

    Parameters
    ----------
    sample : Trajectory
    pointer : str
        To the sample in the request.
    reference : ndarray, shape (k, 3), optional
        Euler angles of a model that was flown along the sample's drives, rad; finite.
    """
    for number, name in enumerate(ANGLES):
        values = getattr(sample, name)
        found = None if reference is None else _stuck_angle(values, reference[:, number])
        yield from _stuck_warning(sample, pointer, name, found or _stuck_run_with_jump(values))
    for name in sample.drive_order:
        yield from _stuck_warning(sample, pointer, name, _stuck_run_with_jump(sample.drives[name]))
    yield from _repeated_rows(sample, pointer)
    yield from _gaps(sample, pointer)


def _stuck_angle(values: Array, reference: Array) -> Run | None:
    """The longest run in which an angle stands still although the model moves; None without any."""
    steps = np.abs(np.diff(values))
    resolution = float(steps[steps > 0.0].min(initial=np.inf))
    resolution = resolution if np.isfinite(resolution) else 0.0
    moved = max(MOVED_SHARE * np.ptp(reference), RESOLUTION_STEPS * resolution, MIN_MOTION_RAD)
    stuck = [run for run in constant_runs(values) if np.ptp(reference[run.first : run.last + 1]) > moved]
    return max(stuck, key=lambda run: run.rows, default=None)


def _stuck_run_with_jump(values: Array) -> Run | None:
    """The longest run after which a column jumps to where it has meanwhile moved to; None without any.

    A drive that pauses goes on slowly; a record that has stood still catches up in one row.
    """
    steps = np.abs(np.diff(values))
    moving = steps[steps > 0.0]
    if moving.size < MIN_RUN:
        return None
    usual = float(np.percentile(moving, USUAL_PERCENTILE))
    stuck = [
        run
        for run in constant_runs(values)
        if run.last + 1 < values.size and steps[run.last] > JUMP_STEPS * usual
    ]
    return max(stuck, key=lambda run: run.rows, default=None)


def _stuck_warning(sample: Trajectory, pointer: str, name: str, run: Run | None) -> Iterator[ResultWarning]:
    if run is None:
        return
    values = sample.drives[name] if name in sample.drives else getattr(sample, name)
    at, unit = f"{pointer}/{sample.field_of(name)}", sample.units.get(name, "rad")
    value = float(values[run.first])
    if run.rows == values.size:
        yield ResultWarning(
            "frozen_column",
            f"the column {name} of sample {sample.name!r} has one value in all rows although the aircraft "
            "turns",
            f"look whether {name} was recorded; a sensor that was off makes the flight useless",
            at,
        )
        return
    begin, end = (float(sample.time_s[row]) for row in (run.first, run.last))
    extreme = value in (values.max(), values.min())
    jumps = run.last + 1 < values.size and _stuck_run_with_jump(values) == run
    if extreme and not jumps:
        end_of_range = "largest" if value == values.max() else "smallest"
        yield ResultWarning(
            "clipped_column",
            f"the column {name} of sample {sample.name!r} stays at its {end_of_range} value, "
            f"{value:.4g} {unit}, from {begin:.2f} s to {end:.2f} s although the aircraft turns on",
            "the sensor or the record is probably saturated (clipped) there: leave those rows out, or record "
            "the flight with a wider range",
            at,
        )
        return
    yield ResultWarning(
        "frozen_column",
        f"the column {name} of sample {sample.name!r} stands still at {value:.4g} {unit} from {begin:.2f} s "
        f"to {end:.2f} s while the aircraft moves",
        "the record is probably frozen there (a lost link, a sensor that hangs): leave those rows out",
        at,
    )


def _repeated_rows(sample: Trajectory, pointer: str) -> Iterator[ResultWarning]:
    """Rows in the midst of a morph that repeat the one before in every column."""
    if not sample.drives:
        return
    driven = np.any(np.diff(np.column_stack([*sample.drives.values()]), axis=0) != 0.0, axis=1)
    moving = np.flatnonzero(driven)
    if moving.size < MIN_RUN:
        return
    turned = np.any(np.diff(sample.euler, axis=0) != 0.0, axis=1)
    inside = (driven | turned)[moving[0] : moving[-1] + 1]
    repeated = int((~inside).sum())
    if repeated > max(MIN_RUN, MIN_REPEATED_SHARE * inside.size):
        yield ResultWarning(
            "repeated_rows",
            f"{repeated} of {sample.time_s.size} rows of sample {sample.name!r} repeat the row before",
            "a logger that runs faster than its sensors does that: it is harmless unless the sensors hung; "
            "give each measurement once",
            pointer,
        )


def _gaps(sample: Trajectory, pointer: str) -> Iterator[ResultWarning]:
    """A gap in the rows across which a drive goes far: what it did between is unknown."""
    steps = np.diff(sample.time_s)
    widest = int(np.argmax(steps))
    if steps[widest] <= max(GAP_STEPS * float(np.median(steps)), MIN_GAP_S):
        return
    for name in sample.drive_order:
        angle = sample.drives[name]
        if abs(angle[widest + 1] - angle[widest]) > max(GAP_MOTION * np.ptp(angle), MIN_MOTION_RAD):
            yield ResultWarning(
                "gap",
                f"no rows for {steps[widest]:.2f} s after t = {sample.time_s[widest]:.2f} s in sample "
                f"{sample.name!r}, in which {name} goes from {angle[widest]:.3g} to "
                f"{angle[widest + 1]:.3g} rad",
                "what the drive did meanwhile is guessed: split the flight there, or give the missing rows",
                f"{pointer}/time_s/{widest + 1}",
            )
            return
