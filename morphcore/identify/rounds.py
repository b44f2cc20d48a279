"""Rounds of a search: after a descent, what is known about noise and unknowns of the measurement is reviewed.

Within a descent the noise of the channels, the scale of a robust loss and the set of unknowns are fixed. When
it has ended, the residuals say more: sigmas that were not given are those of the residuals (iteratively
reweighted least squares), the start is linearised about what was found, and biases, delays or starts that
nobody declared are freed where linear algebra predicts that J falls at least tenfold. Then another descent
goes on from there. What a round goes by is part of the search's state.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from morphcore.identify.cost import SampleCase, fly_readings, reduced_errors, residuals, shared_trims
from morphcore.identify.measurement import (
    FLOOR,
    MAD_TO_SIGMA,
    START,
    START_SPREAD,
    Measured,
    Openness,
    reference_rad,
)
from morphcore.identify.nuisance import linear_columns
from morphcore.models.equivalent import ParameterBatch
from morphcore.search.checkpoint import stored
from morphcore.search.least_squares import differences
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
START_GAIN, START_RMS_RAD = 100.0, 3e-4
SETTLED = 0.1  # relative change of a sigma that calls for no further round
START_PROBE = 1e-4  # of the spread of each part of the start
# parts of the start that keep a symmetric flight symmetric: theta, q, u, w
LONGITUDINAL = (1, 3, 5, 7)


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
    """

    step_s: float
    openness: tuple[Openness, ...] = ()
    round: int = 0


def with_start(run: Identification, case: SampleCase, setup: Measured, batch: ParameterBatch) -> Measured:
    """The readings of a sample whose start is free, with the derivatives by it for one parameter set."""
    parts = LONGITUDINAL if case.plan.halved else tuple(range(len(START)))
    spread = start_spread(run)[list(parts)]
    change = np.array(setup.openness.start_value)
    base = replace(setup, openness=replace(setup.openness, delay=False))
    flown = []
    for part in (None, *parts):
        moved = change.copy()
        if part is not None:
            moved[part] += START_PROBE * start_spread(run)[part]
        # a start that is exactly the trim's counts as not moved: 1e-300 is as good and has its derivatives
        openness = replace(base.openness, start_value=tuple(float(v) for v in moved))
        probed = replace(case, given=replace(base, openness=openness))
        ((_, found),) = shared_trims(run.model, batch, (probed,), run.settings.start)
        readings = fly_readings(run.model, batch, probed, found)
        flown.append(readings.at(case.sample.time_s[None, :])[0][0])
    columns = np.stack([(each - flown[0]) for each in flown[1:]], axis=-1) / (START_PROBE * spread)
    columns = np.where(np.isfinite(columns), columns, 0.0)
    return replace(setup, start_columns=columns, start_spread=spread)


def start_spread(run: Identification) -> Array:
    """Standard deviations of the parts of a start, SI units and rad."""
    spread = np.array(START_SPREAD)
    spread[5:] *= run.model.flight.airspeed_m_s
    return spread


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
            setup, parts = case.setup, LONGITUDINAL if case.plan.halved else tuple(range(len(START)))
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
    """The same object, or one in which undeclared biases, delays or starts are free that lower J tenfold."""
    undecided = [_undecided(run, case, each) for case, each in zip(run.cases, found, strict=True)]
    # a rigid wing misses so much that anything would explain it
    settled = not any(any(each) for each in undecided) or run.model.links_per_wing == 1
    if settled or run.measurement.loss != "linear":
        return found
    residual, jacobian = run.linearised(best)
    rms = float(np.sqrt(np.mean(residual**2)))
    if rms < SHOWN_RMS_RAD:
        return found
    inside = np.ones(best.size, dtype=np.bool_)
    inside[list(run.space.bound_coordinates(best))] = False
    jacobian = jacobian[:, inside]
    own = _columns(run, best, undecided, start=False)
    gain, values = _gain(residual, jacobian, own, run.prior_weight)
    if gain > FREED_GAIN and _plausible(values, own):
        return _open(found, undecided, gain, start=False)
    if rms > START_RMS_RAD:
        own = _columns(run, best, undecided, start=True)
        gain, _ = _gain(residual, jacobian, own, run.prior_weight)
        if gain > START_GAIN:
            return _open(found, undecided, gain, start=True)
    return found


@dataclass(frozen=True)
class _Undecided:
    bias: tuple[str, ...]
    delay: bool
    start: bool

    def __iter__(self):  # type: ignore[no-untyped-def]
        return iter((bool(self.bias), self.delay, self.start))


