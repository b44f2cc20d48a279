"""What is probably wrong with samples that no model flies well, or whose columns contradict each other.

Each diagnosis is a warning with a hint that is true for the case at hand. Columns are looked at first, then
the flights that are there anyway (rigid, guessed, identified); only where the fit is poor are other readings
of the samples flown (`readings`). Another reading is named where it lowers the cost tenfold.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from morphcore.errors import InvalidInput
from morphcore.frames import wrap_angle
from morphcore.identify.column_checks import MIN_MOTION_RAD, column_warnings, constant_runs
from morphcore.identify.cost import SampleCase, sample_cases
from morphcore.identify.other_readings import (
    HALF,
    TENFOLD,
    angle_costs,
    attitude_cost,
    drive_readings,
    flown_guess,
    refitted,
)
from morphcore.identify.sample_fit import ANGLES, SampleFit
from morphcore.simulate.trajectory import Trajectory
from morphcore.validity import ResultWarning

if TYPE_CHECKING:
    from morphcore.identify.identification import Identification

Array = NDArray[np.float64]

# wrong data: whatever the fit looks like, its parameters are not the aircraft's
WRONG_DATA = frozenset(
    {
        "looks_like_degrees",
        "flipped_sign",
        "swapped_sides",
        "late",
        "clipped_column",
        "frozen_column",
        "wrong_aircraft",
    }
)
POOR_SHARE = 0.05  # of the motion, rms: no equivalent model that fits leaves so much
LATE_SHARE = 0.005  # chains of two links and more leave a thousandth; a delay of 20 ms leaves this much
UNLIKE_SHARE = 0.03
MIN_DELAY_S = 0.005  # half a row of most records
OFF_TRIM_RAD = 0.01  # above the bias of attitude sensors
MOVING_START_RAD_S = 0.02
START_ROWS = 10
SIGNIFICANT = 5.0  # standard errors
STILL_SHARE = 0.01  # of a drive's range: has not moved yet
EXTREME_LIFT = 2.0  # search units from the neutral lift factor: 0.6 or 1.4
CONTINUED = (1.1, 1.2, 1.35, 1.5, 1.75, 2.0)  # times the recorded travel of a drive that was cut off
FOURFOLD = 4.0  # the cost by which a continued drive must be better: its true end is only guessed
ABRUPT = 0.5  # of a drive's largest rate, in the last step before it stops


def diagnoses(
    run: Identification, fits: Sequence[SampleFit], best: Array, *, fly: bool = True
) -> tuple[ResultWarning, ...]:
    """Diagnose all samples of an identification.

    Parameters
    ----------
    run : Identification
    fits : sequence of SampleFit
        Of its samples, in their order.
    best : ndarray, shape (d,)
        The best search point.
    fly : bool
        Whether other readings of the samples may be flown; who waits for a stopped search has no time.
    """
    found: list[ResultWarning] = []
    for number, fit in enumerate(fits):
        pointer = f"/samples/{number}"
        found += column_warnings(fit.case.sample, pointer, _reference(fit))
        found += _angle_warnings(fit, pointer)
    if fly and not _explained(found):
        for number, fit in enumerate(fits):
            found += _drive_warnings(run, fit, f"/samples/{number}")
    trained = [(number, fit) for number, fit in enumerate(fits) if fit.case.sample.role == "train"]
    flies = all(np.all(np.isfinite(fit.identified)) for _, fit in trained)
    chain = run.space.dimension > 0 and run.model.links_per_wing > 1
    if fly and flies and chain and not _explained(found):
        share = max(error_share(fit) for _, fit in trained)
        if share > LATE_SHARE:
            found += _late_warnings(run, trained, best)
        if share > LATE_SHARE and not _explained(found):
            found += _cut_off_warnings(run, trained, best)
    if not _explained(found):
        found += _wrong_aircraft(run, trained, best)
    if not _explained(found):
        for number, fit in enumerate(fits):
            found += _start_warnings(fit, f"/samples/{number}")
    return tuple(found)


def error_share(fit: SampleFit, model: str = "identified") -> float:
    """Error that a model leaves, as a part of the motion, both rms, without white noise; inf if it diverged.

    White noise is what neighbouring rows do not share: the mean product of neighbours is free of it.
    """
    errors, motion = fit.errors(model), wrap_angle(fit.case.sample.euler - fit.case.sample.euler[0])
    if not np.all(np.isfinite(errors)):
        return float("inf")
    structured = float(np.sum(errors[1:] * errors[:-1])) / (errors.shape[0] - 1)
    size = float(np.sum(motion**2)) / motion.shape[0]
    return float(np.sqrt(max(structured, 0.0) / size)) if size > 0.0 else float("inf")


def _explained(found: Sequence[ResultWarning]) -> bool:
    return any(warning.code in WRONG_DATA for warning in found)


def _reference(fit: SampleFit) -> Array | None:
    """Attitudes of a model that knows nothing of the sample's: the physical guess, else the rigid one."""
    return next((flown for flown in (fit.initial, fit.rigid) if np.all(np.isfinite(flown))), None)


