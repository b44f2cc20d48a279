"""The times of a flight: equal steps that contain the output times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

# keeps attitude within 1e-4 rad of the converged solution on the reference aircraft (tests/simulate)
STEP_S = 0.01


@dataclass(frozen=True)
class TimeGrid:
    """Equal steps from ``start_s``; rows ``at`` of the grid are the output times (None: they differ)."""

    start_s: float
    step_s: float
    steps: int
    at: NDArray[np.int64] | None

    @property
    def times_s(self) -> Array:
        """(steps + 1,) times."""
        return np.asarray(self.start_s + self.step_s * np.arange(self.steps + 1), dtype=np.float64)

    @property
    def middles_s(self) -> Array:
        """(steps,) times in the middles of the steps."""
        return np.asarray(self.start_s + self.step_s * (np.arange(self.steps) + 0.5), dtype=np.float64)

    @property
    def halves_s(self) -> Array:
        """(2 steps + 1,) times and middles in alternation."""
        times = np.empty(2 * self.steps + 1)
        times[::2], times[1::2] = self.times_s, self.middles_s
        return times

    def halved(self, times: int = 1) -> TimeGrid:
        """The grid with all steps halved ``times`` times."""
        parts = 2**times
        at = None if self.at is None else self.at * parts
        return TimeGrid(self.start_s, self.step_s / parts, self.steps * parts, at)


def time_grid(output_s: ArrayLike, longest_step_s: float = STEP_S) -> TimeGrid:
    """Make a grid that contains even output times; uneven ones need interpolation (``at`` is None)."""
    times = np.asarray(output_s, dtype=np.float64)
    spacing = (times[-1] - times[0]) / (times.size - 1)
    if np.allclose(np.diff(times), spacing, rtol=1e-6, atol=1e-9):
        substeps = int(np.ceil(spacing / longest_step_s - 1e-9))
        steps = substeps * (times.size - 1)
        return TimeGrid(float(times[0]), spacing / substeps, steps, np.arange(times.size) * substeps)
    steps = int(np.ceil((times[-1] - times[0]) / longest_step_s - 1e-9))
    return TimeGrid(float(times[0]), float(times[-1] - times[0]) / steps, steps, None)
