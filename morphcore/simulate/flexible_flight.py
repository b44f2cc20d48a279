"""One flight of the flexible model, in chunks."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from morphcore.frames import euler_from_rotation
from morphcore.models.flexible import FlexibleModel
from morphcore.simulate.flexible import FlexibleFlight, FlexibleRun, set_in_motion
from morphcore.simulate.flexible_start import start_flexible
from morphcore.simulate.kernels.flexible_step import RECORD
from morphcore.simulate.record import FlightRecord, Loads, Part, require_sound
from morphcore.simulate.schedule import Schedule
from morphcore.simulate.time_grid import TimeGrid
from morphcore.simulate.trim import StartMode, Trim
from morphcore.stopping import Stop, check_stop
from morphcore.threads import one_blas_thread

Array = NDArray[np.float64]

CHUNK_STEPS = 100  # steps of the default lattice: about a tenth of a second


def flexible_flight(
    model: FlexibleModel,
    schedules: Sequence[Schedule],
    grid: TimeGrid,
    at: NDArray[np.int64],
    *,
    parts: frozenset[Part] = frozenset(),
    start: StartMode,
    air_velocity_N: Callable[[Array], Array] | None,
    stop: Stop | None,
) -> Iterator[tuple[float, FlightRecord | None]]:
    """Fly the flexible model; yield the fraction flown after every chunk, and the record with the last.

    Parameters
    ----------
    at : (k,) rows of the grid to report. parts : parts of the record to fill in. Others as in
    `flight.simulate`.
    """
    times = grid.times_s
    wind_N = (
        np.tile(model.flight.wind_N, (times.size, 1)) if air_velocity_N is None else air_velocity_N(times)
    )
    flight = FlexibleFlight(model)
    with one_blas_thread():
        path, trim = start_flexible(flight, schedules, grid, wind_N[0], start)
    flight.thrust = np.concatenate([trim.moment_B + trim.thrust_moment_B, trim.force_B])
    begin = set_in_motion(flight, path, wind_N[0], trim.state)
    run = FlexibleRun(flight, path, grid, wind_N, begin)
    for first in range(0, grid.steps, CHUNK_STEPS):
        yield first / grid.steps, None
        check_stop(stop)
        with one_blas_thread():
            run.fly_to(min(first + CHUNK_STEPS, grid.steps))
    history = _history(run.records)
    require_sound(history, history[:, 6:9], model.flight, times)
    history, records = history[at], run.records[at]
    tips = model.roots.size
    sines = records[:, RECORD + tips :]
    record = FlightRecord(
        euler=history[:, :3],
        omega_B=history[:, 3:6],
        velocity_N=history[:, 6:9],
        position_N=history[:, 9:12],
        wind_N=wind_N[at],
        angles=np.concatenate([path.angle[at], path.controls[at]], axis=1),
        tips_z=history[:, 12:],
        tips_twist=np.arcsin(np.clip(sines, -1.0, 1.0)) if "twist" in parts else None,
        loads=Loads(records[:, 21:24]) if "loads" in parts else None,
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
    )
    yield 1.0, record


def _history(records: Array) -> Array:
    """Euler angles, omega_B, velocity_N, position_N, and the tips' z from a run's records."""
    R_NB = records[:, :9].reshape(-1, 3, 3)
    velocity_N = np.einsum("kij,kj->ki", R_NB, records[:, 12:15])
    euler = np.stack([euler_from_rotation(R) for R in R_NB])
    tips = (records.shape[1] - RECORD) // 2
    return np.concatenate(
        [euler, records[:, 9:12], velocity_N, records[:, 15:18], records[:, RECORD : RECORD + tips]], axis=1
    )
