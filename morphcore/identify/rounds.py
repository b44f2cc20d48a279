"""Rounds of a search: after a descent, what is known about noise and unknowns of the measurement is reviewed.

Within a descent the noise of the channels, the scale of a robust loss and the set of unknowns are fixed. When
it has ended, the residuals say more: sigmas that were not given are those of the residuals (iteratively
reweighted least squares), the start is linearised about what was found, and biases, delays or starts that
nobody declared are freed where linear algebra predicts that J falls at least tenfold. When all that has
settled, aerodynamic corrections are freed that the flights call for (`free_corrections`). Then another
descent goes on from there. What a round goes by is part of the search's state.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from morphcore.identify.cost import DIVERGED_ANGLE, SampleCase, reduced_errors, shared_trims
from morphcore.identify.descents import descent
from morphcore.identify.free_corrections import called_for, moved
from morphcore.identify.free_start import free_parts
from morphcore.identify.measurement import (
    FLOOR,
    MAD_TO_SIGMA,
    Measured,
    Openness,
    reference_rad,
)
from morphcore.identify.nuisance import linear_columns
from morphcore.models.equivalent import ParameterBatch
from morphcore.search.checkpoint import stored
from morphcore.search.run import SearchState
from morphcore.search.solver import Batch
from morphcore.stopping import Stop
from morphdata.measurement import ANGLES

if TYPE_CHECKING:
    from morphcore.identify.identification import Identification

Array = NDArray[np.float64]

MAX_ROUNDS = 8
FREED_GAIN = 10.0  # by which J must fall for biases and delays that nobody declared
# and at least one of them is as large as this: what chains miss of a flexible wing passes for less
MIN_BIAS_RAD, MIN_DELAY_S = 3e-4, 2.5e-3
MAX_BIAS_RAD, MAX_DELAY_S = 0.03, 0.1  # and none larger: then it is the model that is wrong
SHOWN_RMS_RAD = 3e-6  # residuals below it hide no bias and no delay
# a start is nearly the same as a bias and a slow motion: it must explain much, and much must be unexplained
START_GAIN, START_RMS_RAD = 30.0, 2e-3
SETTLED = 0.1  # relative change of a sigma that calls for no further round
REVIEW = "measurement"  # as the history of a result calls a review of what is known about the measurement
DESCENDING = ("hybrid", "least_squares")  # methods whose end is a descent that another one can follow


@stored
@dataclass(frozen=True)
class Prepared:
    """What a descent goes by.

    Attributes
    ----------
    step_s : float
        Time step of all flights.
    openness : tuple of Openness
        Of each sample.
    round : int
        Descents before this one.
    further : tuple of str
        Freedoms of the search that the flights call for (`free_corrections`).
    """

    step_s: float
    openness: tuple[Openness, ...] = ()
    round: int = 0
    further: tuple[str, ...] = ()


def reviewed(run: Identification, state: SearchState, stop: Stop | None = None) -> SearchState | None:
    """The state in which the next round begins, after a descent that has ended; None without another round.

    Parameters
    ----------
    run : Identification
        It has entered the state of the next round where there is one.
    state : SearchState
        Of the end of a descent.
    stop : callable, optional
        As of `Identification.steps`.
    """
    number = state.prepared.round if isinstance(state.prepared, Prepared) else 0
    up = state.budget_s is not None and state.wall_s >= state.budget_s
    if run.search.method not in DESCENDING or number + 1 >= MAX_ROUNDS or up:
        return None
    if not (run.space.dimension and np.isfinite(state.best_cost)):
        return None
    found = next_openness(run, state.best)
    further = called_for(run, state.best) if found is None else ()
    if found is None and not further:
        return None
    found = found or run.openness
    freed = bool(further) or any(a.reason != b.reason for a, b in zip(found, run.openness, strict=True))
    space, best = run.space_with(further), state.best
    if further:
        best = moved(run.space, space, best)
        found = tuple(
            replace(each, reference=moved(run.space, space, each.reference)) if each.reference.size else each
            for each in found
        )
    prepared = Prepared(run.step_s, found, number + 1, (*run.further, *further))
    run.entered(replace(state, prepared=prepared))
    run.space = space
    # with other unknowns the best model may lie in another valley
    points = np.stack([best, *(run.known if freed else ())])
    known = run.evaluate(Batch(points), stop)
    leader = int(np.argmin(known.cost))
    if known.cost[leader] > DIVERGED_ANGLE**2 > state.best_cost:
        # flights begin so far off their trim that they diverge: the prediction did not hold
        return None
    flights = state.flights + points.shape[0] * run.flights_each
    row = {
        "generation": state.generation + 1,
        "phase": REVIEW,
        "particles": points.shape[0],
        "flights": flights,
        "best_cost": float(known.cost[leader]),
    }
    return replace(
        state,
        prepared=prepared,
        solver=descent(run, run.search).init(known, run.space.box),
        best=points[leader],
        best_cost=float(known.cost[leader]),
        generation=state.generation + 1,
        flights=flights,
        history=(*state.history, row),
        over=False,
    )


def next_openness(run: Identification, best: Array) -> tuple[Openness, ...] | None:
    """What the next descent goes by, after one that ended at a search point (d,); None if nothing changes."""
    found = tuple(run.openness)
    batch = run.space.decode(best)
    errors, found, moved = _restarted(run, batch, best, found)
    reweighted = _reweighted(run, errors, found)
    freed = _freed(run, best, reweighted)
    settled = moved < SETTLED and freed is reweighted and not _changed(found, reweighted)
    return None if settled else freed


def _restarted(
    run: Identification, batch: ParameterBatch, best: Array, found: tuple[Openness, ...]
) -> tuple[list[Array], tuple[Openness, ...], float]:
    """Errors of all samples, their openness with the starts that were found, and how far a start moved."""
    errors, moved, out = [], 0.0, []
    trims = shared_trims(run.model, batch, run.cases, run.settings.start)
    for before, (case, trim) in zip(found, trims, strict=True):
        openness, left = before, reduced_errors(run.model, batch, case, trim)
        errors.append(left.error[0])
        if openness.start:
            setup, parts = case.setup, free_parts(case)
            first = int(setup.offset.sum())
            change = left.nuisance[0, first : first + len(parts)]
            value = np.array(openness.start_value)
            value[list(parts)] += change
            moved = max(moved, float(np.max(np.abs(change) / (0.02 * setup.start_spread))))
            openness = replace(openness, start_value=tuple(float(v) for v in value), reference=best)
        out.append(openness)
    return errors, tuple(out), moved


def _reweighted(
    run: Identification, errors: Sequence[Array], found: tuple[Openness, ...]
) -> tuple[Openness, ...]:
    """The same with the noise that the errors show, where it was not given."""
    training = [
        (case.setup, error)
        for case, error in zip(run.cases, errors, strict=True)
        if case.sample.role == "train"
    ]
    robust = run.measurement.loss != "linear"
    channels = run.measurement.channels
    sigma = dict(found[0].sigma)
    for name in sigma:
        if channels and channels[name].sigma is None:
            sigma[name] = max(_spread(training, name, robust=robust), run.floors[name])
    scale = 0.0
    if robust and sigma:
        scale = reference_rad(replace(found[0], sigma=sigma))
    elif robust:
        spreads = [_spread(training, name, robust=True) for name in ANGLES]
        known = [value for value in spreads if value > 0.0]
        motion = max(float(np.ptp(setup.values[:, :3], axis=0).max()) for setup, _ in training)
        scale = max(float(np.sqrt(np.mean(np.square(known)))) if known else 0.0, FLOOR * motion, 1e-9)
    return tuple(replace(each, sigma=sigma, scale_rad=scale) for each in found)


def _spread(training: Sequence[tuple[Measured, Array]], name: str, *, robust: bool) -> float:
    """Standard deviation of a channel's errors over all samples, its own unit; by the median where robust."""
    values = np.concatenate([error[:, setup.channels.index(name)] for setup, error in training])
    values = values[np.isfinite(values)]
    if not values.size:
        return 0.0
    return float(MAD_TO_SIGMA * np.median(np.abs(values)) if robust else np.sqrt(np.mean(values**2)))


