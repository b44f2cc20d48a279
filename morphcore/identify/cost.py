"""What a parameter set costs: squared errors of its flights over the samples, or the errors themselves.

J = sum over samples and times of w (dphi^2 + dtheta^2 + dpsi^2), the differences wrapped; rad^2. What else
is unknown about a measurement is removed from the differences first (`nuisance`), the heading to begin with
always; other channels count in proportion to their noise.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from morphcore.errors import InvalidInput, TrimNotFound
from morphcore.frames import euler_from_quaternion, euler_rates, quaternion_from_euler
from morphcore.geometry.aircraft import Aircraft
from morphcore.identify.measurement import START, Measured, Openness, measured
from morphcore.identify.nuisance import Reduced, pseudo_residual, reduced
from morphcore.identify.readings import Readings, readings, rows_needed
from morphcore.lanes import TOGETHER
from morphcore.models.equivalent import (
    ChainModel,
    LaneConstants,
    ParameterBatch,
    lane_constants,
    physical_guess,
)
from morphcore.models.kernels.layout import OMEGA, POSITION
from morphcore.simulate.batch import fly_batch
from morphcore.simulate.hinge_schedules import followed_flight, hinge_schedules, part_name
from morphcore.simulate.plan import FlightPlan, flight_plan
from morphcore.simulate.schedule import Schedule
from morphcore.simulate.steady import departure, pitch
from morphcore.simulate.step_choice import choose_step
from morphcore.simulate.time_grid import STEP_S, time_grid
from morphcore.simulate.trajectory import Trajectory
from morphcore.simulate.trim import StartMode, Trim, trim, trimmed_state
from morphcore.stopping import Stop, one_at_a_time
from morphcore.threads import in_threads, thread_count
from morphdata.measurement import Measurement

Array = NDArray[np.float64]

DIVERGED_ANGLE = 3.0  # rad of error charged for every angle of a row that a diverged flight never reached
LARGEST_SLAB = 256  # parameter sets that one thread flies at a time
ATTITUDE_ROWS = 7  # of the state: quaternion and body rates


@dataclass(frozen=True)
class SampleCase:
    """A sample, the plan that all flights against it share, and its readings as they are compared.

    By default these are its three angles, and only the heading is free. ``turn_rate_rad_s`` is that of the
    steady flight in which it begins.
    """

    sample: Trajectory
    plan: FlightPlan
    given: Measured | None = None
    turn_rate_rad_s: float = 0.0

    @cached_property
    def setup(self) -> Measured:
        """The readings and what is unknown about them."""
        return measured(self.sample, Measurement(), Openness()) if self.given is None else self.given

    def needs_following(self, model: ChainModel, start: StartMode) -> bool:
        """Whether the model's trim is found only by following it from stiff joints.

        Decided once, by the nominal parameters: where these trim at once, sets of a search that do not are
        far from any flight, and following each of them would cost more than flying the others.
        """
        known: dict[StartMode, bool] = self.__dict__.setdefault("_needs_following", {})
        if start not in known:
            flown = self.plan.flown(model)
            found = trim(flown, physical_guess(model), self.plan, start=start, follow=False)
            known[start] = not bool(found.converged.all())
        return known[start]

    @cached_property
    def motion(self) -> Array:
        """(k, 3) departures of the sample's attitude from its steady start, rad."""
        return departure(self.sample.euler, self.sample.time_s, self.turn_rate_rad_s)

    @property
    def weight(self) -> Array:
        """(3,) square root of the weight of each angle's error."""
        return np.full(3, np.sqrt(self.sample.weight))


@dataclass(frozen=True)
class Evaluation:
    """Errors of parameter sets p against one sample of k rows and c fitted channels.

    errors : (p, k, c) weighted differences, without the nuisances, rad. diverged : (p,). nuisance : (p, n) as
    of `nuisance.Reduced`.
    """

    errors: Array
    diverged: NDArray[np.bool_]
    nuisance: Array

    @property
    def cost(self) -> Array:
        """(p,) J."""
        # row by row in one order: the errors' layout, and so the last bit, varies with the number of sets
        rows = self.errors.reshape(self.errors.shape[0], -1)
        return np.asarray(np.einsum("pm,pm->p", rows, rows))


