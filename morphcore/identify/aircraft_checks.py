"""Flights of another aircraft, and flights that do not begin in trim."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from morphcore.identify.column_checks import MIN_MOTION_RAD
from morphcore.identify.sample_fit import SampleFit
from morphcore.validity import ResultWarning
from morphdata.measurement import ANGLES

if TYPE_CHECKING:
    from morphcore.identify.identification import Identification

Array = NDArray[np.float64]

WRONG_AIRCRAFT_HINT = (
    "check that aircraft, flight condition and samples belong together: mass, span, chord, hinge positions, "
    "airspeed, air density"
)
UNLIKE_SHARE = 0.03
OFF_TRIM_RAD = 0.01  # above the bias of attitude sensors
MOVING_START_RAD_S = 0.02
START_ROWS = 10
SIGNIFICANT = 5.0  # standard errors
STILL_SHARE = 0.01  # of a drive's range: has not moved yet
EXTREME_LIFT = 2.0  # search units from the neutral lift factor: 0.6 or 1.4


def wrong_aircraft(
    run: Identification, trained: Sequence[tuple[int, SampleFit]], best: Array
) -> Iterator[ResultWarning]:
    """Flights that no model of this aircraft flies, or only with a lift that it does not have."""
    number, worst = max(trained, key=lambda each: each[1].error_share())
    share = worst.error_share()
    if run.model.links_per_wing != 1 and UNLIKE_SHARE < share < np.inf:
        start = abs(float(worst.case.sample.theta[0] - worst.initial[0, 1]))
        off = (
            f", and it would begin the flight pitched by {start:.3f} rad otherwise"
            if start > OFF_TRIM_RAD
            else ""
        )
        J, J_rigid = worst.J("identified"), worst.J("rigid")
        of_rigid = f" ({J / J_rigid:.2g} of the rigid model's J)" if J is not None and J_rigid else ""
        yield ResultWarning(
            "wrong_aircraft",
            f"no model of this aircraft flies sample {worst.case.sample.name!r}: {100.0 * share:.0f} per "
            f"cent of its motion is missed{of_rigid}{off}",
            WRONG_AIRCRAFT_HINT,
            f"/samples/{number}",
        )
    for name, x in zip(run.space.names, best - run.space.guess, strict=True):
        if name.split(".")[-1] == "lift_factor" and abs(x) >= EXTREME_LIFT:
            values = run.space.flatten(run.space.decode(best[None, :]))[0]
            value = values[run.space.parameter_names.index(name)]
            whose = name.rpartition(".")[0] or "this aircraft"
            yield ResultWarning(
                "wrong_aircraft",
                f"the flights need a lift of {value:.2f} times that of {whose}",
                WRONG_AIRCRAFT_HINT,
                "/aircraft",
            )


def start_warnings(fit: SampleFit, pointer: str) -> Iterator[ResultWarning]:
    """Samples that do not begin in the steady flight that models begin in."""
    sample = fit.case.sample
    if not np.all(np.isfinite(fit.identified[0])):
        return
    off = abs(float(sample.theta[0] - fit.identified[0, 1]))
    hint = (
        "begin the sample in the flight's steady motion (level, unless it says otherwise) before the drives "
        "move, or give the start in flight.start"
    )
    if off > OFF_TRIM_RAD and off > 0.1 * float(np.ptp(sample.theta)):
        yield ResultWarning(
            "start_off_trim",
            f"sample {sample.name!r} begins with a pitch angle of {sample.theta[0]:.3f} rad, where the "
            f"model is trimmed at {fit.identified[0, 1]:.3f} rad",
            hint,
            f"{pointer}/theta_rad/0",
        )
    rows = slice(START_ROWS)
    still = all(
        np.ptp(angle[rows]) <= STILL_SHARE * max(np.ptp(angle), MIN_MOTION_RAD)
        for angle in sample.drives.values()
    )
    if not still or sample.time_s.size <= START_ROWS:
        return
    for name in ANGLES:
        rate, error = _slope(sample.time_s[rows], np.unwrap(getattr(sample, name)[rows]))
        if name == "psi":
            rate -= fit.case.turn_rate_rad_s
        if abs(rate) > max(MOVING_START_RAD_S, SIGNIFICANT * error):
            yield ResultWarning(
                "start_off_trim",
                f"the angle {name} of sample {sample.name!r} changes by {rate:.3f} rad/s before the drives "
                "move",
                hint,
                f"{pointer}/{name}_rad",
            )


def _slope(time_s: Array, values: Array) -> tuple[float, float]:
    """Slope of a straight line through values, and its standard error."""
    t = time_s - time_s.mean()
    power = float(t @ t)
    rate = float(t @ values) / power
    left = values - values.mean() - rate * t
    return rate, float(np.sqrt(left @ left / max(values.size - 2, 1) / power))
