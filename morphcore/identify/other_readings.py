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

from morphcore.errors import InvalidInput, TrimNotFound
from morphcore.frames import wrap_angle
from morphcore.identify.cost import (
    SampleCase,
    fly_attitudes,
    reduced_errors,
    residuals,
    sample_cases,
    shared_trims,
)
from morphcore.search.least_squares import LeastSquares
from morphcore.search.prior import FixedPrior
from morphcore.search.solver import Batch, Box, Outcome
from morphcore.simulate.time_grid import STEP_S
from morphcore.simulate.trajectory import Trajectory
from morphdata.drives import SIDES

if TYPE_CHECKING:
    from morphcore.identify.identification import Identification

Array = NDArray[np.float64]
Change = Callable[[Trajectory], Trajectory]

HALF = 0.5  # of the motion, rms: what another reading may leave at most to be believed
TENFOLD = 10.0  # the cost by which another reading must be better to be named
HEADING = 2  # the angle that is measured from any direction
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
        found.append(_flipped(sample, names))
        if len(names) > 1:
            found += [_flipped(sample, [name]) for name in names]
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
    names = [name for name in names if sample.units.get(name, "rad") == "rad"]
    if not names:
        return []
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


def _flipped(sample: Trajectory, names: Sequence[str]) -> Reading:
    label = " and ".join(names)
    return Reading(
        "flipped_sign",
        lambda given: _moved(given, names, lambda angle: -angle),
        f"the sign of {label} is probably wrong in {{name}}: with the opposite one the model flies it",
        f"change the sign of {label}, or check the axis of the hinges in the aircraft",
        sample.field_of(names[0]),
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
        cases = sample_cases(
            run.model,
            [sample],
            step_s,
            separate_wings=run.settings.separate_wings,
            start=run.settings.start,
        )
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


def refitted(run: Identification, best: Array, cases: Sequence[SampleCase]) -> tuple[float, Array]:
    """Descend a few steps from the physical guess and the best point (d,) in another reading of the samples.

    Parameters
    ----------
    run : Identification
    best : ndarray, shape (d,)
    cases : sequence of SampleCase
        The reading of the samples to fit.

    Returns
    -------
    cost : float
        At the end, rad^2.
    point : ndarray, shape (d,)
    """
    problem = _Refit(run, tuple(cases))
    starts = np.stack([run.space.guess, best])
    descent = LeastSquares(
        problem,  # type: ignore[arg-type]  # of a problem a descent asks for its box alone
        DESCENT_STEPS,
        FixedPrior(run.space.guess, np.full(best.size, run.prior_weight)),
    )
    state = descent.init(problem.evaluate(Batch(starts)))
    while not descent.done(state):
        state = descent.tell(state, problem.evaluate(descent.ask(state)))
    point = state.point[int(np.argmin(state.cost))]
    return float(problem.evaluate(Batch(point[None, :])).cost[0]), point


def delayed(cases: Sequence[SampleCase]) -> list[SampleCase]:
    """The same samples, whose readings may come later than what the drives do."""
    setups = [case.setup for case in cases]
    opened = [replace(setup, openness=replace(setup.openness, delay=True)) for setup in setups]
    return [replace(case, given=setup) for case, setup in zip(cases, opened, strict=True)]


def fitted_delays(run: Identification, point: Array, cases: Sequence[SampleCase]) -> list[float]:
    """How late the readings of samples with a free delay come at a search point (d,), s."""
    batch = run.space.decode(point[None, :])
    trims = shared_trims(run.model, batch, cases, run.settings.start)
    return [float(reduced_errors(run.model, batch, case, found).nuisance[0, -1]) for case, found in trims]


@dataclass(frozen=True)
class _Refit:
    """The problem of an identification with other cases."""

    run: Identification
    cases: tuple[SampleCase, ...]

    @property
    def box(self) -> Box:
        """The bounds of the search coordinates."""
        return self.run.box

    def evaluate(self, batch: Batch) -> Outcome:
        """Costs and errors of search points (p, d)."""
        sets = self.run.space.decode(batch.points)
        errors = residuals(self.run.model, sets, self.cases, self.run.settings.start)
        return Outcome(batch.points, np.einsum("pm,pm->p", errors, errors), errors, errors.shape[0])


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