def sample_schedules(aircraft: Aircraft, sample: Trajectory, pointer: str) -> list[Schedule]:
    """Motion of every hinge out of a sample; refuses angles beyond a hinge's range."""
    followed = followed_flight(aircraft, sample, pointer)
    for surface in aircraft.surfaces:
        for hinge in surface.moved_parts:
            if hinge.drive not in followed:
                continue
            key, schedule = followed[hinge.drive]
            angle = schedule.motion(sample.time_s).angle
            bad = hinge.beyond_range(angle)
            if bad.size:
                turns = hinge.unit == "rad" and bool(np.abs(angle).max() > np.pi)
                unit = f"; are they degrees? Then name the column {key}_deg" if turns else ""
                raise InvalidInput(
                    f"{hinge.drive} {angle[bad[0]]:g} {hinge.unit} is beyond the {part_name(hinge)} of "
                    f"{surface.name}",
                    pointer=f"{pointer}/{sample.field_of(key)}/{bad[0]}",
                    hint=f"its range is {hinge.min_rad:g}..{hinge.max_rad:g} {hinge.unit}{unit}",
                )
    return hinge_schedules(aircraft, followed)


def sample_cases(
    model: ChainModel,
    samples: Sequence[Trajectory],
    longest_step_s: float = STEP_S,
    pointer: str = "/samples",
    *,
    separate_wings: bool = False,
    whole: Sequence[bool] = (),
    start: StartMode = "trim",
) -> tuple[SampleCase, ...]:
    """Plans for all samples, for models whose wings share their parameters or have ``separate_wings``.

    whole : of each sample, whether its flights may leave symmetry although its drives do not.
    """
    return tuple(
        SampleCase(
            sample,
            flight_plan(
                model,
                sample_schedules(model.aircraft, sample, f"{pointer}/{i}"),
                time_grid(sample.time_s, longest_step_s),
                may_halve=not (separate_wings or any(whole[i : i + 1])),
                start=start,
            ),
            turn_rate_rad_s=model.flight.turn_rate_rad_s,
        )
        for i, sample in enumerate(samples)
    )


def longest_step(
    model: ChainModel,
    batch: ParameterBatch,
    samples: Sequence[Trajectory],
    start: StartMode,
    stop: Stop | None = None,
    *,
    separate_wings: bool = False,
) -> float:
    """The longest step, s, with which a parameter set flies samples within the tolerance of ``choose_step``.

    A set that has no trim flies nothing that could be compared: the default step it is.
    """
    flights = [
        (sample_schedules(model.aircraft, sample, f"/samples/{i}"), sample.time_s)
        for i, sample in enumerate(samples)
    ]
    try:
        found = choose_step(model, flights, batch, start=start, may_halve=not separate_wings, stop=stop)
    except TrimNotFound:
        return STEP_S
    return found.step_s


def shared_trims(
    model: ChainModel, batch: ParameterBatch, cases: Sequence[SampleCase], start: StartMode
) -> Iterator[tuple[SampleCase, Trim]]:
    """Each case with its trim; samples that begin in the same shape and wind share one."""
    known: dict[tuple[float, ...], Trim] = {}
    for case in cases:
        plan = case.plan
        key = tuple(np.round(np.concatenate([plan.angles[0], plan.first_deflections, plan.wind_N[0]]), 9))
        if key not in known:
            known[key] = trim(
                case.plan.flown(model),
                batch,
                case.plan,
                start=start,
                follow=case.needs_following(model, start),
            )
        yield case, known[key]


def trimmed_flight(
    model: ChainModel, batch: ParameterBatch, case: SampleCase, found: Trim
) -> tuple[ChainModel, LaneConstants, Array]:
    """What flies a sample's plan, its constants with the trim's thrust, its trimmed state (p, rows)."""
    flown = case.plan.flown(model)
    constants = lane_constants(flown, batch, case.plan.grid.step_s)
    constants.set_thrust(*found.acting_B)
    return flown, constants, trimmed_state(flown, batch, case.plan, found, psi=float(case.sample.psi[0]))


