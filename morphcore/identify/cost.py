"""What a parameter set costs: squared attitude errors over the samples, or the errors themselves.

J = sum over samples and times of w (dphi^2 + dtheta^2 + dpsi^2), the differences wrapped; rad^2.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from morphcore.errors import InvalidInput, TrimNotFound
from morphcore.frames import euler_from_quaternion, euler_rates, wrap_angle
from morphcore.geometry.aircraft import Aircraft
from morphcore.lanes import TOGETHER
from morphcore.models.equivalent import ChainModel, ParameterBatch, lane_constants
from morphcore.simulate.batch import fly_batch
from morphcore.simulate.hinge_schedules import followed_flight, hinge_schedules
from morphcore.simulate.plan import STEP_S, FlightPlan, flight_plan, time_grid
from morphcore.simulate.schedule import Schedule
from morphcore.simulate.step_choice import choose_step
from morphcore.simulate.trajectory import Trajectory
from morphcore.simulate.trim import StartMode, Trim, trim, trimmed_state
from morphcore.stopping import Stop, one_at_a_time
from morphcore.threads import in_threads, thread_count

Array = NDArray[np.float64]

DIVERGED_ANGLE = 3.0  # rad of error charged for every angle of a row that a diverged flight never reached
LARGEST_SLAB = 256  # parameter sets that one thread flies at a time
ATTITUDE_ROWS = 7  # of the state: quaternion and body rates


@dataclass(frozen=True)
class SampleCase:
    """A sample and the plan that all flights against it share."""

    sample: Trajectory
    plan: FlightPlan

    @property
    def weight(self) -> Array:
        """(3,) square root of the weight of each angle's error."""
        return np.full(3, np.sqrt(self.sample.weight))


@dataclass(frozen=True)
class Evaluation:
    """Errors of parameter sets p against one sample of k rows.

    errors : (p, k, 3) weighted wrapped angle differences, rad. diverged : (p,).
    """

    errors: Array
    diverged: NDArray[np.bool_]

    @property
    def cost(self) -> Array:
        """(p,) J."""
        return np.asarray(np.einsum("pka,pka->p", self.errors, self.errors))


def sample_schedules(aircraft: Aircraft, sample: Trajectory, pointer: str) -> list[Schedule]:
    """Motion of every hinge out of a sample; refuses angles beyond a hinge's range."""
    followed = followed_flight(aircraft, sample, pointer)
    for surface in aircraft.surfaces:
        for hinge in surface.hinges:
            if hinge.drive not in followed:
                continue
            key, schedule = followed[hinge.drive]
            angle = schedule.motion(sample.time_s).angle
            bad = hinge.beyond_range(angle)
            if bad.size:
                unit = f"; are they degrees? Then name the column {key}_deg"
                raise InvalidInput(
                    f"{hinge.drive} {angle[bad[0]]:g} rad is beyond the hinge of {surface.name}",
                    pointer=f"{pointer}/{key}_rad/{bad[0]}",
                    hint=f"its range is {hinge.min_rad:g}..{hinge.max_rad:g} rad"
                    + unit * bool(np.abs(angle).max() > np.pi),
                )
    return hinge_schedules(aircraft, followed)


def sample_cases(
    model: ChainModel,
    samples: Sequence[Trajectory],
    longest_step_s: float = STEP_S,
    pointer: str = "/samples",
    *,
    separate_wings: bool = False,
) -> tuple[SampleCase, ...]:
    """Plans for all samples, for models whose wings share their parameters or have ``separate_wings``."""
    return tuple(
        SampleCase(
            sample,
            flight_plan(
                model,
                sample_schedules(model.aircraft, sample, f"{pointer}/{i}"),
                time_grid(sample.time_s, longest_step_s),
                may_halve=not separate_wings,
            ),
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
        key = tuple(np.round(np.concatenate([case.plan.angles[0], case.plan.wind_N[0]]), 9))
        if key not in known:
            known[key] = trim(case.plan.flown(model), batch, case.plan, start=start)
        yield case, known[key]


def fly_attitudes(
    model: ChainModel, batch: ParameterBatch, case: SampleCase, found: Trim, stop: Stop | None = None
) -> Array:
    """Euler angles (p, k, 3) at the sample's times; NaN from where a flight diverged, or untrimmed."""
    plan, sample = case.plan, case.sample
    model = plan.flown(model)
    constants = lane_constants(model, batch, plan.grid.step_s)
    constants.set_thrust(found.force_B, found.moment_B)
    state = trimmed_state(model, batch, plan, found, psi=float(sample.psi[0]))
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


def evaluate(
    model: ChainModel, batch: ParameterBatch, case: SampleCase, found: Trim, stop: Stop | None = None
) -> Evaluation:
    """Fly parameter sets against one sample."""
    attitude = fly_attitudes(model, batch, case, found, stop)
    diverged = ~np.all(np.isfinite(attitude), axis=(1, 2))
    errors = wrap_angle(attitude - case.sample.euler)
    # a diverged flight: large, finite, and the less the longer it held out
    errors = np.where(np.isfinite(errors), errors, DIVERGED_ANGLE)
    return Evaluation(errors * case.weight, diverged)


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
    """(p, m) all weighted errors of all samples in one row per parameter set."""
    ends = np.cumsum([3 * case.sample.time_s.size for case in cases])
    errors = np.empty((batch.particles, ends[-1]))

    def fly(part: slice, stop: Stop) -> None:
        chosen = batch.select(part)
        for end, (case, found) in zip(ends, shared_trims(model, chosen, cases, start), strict=True):
            own = evaluate(model, chosen, case, found, stop).errors
            errors[part, end - 3 * case.sample.time_s.size : end] = own.reshape(chosen.particles, -1)

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