def _changed(before: tuple[Openness, ...], after: tuple[Openness, ...]) -> bool:
    for old, new in zip(before, after, strict=True):
        pairs = [(old.sigma[name], value) for name, value in new.sigma.items()]
        pairs.append((old.scale_rad, new.scale_rad))
        if any(abs(a - b) > SETTLED * max(a, b) for a, b in pairs):
            return True
    return False


# what nobody declared


def _freed(run: Identification, best: Array, found: tuple[Openness, ...]) -> tuple[Openness, ...]:
    """The same object, or one in which undeclared biases, delays or starts are free that lower J much."""
    opened = tuple(_opened(run, case, each) for case, each in zip(run.cases, found, strict=True))
    # a start and a bias of the same angle say nearly the same: not both of them without being declared
    started = tuple(
        replace(each, start=each.start or run.measurement.initial_state is None, reference=best)
        for each in found
    )
    # a rigid wing misses so much that anything would explain it
    if run.model.links_per_wing == 1 or run.measurement.loss != "linear":
        return found
    if not (_differ(started, found) or _differ(opened, found)):
        return found
    rms = float(np.sqrt(np.mean(run.linearised(best)[0] ** 2)))
    if rms > SHOWN_RMS_RAD and _differ(opened, found):
        gain, values = _gain(run, best, opened)
        if gain > FREED_GAIN and _plausible(values):
            return _explained(opened, "biases and delays", gain)
    if rms > START_RMS_RAD and _differ(started, found):
        # from a start far off its trim the descent may have ended anywhere
        gain = max(_gain(run, point, started)[0] for point in (best, run.space.guess))
        if gain > START_GAIN:
            return _explained(started, "starts off the trim", gain)
    return found