def fly_attitudes(
    model: ChainModel, batch: ParameterBatch, case: SampleCase, found: Trim, stop: Stop | None = None
) -> Array:
    """Euler angles (p, k, 3) at the sample's times; NaN from where a flight diverged, or untrimmed."""
    plan, sample = case.plan, case.sample
    model, constants, state = trimmed_flight(model, batch, case, found)
    attitude = np.empty((batch.particles, sample.time_s.size, 3))
    if plan.grid.at is not None:
        for chunk in fly_batch(model, plan, constants, state, record_rows=4, stop=stop):
            low, high = np.searchsorted(plan.grid.at, (chunk.first, chunk.first + chunk.rows.shape[0]))
            wanted = chunk.rows[plan.grid.at[low:high] - chunk.first]
            attitude[:, low:high] = euler_from_quaternion(wanted.transpose(2, 0, 1))
    else:
        rows = np.concatenate(
            [c.rows for c in fly_batch(model, plan, constants, state, record_rows=ATTITUDE_ROWS, stop=stop)]
        )
        attitude[:] = _interpolated(rows, plan.grid.times_s, sample.time_s)
    attitude[~found.converged] = np.nan
    return attitude


def fly_readings(
    model: ChainModel, batch: ParameterBatch, case: SampleCase, found: Trim, stop: Stop | None = None
) -> Readings:
    """All channels that a sample fits, at any time; NaN from where a flight diverged, or untrimmed."""
    plan, setup = case.plan, case.setup
    flown, constants, state = trimmed_flight(model, batch, case, found)
    if any(setup.openness.start_value):
        theta = pitch(model.flight, found.alpha, found.bank)
        first = np.stack([found.bank, theta, np.full_like(theta, case.sample.psi[0])], axis=1)
        state = moved_start(state, first, setup.openness.start_value)
    count = rows_needed(setup.channels, flown.coordinates)
    chunks = fly_batch(flown, plan, constants, state, record_rows=count, stop=stop)
    rows = np.concatenate([chunk.rows for chunk in chunks])
    rows[..., ~found.converged] = np.nan
    return readings(flown, batch, plan, found, rows, setup.channels, model)


def reading_derivatives(
    model: ChainModel, batch: ParameterBatch, flights: Iterable[tuple[SampleCase, Trim]], probe: ArrayLike
) -> Array:
    """Derivatives (k, c, n) of a sample's readings by differences of flights of one parameter set.

    flights : the undisturbed one, and n with one thing each changed by its probe. probe : (n,) or one for
    all. Where a flight diverged, the derivative is zero.
    """
    flown = [
        fly_readings(model, batch, case, found).at(case.sample.time_s[None, :])[0][0]
        for case, found in flights
    ]
    columns = np.stack([each - flown[0] for each in flown[1:]], axis=-1) / probe
    return np.where(np.isfinite(columns), columns, 0.0)


def moved_start(state: Array, euler: Array, change: Sequence[float]) -> Array:
    """Trimmed states (p, rows) with attitude, rates and velocity off the trim, in the order of `START`.

    euler : (p, 3) of the trim, rad.
    """
    moved = state.copy()
    of = dict(zip(START, change, strict=True))
    phi, theta, psi = euler.T
    moved[:, :OMEGA] = quaternion_from_euler(phi + of["phi_rad"], theta + of["theta_rad"], psi)
    moved[:, OMEGA:POSITION] += np.array(change[2:])
    return moved


def reduced_errors(
    model: ChainModel, batch: ParameterBatch, case: SampleCase, found: Trim, stop: Stop | None = None
) -> Reduced:
    """Fly parameter sets against one sample, and remove what is unknown about its measurement."""
    fly = fly_attitudes if case.setup.plain else fly_readings
    return reduced(case.setup, case.sample.time_s, fly(model, batch, case, found, stop))


