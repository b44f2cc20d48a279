"""Other readings of a sample, and whether a model flies them better: wrong units, signs, sides, delays.

A reading changes the columns of a sample as a mistake in a conversion would have. Where only measured angles
change, the flights that are known already tell; where the drives or the time change, the physical guess is
flown along them, one flight each; a delay is searched together with the parameters in a few steps of a
descent.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from morphcore.errors import InvalidInput, TrimNotFound
from morphcore.frames import wrap_angle
from morphcore.identify.cost import DIVERGED_ANGLE, SampleCase, fly_attitudes, sample_cases, shared_trims
from morphcore.search.least_squares import FixedPrior, LeastSquares
from morphcore.search.solver import Batch, Box, Outcome
from morphcore.simulate.plan import STEP_S
from morphcore.simulate.trajectory import Trajectory
from morphdata.drives import SIDES

if TYPE_CHECKING:
    from morphcore.identify.identification import Identification

Array = NDArray[np.float64]
Change = Callable[[Trajectory], Trajectory]

HALF = 0.5  # of the motion, rms: what another reading may leave at most to be believed
TENFOLD = 10.0  # the cost by which another reading must be better to be named
HEADING = 2  # the angle that is measured from any direction
DELAY_UNIT_S = 0.05  # of the search coordinate of a delay
LONGEST_DELAY_S = 0.3
DESCENT_STEPS = 4
MILLI = 1e-3
SLOW_STEP_S, FAST_STEP_S = 0.5, 1e-4  # of rows that hardly are of a flight: nobody records morphs so
SMALL_ANGLE_RAD = 0.1  # a largest drive angle below it may be degrees that were converted twice


@dataclass(frozen=True)
class Reading:
    """Another way to read a sample's drives or its time.

    Attributes
    ----------
    code : str
        Of the warning.
    change : callable
        Makes the sample that was probably meant of the one that was given.
    message, hint : str
        What is the matter with ``{name}``, and what to do.
    column : str
        In the request, below the sample.
    """

    code: str
    change: Change
    message: str
    hint: str
    column: str


def angle_costs(sample: Trajectory, flown: Array, number: int) -> dict[str, float]:
    """Squared errors of one angle, rad^2, as it is given and in other readings.

    Parameters
    ----------
    sample : Trajectory
    flown : ndarray, shape (k, 3)
        Euler angles of a model along the sample's drives, rad.
    number : int
        Of the angle.
    """
    measured, modelled = sample.euler[:, number], flown[:, number]
    if number == HEADING:  # a model begins with the measured heading, right or wrong
        measured, modelled = np.unwrap(measured), np.unwrap(modelled)
        measured, modelled = measured - measured[0], modelled - modelled[0]

    def cost(reading: Array) -> float:
        return float(np.sum(wrap_angle(modelled - reading) ** 2))

    return {
        "given": float(np.sum((modelled - measured) ** 2)),
        "negated": cost(-measured),
        "degrees": float(np.sum((modelled - np.radians(measured)) ** 2)),
        "negated degrees": float(np.sum((modelled + np.radians(measured)) ** 2)),
    }


def drive_readings(sample: Trajectory) -> list[Reading]:
    """The mistakes with drives that a sample may have been made with."""
    found = []
    words = _words(sample)
    for names in words.values():
        found += _unit_readings(sample, names)
        found.append(_flipped(names))
        if len(names) > 1:
            found += [_flipped([name]) for name in names]
    if any(len(names) > 1 for names in words.values()):
        found.append(
            Reading(
                "swapped_sides",
                _swapped,
                "left and right are probably swapped in {name}: with the drives exchanged the model flies it",
                "exchange the columns of the left and the right drives, or change the signs of phi and psi",
                "phi_rad",
            )
        )
    return found


def _time_readings(sample: Trajectory) -> list[Reading]:
    step_s = float(np.median(np.diff(sample.time_s)))
    if step_s > SLOW_STEP_S:
        return [
            Reading(
                "milliseconds",
                lambda given: replace(given, time_s=MILLI * given.time_s),
                f"the rows of {{name}} are {step_s:.3g} s apart, which looks like milliseconds: read as "
                "such, the model flies it",
                "give the time in seconds, or name the column t_ms",
                "time_s",
            )
        ]
    if step_s < FAST_STEP_S:
        return [
            Reading(
                "seconds_as_milliseconds",
                lambda given: replace(given, time_s=given.time_s / MILLI),
                f"the rows of {{name}} are {step_s:.3g} s apart: with a time a thousand times longer "
                "the model flies it",
                "a column t_ms that holds seconds should be called t",
                "time_s",
            )
        ]
    return []


def _unit_readings(sample: Trajectory, names: Sequence[str]) -> list[Reading]:
    largest = max(float(np.abs(sample.drives[name]).max()) for name in names)
    if largest > SMALL_ANGLE_RAD:
        factor, said, hint = (
            np.pi / 180.0,
            "hold degrees that are read as rad",
            f"name them {names[0]}_deg, ...",
        )
    else:
        factor, said, hint = 180.0 / np.pi, "hold rad that are read as degrees", "do not name them ..._deg"
    return [
        Reading(
            "looks_like_degrees",
            lambda given: _moved(given, names, lambda angle: factor * angle),
            f"the drives {' and '.join(names)} of {{name}} probably {said}: with the other unit "
            "the model flies it",
            f"check the unit of the drives: {hint}",
            f"{names[0]}_rad",
        )
    ]


def _flipped(names: Sequence[str]) -> Reading:
    label = " and ".join(names)
    return Reading(
        "flipped_sign",
        lambda given: _moved(given, names, lambda angle: -angle),
        f"the sign of {label} is probably wrong in {{name}}: with the opposite one the model flies it",
        f"change the sign of {label}, or check the axis of the hinges in the aircraft",
        f"{names[0]}_rad",
    )


def require_seconds(run: Identification) -> None:
    """Refuse samples whose time is in another unit, before a search flies them for minutes.

    Raises
    ------
    InvalidInput
        The rows of a sample are seconds apart, or hardly apart, and with a time in the right unit the
        physical guess flies the sample.
    """
    for number, sample in enumerate(run.samples):
        for reading in _time_readings(sample):
            flown = flown_guess(run, reading.change(sample), STEP_S)
            if flown is None:
                continue
            moved = wrap_angle(
                sample.euler - sample.euler[0]
            )  # a trim that is a little off is no matter here
            if np.sum(wrap_angle(flown - flown[0] - moved) ** 2) < HALF**2 * np.sum(moved**2):
                raise InvalidInput(
                    reading.message.format(name=f"sample {sample.name!r}"),
                    pointer=f"/samples/{number}/{reading.column}",
                    hint=reading.hint,
                )


def flown_guess(run: Identification, sample: Trajectory, step_s: float | None = None) -> Array | None:
    """Attitudes (k, 3) of the physical guess along a sample; None where it cannot fly it."""
    step_s = run.step_s if step_s is None else step_s
    try:
        cases = sample_cases(run.model, [sample], step_s, separate_wings=run.settings.separate_wings)
        batch = run.space.decode(run.space.guess[None, :])
        ((case, found),) = shared_trims(run.model, batch, cases, run.settings.start)
        flown = fly_attitudes(run.model, batch, case, found)[0]
    except (InvalidInput, TrimNotFound, ValueError, ArithmeticError):
        return None  # beyond a hinge's range, or no flight at all: not what was meant
    return flown if np.all(np.isfinite(flown)) else None


def attitude_cost(sample: Trajectory, flown: Array | None) -> float:
    """Squared error of all angles, rad^2; infinite where nothing flew."""
    if flown is None or not np.all(np.isfinite(flown)):
        return float("inf")
    return float(np.sum(wrap_angle(flown - sample.euler) ** 2))


@dataclass(frozen=True)
class DelayedFit:
    """What a descent found that may shift the drives against the attitudes.

    Attributes
    ----------
    cost : float
        J at its end, rad^2.
    delay_s : ndarray, shape (s,)
        How much the attitudes of each sample come after its drives; zeros where that was not searched.
    """

    cost: float
    delay_s: Array


def refitted(
    run: Identification, best: Array, cases: Sequence[SampleCase] | None = None, *, delays: bool = False
) -> DelayedFit:
    """Descend a few steps from the physical guess and the best point (d,).

    Parameters
    ----------
    run : Identification
    best : ndarray, shape (d,)
    cases : sequence of SampleCase, optional
        Another reading of the samples to fit.
    delays : bool
        Whether each sample has a delay of its own, which is searched, too.
    """
    problem = _DelayProblem(run, run.training if cases is None else cases, delays=delays)
    own = np.zeros((2, problem.box.lower.size - best.size))
    starts = np.concatenate([np.stack([run.space.guess, best]), own], axis=1)
    descent = LeastSquares(
        problem,  # type: ignore[arg-type]  # of a problem a descent asks for its box alone
        DESCENT_STEPS,
        FixedPrior(starts[0], np.full(starts.shape[1], run.prior_weight)),
    )
    state = descent.init(problem.evaluate(Batch(starts)))
    while not descent.done(state):
        state = descent.tell(state, problem.evaluate(descent.ask(state)))
    point = state.point[int(np.argmin(state.cost))]
    found = problem.evaluate(Batch(point[None, :]))
    shifts = point[best.size :] if delays else np.zeros(len(problem.cases))
    return DelayedFit(float(found.cost[0]), DELAY_UNIT_S * shifts)


class _DelayProblem:
    """Parameters and delays together: the model's attitudes are read a delay earlier than the rows say."""

    def __init__(self, run: Identification, cases: Sequence[SampleCase], *, delays: bool) -> None:
        self._run, self.cases, self._delays = run, tuple(cases), delays
        longest = np.full(len(self.cases) if delays else 0, LONGEST_DELAY_S / DELAY_UNIT_S)
        self.box = Box(np.append(run.space.lower, -longest), np.append(run.space.upper, longest))

    def evaluate(self, batch: Batch) -> Outcome:
        """Costs and errors of search points (p, d + s)."""
        run, d = self._run, self._run.space.dimension
        sets = run.space.decode(batch.points[:, :d])
        parts = []
        trims = shared_trims(run.model, sets, self.cases, run.settings.start)
        for number, (case, found) in enumerate(trims):
            flown = fly_attitudes(run.model, sets, case, found)
            shift = DELAY_UNIT_S * batch.points[:, d + number] if self._delays else None
            parts.append(_errors(case, flown, shift).reshape(batch.points.shape[0], -1))
        errors = np.concatenate(parts, axis=1)
        return Outcome(batch.points, np.einsum("pm,pm->p", errors, errors), errors, errors.shape[0])


