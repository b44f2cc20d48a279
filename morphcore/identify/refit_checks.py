"""Attitudes that come late and drives that were cut off: what a few steps of a descent can tell."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from morphcore.errors import InvalidInput
from morphcore.identify.aircraft_checks import WRONG_AIRCRAFT_HINT
from morphcore.identify.column_checks import constant_runs
from morphcore.identify.cost import SampleCase, costs, sample_cases
from morphcore.identify.other_readings import TENFOLD, delayed, fitted_delays, refitted
from morphcore.identify.sample_fit import SampleFit
from morphcore.simulate.trajectory import Trajectory
from morphcore.validity import ResultWarning
from morphdata.measurement import ANGLES

if TYPE_CHECKING:
    from morphcore.identify.identification import Identification

Array = NDArray[np.float64]

LONG_DELAY_S = 0.025  # beyond what recorders of one aircraft should be apart
LARGE_BIAS_RAD = 0.02  # beyond what an attitude sensor should be off
IMPOSSIBLE_BIAS_RAD = 0.06  # 3.4 degrees
MIN_DELAY_S = 0.005  # half a row of most records
CONTINUED = (1.1, 1.2, 1.35, 1.5, 1.75, 2.0)  # times the recorded travel of a drive that was cut off
FOURFOLD = 4.0  # the cost by which a continued drive must be better: its true end is only guessed
ABRUPT = 0.5  # of a drive's largest rate, in the last step before it stops


def measurement_warnings(
    fits: Sequence[SampleFit], measurement: Mapping[str, Any]
) -> Iterator[ResultWarning]:
    """Delays and biases that the fit has allowed for, and that are larger than they should be."""
    for number, fit in enumerate(fits):
        sample = fit.case.sample
        found, pointer = measurement.get(sample.name) or {}, f"/samples/{number}"
        delay_s = (found.get("delay_s") or {}).get("value") or 0.0
        if abs(delay_s) > LONG_DELAY_S:
            yield late_warning(sample.name, pointer, delay_s, allowed_for=True)
        for name in ANGLES[:2]:  # the bias of yaw is the heading
            bias = ((found.get("bias") or {}).get(name) or {}).get("value") or 0.0
            if abs(bias) > IMPOSSIBLE_BIAS_RAD:
                yield ResultWarning(
                    "wrong_aircraft",
                    f"sample {sample.name!r} fits only with a sensor that shows {name} wrong by "
                    f"{1e3 * bias:.0f} mrad, which none does",
                    WRONG_AIRCRAFT_HINT,
                    pointer,
                )
            elif abs(bias) > LARGE_BIAS_RAD:
                yield ResultWarning(
                    "large_bias",
                    f"the angle {name} of sample {sample.name!r} reads {1e3 * bias:.0f} mrad more than "
                    "the model has",
                    "a sensor that is mounted askew does that, and so does a flight that begins off its "
                    "trim, or another aircraft: check them",
                    f"{pointer}/{name}_rad",
                )


def late_warnings(
    run: Identification, trained: Sequence[tuple[int, SampleFit]], best: Array
) -> Iterator[ResultWarning]:
    """Attitudes that come later than the drives where the fit was not free to shift them."""
    if any(case.setup.openness.delay for case in run.training):  # it is among the measurement's
        return
    cases = delayed(run.training)
    cost, point = refitted(run, best, cases)
    if TENFOLD * cost >= _cost(run, best):
        return
    for (number, fit), delay_s in zip(trained, fitted_delays(run, point, cases), strict=True):
        if abs(delay_s) >= MIN_DELAY_S:
            yield late_warning(fit.case.sample.name, f"/samples/{number}", delay_s)


def late_warning(name: str, pointer: str, delay_s: float, *, allowed_for: bool = False) -> ResultWarning:
    """The warning of attitudes that come a time after the drives that cause them."""
    after = "after" if delay_s > 0.0 else "before"
    allowance = ", which the fit has allowed for" if allowed_for else ""
    return ResultWarning(
        "late",
        f"the attitude in sample {name!r} comes about {1e3 * abs(delay_s):.0f} ms {after} what the drives do"
        f"{allowance}",
        "synchronise the clocks of the recorders, or shift the time of one of them by so much",
        pointer,
    )


def cut_off_warnings(
    run: Identification, trained: Sequence[tuple[int, SampleFit]], best: Array
) -> Iterator[ResultWarning]:
    """Drives whose record stops abruptly at a largest value, if the aircraft flies as if they had gone on."""
    stopped = {number: _abrupt_stops(fit.case.sample) for number, fit in trained}
    if not any(stopped.values()):
        return
    cost = _cost(run, best)
    for factor in CONTINUED:
        cases = []
        for number, fit in trained:
            case = _continued(run, fit.case, stopped[number], factor)
            if case is None:
                return
            cases.append(case)
        if FOURFOLD * refitted(run, best, cases)[0] < cost:
            for number, fit in trained:
                for name, row in stopped[number].items():
                    yield _cut_off_warning(fit.case.sample, f"/samples/{number}", name, row)
            return


def _cut_off_warning(sample: Trajectory, pointer: str, name: str, row: int) -> ResultWarning:
    angle, time_s = float(sample.drives[name][row]), float(sample.time_s[row])
    unit = sample.units.get(name, "rad")
    return ResultWarning(
        "clipped_column",
        f"the drive {name} of sample {sample.name!r} stops abruptly at {angle:.4g} {unit} at t = "
        f"{time_s:.2f} s, but the aircraft moves as if it went on",
        "the sensor or the record is probably saturated (clipped) there: leave out the rows after it, or "
        "record the flight with a wider range",
        f"{pointer}/{sample.field_of(name)}/{row}",
    )


def _abrupt_stops(sample: Trajectory) -> dict[str, int]:
    """Rows at which drives stop at full rate and stay to the end."""
    found = {}
    for name, angle in sample.drives.items():
        runs = constant_runs(angle)
        if not runs or runs[-1].last != angle.size - 1 or runs[-1].first < 2:
            continue
        rates = np.abs(np.diff(angle) / np.diff(sample.time_s))
        row = runs[-1].first
        # the last step before the stop ends somewhere within it
        if max(rates[row - 1], rates[row - 2]) > ABRUPT * rates.max():
            found[name] = row
    return found


def _continued(
    run: Identification, case: SampleCase, stops: dict[str, int], factor: float
) -> SampleCase | None:
    """A sample whose stopped drives went on at their rate to some times their travel; None beyond a hinge."""
    sample, drives = case.sample, dict(case.sample.drives)
    for name, row in stops.items():
        angle, time_s = drives[name], sample.time_s
        rate = (angle[row - 1] - angle[row - 2]) / (time_s[row - 1] - time_s[row - 2])
        gone_on = angle[row - 1] + rate * (time_s - time_s[row - 1])
        end = angle[0] + factor * (angle[row] - angle[0])
        held = np.minimum(gone_on, end) if rate > 0.0 else np.maximum(gone_on, end)
        drives[name] = np.where(np.arange(angle.size) >= row, held, angle)
    try:
        (found,) = sample_cases(
            run.model,
            [replace(sample, drives=drives)],
            run.step_s,
            separate_wings=run.settings.separate_wings,
            start=run.settings.start,
        )
    except InvalidInput:  # beyond the range of a hinge, where no drive went
        return None
    return replace(found, given=case.given)


def _cost(run: Identification, best: Array) -> float:
    return float(costs(run.model, run.space.decode(best[None, :]), run.training, run.settings.start)[0])