def fly_measured(model: ChainModel, batch: ParameterBatch, case: SampleCase, found: Trim) -> Array:
    """Angles (p, k, 3) as the sample's sensors would have read them on the flights of parameter sets."""
    return np.asarray(case.sample.euler + reduced_errors(model, batch, case, found).error[..., :3])


def evaluate(
    model: ChainModel, batch: ParameterBatch, case: SampleCase, found: Trim, stop: Stop | None = None
) -> Evaluation:
    """Fly parameter sets against one sample."""
    setup = case.setup
    out = reduced_errors(model, batch, case, found, stop)
    missing = np.isnan(setup.values[:, setup.fitted])
    errors = pseudo_residual(setup, out.error)[..., setup.fitted]
    lost = ~np.isfinite(errors) & ~missing
    # a diverged flight: large, finite, and the less the longer it held out
    errors = np.where(lost, DIVERGED_ANGLE * np.sqrt(case.sample.weight), np.where(missing, 0.0, errors))
    return Evaluation(errors, np.any(lost, axis=(1, 2)), out.nuisance)


def costs(
    model: ChainModel,
    batch: ParameterBatch,
    cases: Sequence[SampleCase],
    start: StartMode,
    stop: Stop | None = None,
) -> Array:
    """(p,) J over all samples; parameter sets in slabs, so that memory does not grow with the swarm."""
    total = np.zeros(batch.particles)

    def fly(part: slice, stop: Stop) -> None:
        chosen = batch.select(part)
        for case, found in shared_trims(model, chosen, cases, start):
            total[part] += evaluate(model, chosen, case, found, stop).cost

    _in_slabs(batch.particles, fly, stop)
    return total


def residuals(
    model: ChainModel,
    batch: ParameterBatch,
    cases: Sequence[SampleCase],
    start: StartMode,
    stop: Stop | None = None,
) -> Array:
    """(p, m) all weighted errors of all samples in one row per parameter set: by rows, then channels."""
    counts = [case.setup.residual_count for case in cases]
    ends = np.cumsum(counts)
    errors = np.empty((batch.particles, ends[-1]))

    def fly(part: slice, stop: Stop) -> None:
        chosen = batch.select(part)
        trims = shared_trims(model, chosen, cases, start)
        for end, count, (case, found) in zip(ends, counts, trims, strict=True):
            own = evaluate(model, chosen, case, found, stop).errors
            errors[part, end - count : end] = own.reshape(chosen.particles, -1)

    _in_slabs(batch.particles, fly, stop)
    return errors


def _in_slabs(particles: int, fly: Callable[[slice, Stop], None], stop: Stop | None) -> None:
    """Fly all parameter sets in slabs of whole blocks, in threads: trims, flights and errors of each."""
    each = -(-particles // thread_count())
    size = min(-(-each // TOGETHER) * TOGETHER, LARGEST_SLAB)
    requested = one_at_a_time(stop)
    in_threads(lambda k: fly(slice(k * size, (k + 1) * size), requested), -(-particles // size))


def _interpolated(rows: Array, grid_s: Array, times_s: Array) -> Array:
    """Euler angles (p, k, 3) at uneven times by cubic Hermite interpolation between grid times."""
    quaternion, omega = rows[:, :4].transpose(2, 0, 1), rows[:, 4:7].transpose(2, 0, 1)
    euler = np.unwrap(euler_from_quaternion(quaternion), axis=1)
    rates = euler_rates(euler, omega)
    step = grid_s[1] - grid_s[0]
    left = np.clip(((times_s - grid_s[0]) / step).astype(np.int64), 0, grid_s.size - 2)
    s = ((times_s - grid_s[left]) / step)[:, None]
    a, b = euler[:, left], euler[:, left + 1]
    da, db = rates[:, left] * step, rates[:, left + 1] * step
    return np.asarray(
        (1 + 2 * s) * (1 - s) ** 2 * a + s * (1 - s) ** 2 * da + s**2 * (3 - 2 * s) * b + s**2 * (s - 1) * db
    )