def _errors(case: SampleCase, flown: Array, delays: Array | None) -> Array:
    """Weighted errors (p, k, 3) of attitudes (p, k, 3) that are seen delays (p,) later."""
    time_s, measured = case.sample.time_s, case.sample.euler
    errors = np.full(flown.shape, DIVERGED_ANGLE)
    for lane in np.flatnonzero(np.all(np.isfinite(flown), axis=(1, 2))):
        seen = flown[lane]
        if delays is not None:
            curve = CubicSpline(time_s, np.unwrap(seen, axis=0), axis=0)
            seen = curve(np.clip(time_s - delays[lane], time_s[0], time_s[-1]))
        errors[lane] = wrap_angle(seen - measured)
    return errors * case.weight


def _words(sample: Trajectory) -> dict[str, list[str]]:
    """Names of the drives of each word, left before right."""
    words: dict[str, list[str]] = {}
    for name in sample.drive_order:
        word = next((name.removesuffix(f"_{side}") for side in SIDES if name.endswith(f"_{side}")), name)
        words.setdefault(word, []).append(name)
    return words


def _moved(sample: Trajectory, names: Sequence[str], change: Callable[[Array], Array]) -> Trajectory:
    drives = {name: change(angle) if name in names else angle for name, angle in sample.drives.items()}
    return replace(sample, drives=drives)


def _swapped(sample: Trajectory) -> Trajectory:
    """Each side with the history of the other."""
    left, right = SIDES
    drives = dict(sample.drives)
    for name in sample.drives:
        if name.endswith(f"_{left}") and (other := f"{name.removesuffix(left)}{right}") in drives:
            drives[name], drives[other] = sample.drives[other], sample.drives[name]
    return replace(sample, drives=drives)