# measured angles


def _angle_warnings(fit: SampleFit, pointer: str) -> Iterator[ResultWarning]:
    """Units and signs of the measured angles, by flights that were flown anyway."""
    reference, sample = _reference(fit), fit.case.sample
    if reference is None:
        return
    readings = _other_readings(fit, reference)
    degrees = [name for name, reading in readings.items() if reading.endswith("degrees")]
    negated = [name for name, reading in readings.items() if reading.startswith("negated")]
    if degrees:
        yield ResultWarning(
            "looks_like_degrees",
            f"the angles {_listed(degrees)} of sample {sample.name!r} fit if they are read as "
            "degrees, and not as rad",
            f"give them in rad, or name the columns {', '.join(f'{name}_deg' for name in degrees)}",
            pointer if len(degrees) > 1 else f"{pointer}/{degrees[0]}_rad",
        )
    if negated == ["phi", "psi"]:
        yield ResultWarning(
            "swapped_sides",
            f"left and right are probably swapped in sample {sample.name!r}: the aircraft rolls and yaws "
            "to the other side than its drives make it",
            "exchange the columns of the left and the right drives, or change the signs of both phi and psi",
            pointer,
        )
    elif negated:
        yield ResultWarning(
            "flipped_sign",
            f"the sign of {_listed(negated)} in sample {sample.name!r} is probably wrong: with the opposite "
            "one the aircraft does what the model does",
            f"change the sign of {_listed(negated)}: roll to the right, nose up and nose to the right are "
            "positive",
            pointer if len(negated) > 1 else f"{pointer}/{negated[0]}_rad",
        )


def _other_readings(fit: SampleFit, reference: Array) -> dict[str, str]:
    """The reading of each angle that fits tenfold better than as it is given; "" where there is none.

    A model that does something else altogether proves nothing: with the best reading of every angle it must
    follow the sample.
    """
    sample, found = fit.case.sample, {}
    left, motion = 0.0, 0.0
    for number, name in enumerate(ANGLES):
        costs = angle_costs(sample, reference, number)
        given = costs.pop("given")
        best = min(costs, key=lambda each: costs[each])
        fitted = angle_costs(sample, fit.identified, number)["given"]
        clear = TENFOLD * costs[best] < given and given > sample.time_s.size * MIN_MOTION_RAD**2
        missed = not np.isfinite(fitted) or fitted > costs[best]
        found[name] = best if clear and missed else ""
        turned = np.unwrap(sample.euler[:, number]) - sample.euler[0, number]
        left += costs[best] if found[name] else given
        motion += float(np.sum((np.radians(turned) if found[name].endswith("degrees") else turned) ** 2))
    return found if left < HALF**2 * motion else dict.fromkeys(ANGLES, "")


# drives


def _drive_warnings(run: Identification, fit: SampleFit, pointer: str) -> Iterator[ResultWarning]:
    """Units, signs and sides of drives: each reading is flown by the physical guess."""
    sample = fit.case.sample
    # a rigid model leaves what bending does; a chain does not
    if not error_share(fit) > (POOR_SHARE if run.model.links_per_wing > 1 else HALF):
        return
    given = min(attitude_cost(sample, flown) for flown in (fit.initial, fit.identified))
    motion = float(np.sum(wrap_angle(sample.euler - sample.euler[0]) ** 2))
    costs = {
        reading: attitude_cost(sample, flown_guess(run, reading.change(sample)))
        for reading in drive_readings(sample)
    }
    best = min(costs, key=lambda reading: costs[reading], default=None)
    if best is None or TENFOLD * costs[best] >= given or costs[best] > HALF**2 * motion:
        return
    yield ResultWarning(
        best.code, best.message.format(name=f"sample {sample.name!r}"), best.hint, f"{pointer}/{best.column}"
    )