def _differ(some: tuple[Openness, ...], others: tuple[Openness, ...]) -> bool:
    return any(a.free != b.free for a, b in zip(some, others, strict=True))


def _opened(run: Identification, case: SampleCase, openness: Openness) -> Openness:
    """The same with biases and delay free that are neither declared nor free."""
    measurement = run.measurement
    channels = measurement.channels or {}
    bias = tuple(
        name
        for name in case.setup.fitted_channels
        if name not in openness.bias
        and measurement.bias is None
        and (name not in channels or channels[name].bias is None)
    )
    delay = openness.delay or measurement.delay is None
    return replace(openness, bias=(*openness.bias, *bias), delay=delay)


def _explained(openness: tuple[Openness, ...], what: str, gain: float) -> tuple[Openness, ...]:
    reason = f"{what} were predicted to lower the squared errors {gain:.0f} times"
    return tuple(replace(each, reason=reason) for each in openness)


def _columns(run: Identification, point: Array, trial: tuple[Openness, ...]) -> list[tuple[str, Array]]:
    """What each unknown of a trial adds to the residuals: its kind, and its column (m,)."""
    batch = run.space.decode(point)
    cases = [
        case
        for case in run.opened(tuple(replace(each, reference=point) for each in trial))
        if case.sample.role == "train"
    ]
    total, first = sum(case.setup.residual_count for case in cases), 0
    columns = []
    for case, found in shared_trims(run.model, batch, cases, run.settings.start):
        setup = case.setup
        linear, _ = linear_columns(setup)
        # offsets come first; those of other channels than the angles, starts and first angles are not judged
        kinds = ["bias" if angle else "other" for angle in setup.angle[setup.offset]]
        kinds += ["other"] * (linear.shape[2] - len(kinds))
        parts = [(kind, linear[..., n]) for n, kind in enumerate(kinds)]
        if setup.openness.delay:
            parts.append(("delay", reduced_errors(run.model, batch, case, found).slope[0]))
        for kind, part in parts:
            column = np.zeros(total)
            rows = np.where(np.isfinite(part) & np.isfinite(setup.values), part, 0.0) * setup.weight
            column[first : first + setup.residual_count] = rows[:, setup.fitted].reshape(-1)
            columns.append((kind, column))
        first += setup.residual_count
    return columns


def _gain(
    run: Identification, point: Array, trial: tuple[Openness, ...]
) -> tuple[float, list[tuple[float, str]]]:
    """By what factor J falls with the unknowns of a trial, to first order; their values and kinds."""
    residual, jacobian = run.linearised(point)
    inside = np.ones(point.size, dtype=np.bool_)
    inside[run.space.bound_coordinates(point)] = False
    jacobian, columns = jacobian[:, inside], _columns(run, point, trial)
    both = np.concatenate([jacobian, np.stack([column for _, column in columns], axis=1)], axis=1)
    d = jacobian.shape[1]

    def left(design: Array) -> tuple[float, Array]:
        held = np.sqrt(run.prior_weight) * np.eye(d, design.shape[1])
        rows, right = np.concatenate([design, held]), np.concatenate([residual, np.zeros(d)])
        change = np.linalg.lstsq(rows, -right, rcond=1e-12)[0]
        after = residual + design @ change
        return float(after @ after), change[d:]

    before, _ = left(jacobian)
    after, values = left(both)
    return before / max(after, 1e-300), [
        (abs(float(value)), kind) for value, (kind, _) in zip(values, columns, strict=True)
    ]


def _plausible(values: Sequence[tuple[float, str]]) -> bool:
    """Whether biases and delays are such as sensors have, and some of them more than nothing."""
    low = {"bias": MIN_BIAS_RAD, "delay": MIN_DELAY_S}
    high = {"bias": MAX_BIAS_RAD, "delay": MAX_DELAY_S}
    judged = [(size, kind) for size, kind in values if kind in low]
    return any(size > low[kind] for size, kind in judged) and all(size < high[kind] for size, kind in judged)
