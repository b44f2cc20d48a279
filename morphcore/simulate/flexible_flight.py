"""One flight of the flexible model, in chunks."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.environment import MovingAir
from morphcore.aero.gust_lag import before_wagner
from morphcore.aero.stall import StallRecord, record_of, stalls
from morphcore.frames import euler_from_rotation
from morphcore.models.flexible import FlexibleModel
from morphcore.simulate.flexible import FlexibleFlight, FlexibleRun, set_in_motion
from morphcore.simulate.flexible_outputs import FlexibleOutputs
from morphcore.simulate.flexible_start import start_flexible
from morphcore.simulate.gust_table import GustTable
from morphcore.simulate.kernels.flexible_step import RECORD
from morphcore.simulate.record import FlightRecord, Loads, Outputs, air_at_reference, require_sound
from morphcore.simulate.schedule import Schedule
from morphcore.simulate.time_grid import TimeGrid
from morphcore.simulate.trim import StartMode, Trim
from morphcore.stopping import Stop, check_stop
from morphcore.threads import one_blas_thread

Array = NDArray[np.float64]

NOTHING_MORE = Outputs()
CHUNK_STEPS = 100  # steps of the default lattice: about a tenth of a second


def flexible_flight(
    model: FlexibleModel,
    schedules: Sequence[Schedule],
    grid: TimeGrid,
    at: NDArray[np.int64],
    *,
    outputs: Outputs = NOTHING_MORE,
    start: StartMode,
    air: MovingAir | None,
    stop: Stop | None,
) -> Iterator[tuple[float, FlightRecord | None]]:
    """Fly the flexible model; yield the fraction flown after every chunk, and the record with the last.

    Parameters
    ----------
    at : (k,) rows of the grid to report. outputs : what to record besides. Others as in `flight.simulate`.
    """
    times = grid.times_s
    wind_N = np.tile(model.flight.wind_N, (times.size, 1))
    flight = FlexibleFlight(model)
    with one_blas_thread():
        path, trim = start_flexible(flight, schedules, grid, wind_N[0], start)
    flight.thrust = np.concatenate([trim.moment_B + trim.thrust_moment_B, trim.force_B])
    begin = set_in_motion(flight, path, wind_N[0], trim.state)
    gusts = None
    if air is not None:
        table = GustTable(air, model.lattice, trim.alpha, before_wagner(), times, path.angle)
        gusts = table.every()
    run = FlexibleRun(flight, path, grid, wind_N, begin, gusts)
    further = FlexibleOutputs(model, path, wind_N, outputs, gusts) if outputs.of_states else None
    reported = deque([] if further is None else enumerate(at))
    for first in range(0, grid.steps, CHUNK_STEPS):
        yield first / grid.steps, None
        check_stop(stop)
        last = min(first + CHUNK_STEPS, grid.steps)
        with one_blas_thread():
            while further is not None and reported and reported[0][1] <= last:
                number, row = reported.popleft()
                run.fly_to(int(row))
                further.evaluate(run.state, int(row), number)
            run.fly_to(last)
    history = _history(run.records, model.roots.size)
    require_sound(history, history[:, 6:9], model.flight, times)
    history, records = history[at], run.records[at]
    tips = model.roots.size
    sines, loads, shape = records[:, RECORD + tips : RECORD + 2 * tips], None, None
    if outputs.parts & {"loads", "surfaces"}:
        loads = Loads(records[:, 18:24])
    if further is not None and "surfaces" in outputs.parts:
        loads = Loads(records[:, 18:24], np.array(further.found.torque), further.surfaces())
    chosen = outputs.shape_rows
    if further is not None and chosen.size:
        shape = further.shape(times[at][chosen], history[chosen, 9:12], records[chosen, :9].reshape(-1, 3, 3))
    record = FlightRecord(
        euler=history[:, :3],
        omega_B=history[:, 3:6],
        velocity_N=history[:, 6:9],
        position_N=history[:, 9:12],
        wind_N=air_at_reference(model.flight, air, times[at]),
        angles=np.concatenate([path.angle[at], path.controls[at]], axis=1),
        tips_z=history[:, 12:],
        tips_twist=np.arcsin(np.clip(sines, -1.0, 1.0)) if "twist" in outputs.parts else None,
        loads=loads,
        trim=Trim(
            alpha=np.array([trim.alpha]),
            force_B=trim.force_B[None],
            moment_B=trim.moment_B[None],
            q_joint=np.zeros((1, 0)),
            converged=np.array([True]),
            residual=np.array([trim.residual]),
            thrust_moment_B=trim.thrust_moment_B[None],
            bank=np.array([trim.bank]),
        ),
        shape=shape,
        point_force={} if further is None else further.point_force(),
        points=outputs.points,
        stall=_stall(model, records[:, RECORD + 2 * tips :]),
    )
    yield 1.0, record


def _history(records: Array, tips: int) -> Array:
    """Euler angles, omega_B, velocity_N, position_N, and the tips' z from a run's records."""
    R_NB = records[:, :9].reshape(-1, 3, 3)
    velocity_N = np.einsum("kij,kj->ki", R_NB, records[:, 12:15])
    euler = np.stack([euler_from_rotation(R) for R in R_NB])
    return np.concatenate(
        [euler, records[:, 9:12], velocity_N, records[:, 15:18], records[:, RECORD : RECORD + tips]], axis=1
    )


def _stall(model: FlexibleModel, worst: Array) -> StallRecord | None:
    """How near sections came to their limits, from the ends (k, 3) of a run's records; or None."""
    surfaces, lattices = model.aircraft.surfaces, model.lattice.lattices
    if not stalls(surfaces):
        return None
    ratio, strip, upper = worst.T
    return record_of(ratio, strip.astype(np.int64), upper > 0.0, surfaces, lattices)