def _late_warnings(
    run: Identification, trained: Sequence[tuple[int, SampleFit]], best: Array
) -> Iterator[ResultWarning]:
    """Attitudes that come later than the drives: a descent may shift them."""
    found = refitted(run, best, delays=True)
    if TENFOLD * found.cost >= _weighted_cost(trained):
        return
    for (number, fit), delay_s in zip(trained, found.delay_s, strict=True):
        if abs(delay_s) >= MIN_DELAY_S:
            yield late_warning(fit.case.sample.name, f"/samples/{number}", float(delay_s))


def late_warning(name: str, pointer: str, delay_s: float) -> ResultWarning:
    """The warning of attitudes that come a time after the drives that cause them."""
    after = "after" if delay_s > 0.0 else "before"
    return ResultWarning(
        "late",
        f"the attitude in sample {name!r} comes about {1e3 * abs(delay_s):.0f} ms {after} what the drives do",
        "synchronise the clocks of the recorders, or shift the time of one of them by so much",
        pointer,
    )


def _cut_off_warnings(
    run: Identification, trained: Sequence[tuple[int, SampleFit]], best: Array
) -> Iterator[ResultWarning]:
    """Drives whose record stops abruptly at a largest value, if the aircraft flies as if they had gone on."""
    stopped = {number: _abrupt_stops(fit.case.sample) for number, fit in trained}
    if not any(stopped.values()):
        return
    cost = _weighted_cost(trained)
    for factor in CONTINUED:
        cases = []
        for number, fit in trained:
            case = _continued(run, fit.case, stopped[number], factor)
            if case is None:
                return
            cases.append(case)
        if FOURFOLD * refitted(run, best, cases).cost < cost:
            for number, fit in trained:
                for name, row in stopped[number].items():
                    yield _cut_off_warning(fit.case.sample, f"/samples/{number}", name, row)
            return


def _cut_off_warning(sample: Trajectory, pointer: str, name: str, row: int) -> ResultWarning:
    angle, time_s = float(sample.drives[name][row]), float(sample.time_s[row])
    return ResultWarning(
        "clipped_column",
        f"the drive {name} of sample {sample.name!r} stops abruptly at {angle:.4g} rad at t = {time_s:.2f} s,"
        " but the aircraft moves as if it went on",
        "the sensor or the record is probably saturated (clipped) there: leave out the rows after it, or "
        "record the flight with a wider range",
        f"{pointer}/{name}_rad/{row}",
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
        )
    except InvalidInput:  # beyond the range of a hinge, where no drive went
        return None
    return found


def _weighted_cost(trained: Sequence[tuple[int, SampleFit]]) -> float:
    return float(sum(np.sum((fit.errors("identified") * fit.case.weight) ** 2) for _, fit in trained))


# the aircraft and the start


def _wrong_aircraft(
    run: Identification, trained: Sequence[tuple[int, SampleFit]], best: Array
) -> Iterator[ResultWarning]:
    """Flights that no model of this aircraft flies, or only with a lift that it does not have."""
    number, worst = max(trained, key=lambda each: error_share(each[1]))
    share = error_share(worst)
    hint = (
        "check that aircraft, flight condition and samples belong together: mass, span, chord, hinge "
        "positions, airspeed, air density"
    )
    if run.model.links_per_wing > 1 and UNLIKE_SHARE < share < np.inf:
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
            hint,
            f"/samples/{number}",
        )
    for name, x in zip(run.space.names, best - run.space.guess, strict=True):
        if name.split(".")[-1] == "lift_factor" and abs(x) >= EXTREME_LIFT:
            value = float(run.space.decode(best[None, :])["lift_factor"].flat[0])
            yield ResultWarning(
                "wrong_aircraft",
                f"the flights need a lift of {value:.2f} times that of this aircraft",
                hint,
                "/aircraft",
            )


def _start_warnings(fit: SampleFit, pointer: str) -> Iterator[ResultWarning]:
    """Samples that do not begin in the trimmed flight that models begin in."""
    sample = fit.case.sample
    if not np.all(np.isfinite(fit.identified[0])):
        return
    off = abs(float(sample.theta[0] - fit.identified[0, 1]))
    hint = (
        "begin the sample in steady, level flight before the drives move, or give the start in flight.start"
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
        rate, error = _slope(sample.time_s[rows], getattr(sample, name)[rows])
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


def _listed(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
