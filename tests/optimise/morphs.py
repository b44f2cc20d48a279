"""Morphs to optimise: the example aircraft, and short ones whose flights take milliseconds."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.optimise import ScheduleOptimisation, Step
from morphcore.optimise.settings import ScheduleSettings
from morphcore.simulate.schedule import Spline
from morphdata.optimize import Limits, Morph
from tests.identify.flights import reference_aircraft, reference_flight

Array = NDArray[np.float64]

SHORT = Morph(final_rad=0.4, duration_s=0.8, settle_s=0.2)  # mean rate 0.5 rad/s
QUICK = ScheduleSettings(seed=3, screen=2, starts=2, iterations=2)


def optimisation(
    morph: Morph = SHORT,
    limits: Limits = Limits(max_rate_rad_s=0.9),  # noqa: B008 - frozen
    *,
    links: int = 1,
    search: ScheduleSettings = QUICK,
    **options: Any,
) -> ScheduleOptimisation:
    """An optimisation with the physical guess of the reference aircraft; flexible flights only on request."""
    parameters = physical_guess(chain_model(reference_aircraft(), reference_flight(), links))
    return ScheduleOptimisation(
        reference_aircraft(),
        reference_flight(),
        parameters,
        **{"morph": morph, "limits": limits, "search": search, "verify": "none", **options},
    )


def last(run: ScheduleOptimisation, checkpoint: bytes | None = None) -> Step:
    """The last step of a run."""
    *_, step = run.steps(checkpoint)
    return step


def sampled(schedule: Spline, points: int = 20_001) -> tuple[Array, Array, Array]:
    """Angle, rate and acceleration of a schedule at many times, by scipy."""
    cubic = CubicSpline(schedule.knot_time_s, schedule.knot_angle_rad, bc_type="clamped")
    times = np.linspace(schedule.knot_time_s[0], schedule.knot_time_s[-1], points)
    return cubic(times), cubic(times, 1), cubic(times, 2)