def _undecided(run: Identification, case: SampleCase, openness: Openness) -> _Undecided:
    """What of a sample's measurement is neither declared nor free."""
    measurement = run.measurement
    channels = measurement.channels or {}
    bias = tuple(
        name
        for name in case.setup.fitted_channels
        if name not in openness.bias
        and measurement.bias is None
        and (name not in channels or channels[name].bias is None)
    )
    return _Undecided(
        bias,
        measurement.delay is None and not openness.delay,
        measurement.initial_state is None and not openness.start,
    )


def _columns(
    run: Identification, best: Array, undecided: Sequence[_Undecided], *, start: bool
) -> list[tuple[str, Array]]:
    """What each undecided unknown, and each one that is free, adds to the residuals: its kind, (m,)."""
    batch = run.space.decode(best)
    sizes = [case.setup.residual_count for case in run.training]
    total, columns, first = sum(sizes), [], 0
    chosen = [each for each, case in zip(undecided, run.cases, strict=True) if case.sample.role == "train"]
    for case, each, size in zip(run.training, chosen, sizes, strict=True):
        setup = case.setup
        openness = replace(
            setup.openness,
            bias=(*setup.openness.bias, *each.bias),
            delay=setup.openness.delay or each.delay,
        )
        setup = replace(setup, openness=openness)
        if start and each.start:
            setup = with_start(run, case, setup, batch)
        linear, _ = linear_columns(setup)
        kinds = ["bias"] * int(setup.offset.sum())
        kinds += ["start"] * (linear.shape[2] - len(kinds))
        parts = [linear[..., number] for number in range(linear.shape[2])]
        if openness.delay:
            opened = replace(case, given=setup)
            ((_, found),) = shared_trims(run.model, batch, (opened,), run.settings.start)
            parts.append(reduced_errors(run.model, batch, opened, found).slope[0])
            kinds.append("delay")
        for kind, part in zip(kinds, parts, strict=True):
            column = np.zeros(total)
            rows = np.where(np.isfinite(part) & np.isfinite(setup.values), part, 0.0) * setup.weight
            column[first : first + size] = rows[:, setup.fitted].reshape(-1)
            columns.append((kind, column))
        first += size
    return columns


def _gain(
    residual: Array, jacobian: Array, columns: Sequence[tuple[str, Array]], prior: float
) -> tuple[float, Array]:
    """By what factor J falls with some columns more, to first order; and their values."""
    d = jacobian.shape[1]
    both = np.concatenate([jacobian, np.stack([column for _, column in columns], axis=1)], axis=1)

    def left(design: Array) -> tuple[float, Array]:
        held = np.zeros(design.shape[1])
        held[:d] = np.sqrt(prior)
        rows = np.concatenate([design, np.diag(held)[:d]])
        change = np.linalg.lstsq(rows, -np.concatenate([residual, np.zeros(d)]), rcond=1e-12)[0]
        after = residual + design @ change
        return float(after @ after), change[d:]

    before, _ = left(jacobian)
    after, values = left(both)
    return before / max(after, 1e-300), values


def _plausible(values: Array, columns: Sequence[tuple[str, Array]]) -> bool:
    """Whether biases and delays are such as sensors have, and some of them more than nothing."""
    low = {"bias": MIN_BIAS_RAD, "delay": MIN_DELAY_S}
    high = {"bias": MAX_BIAS_RAD, "delay": MAX_DELAY_S}
    pairs = [(abs(value), kind) for value, (kind, _) in zip(values, columns, strict=True)]
    return any(size > low[kind] for size, kind in pairs) and all(size < high[kind] for size, kind in pairs)


def _open(
    found: tuple[Openness, ...], undecided: Sequence[_Undecided], gain: float, *, start: bool
) -> tuple[Openness, ...]:
    what = "biases, delays and starts off the trim" if start else "biases and delays"
    reason = f"{what} were predicted to lower the squared errors {gain:.0f} times"
    return tuple(
        replace(
            each,
            bias=(*each.bias, *open_.bias),
            delay=each.delay or open_.delay,
            start=each.start or (start and open_.start),
            reason=reason,
        )
        for each, open_ in zip(found, undecided, strict=True)
    )


def linearised(run: Identification, point: Array) -> tuple[Array, Array]:
    """Residuals (m,) and their Jacobian (m, d) at a search point (d,)."""

    def errors(points: Array) -> Array:
        return residuals(run.model, run.space.decode(points), run.training, run.settings.start)

    residual, jacobian = differences(point[None, :], run.space.upper, errors)
    return residual[0], jacobian[0]
