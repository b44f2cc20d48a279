"""Flights of candidate schedules in one model: departures of the attitude and torques of the hinge motors.

All candidates of a morph start from one trim, fly one grid of times and share the lattice along the path of
the angle; they differ only in their schedules. They are flown in parallel threads.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from morphcore.frames import euler_from_quaternion
from morphcore.geometry.obstacle import naming_obstacles
from morphcore.models.equivalent import ChainModel, ParameterBatch, lane_constants
from morphcore.models.kinematics import tip_bending
from morphcore.models.soft_joints import chain_obstacle
from morphcore.simulate.batch import fly_batch
from morphcore.simulate.chain_motion import chain_motion
from morphcore.simulate.common_path import CommonPath
from morphcore.simulate.schedule import Hold, Schedule
from morphcore.simulate.steady import departure
from morphcore.simulate.time_grid import time_grid
from morphcore.simulate.torque import hinge_torques
from morphcore.simulate.trim import StartMode, trim, trimmed_state
from morphcore.stopping import Interrupted, Stop, one_at_a_time
from morphcore.threads import in_threads, thread_count
from morphcore.validity import AirMotion
from morphdata.optimize import Weights

Array = NDArray[np.float64]

SAMPLE_S = 0.01  # between the rows whose departures are summed
LONG_FLIGHT = 5_000  # steps per chunk: a fifth of a second
DIVERGED_ANGLE = 3.0  # rad of departure assigned to every angle of a row that a diverged flight did not reach


@dataclass(frozen=True)
class Flown:
    """Flights of p schedules over k rows.

    departure : (p, k, 3) of phi, theta, psi from their values at the start, wrapped, rad; always finite, rows
    missing from a diverged flight are set to DIVERGED_ANGLE. torque : (p, n) of all moved hinges at all
    steps, N m; n is 0 if it was not requested. diverged : (p,).
    """

    departure: Array
    torque: Array
    diverged: NDArray[np.bool_]

    @property
    def variation(self) -> Array:
        """(p,) sum of the squared departures over the rows, rad^2."""
        return np.asarray(np.einsum("pka,pka->p", self.departure, self.departure))

    def errors(self, weights: Weights) -> Array:
        """(p, 3 k) residuals: the departures times the square roots of their weights."""
        roots = np.sqrt([weights.phi, weights.theta, weights.psi])
        return (self.departure * roots).reshape(self.departure.shape[0], -1)

    def cost(self, weights: Weights) -> Array:
        """(p,) J, rad^2."""
        errors = self.errors(weights)
        return np.asarray(np.einsum("pm,pm->p", errors, errors))

    @property
    def peak_torque(self) -> Array:
        """(p,) largest torque of any hinge, N m; 0 if it was not requested."""
        return np.asarray(np.abs(self.torque).max(axis=1, initial=0.0))


def sample_times(duration_s: float, settle_s: float) -> Array:
    """(k,) times of the rows, from the start of the morph to the end of the settling window."""
    rows = int(np.floor((duration_s + settle_s) / SAMPLE_S + 1e-6)) + 1
    return SAMPLE_S * np.arange(max(rows, 3), dtype=np.float64)


class MorphFlights:
    """Flights of one parameter set over one window, all from the same trim.

    Raises
    ------
    TrimNotFound : there is no such steady flight.
    """

    def __init__(
        self,
        model: ChainModel,
        batch: ParameterBatch,
        path: CommonPath,
        times_s: Array,
        *,
        initial_rad: float,
        start: StartMode,
        step_s: float,
    ) -> None:
        self.model, self.path = path.flown(model), path
        # the hinges whose motors drive the morph: motors that only hold do no work and have no limit
        self.moved = np.array([path.moves(hinge) for hinge in self.model.aircraft.hinges], dtype=np.bool_)
        self.times_s = times_s
        self.grid = time_grid(times_s, step_s)
        waiting = path.plan(model, Hold(initial_rad), replace(self.grid, steps=1))
        with naming_obstacles(partial(chain_obstacle, model, batch)):
            found = trim(self.model, batch, waiting, start=start).require(model.flight)
        self.alpha_rad = float(found.alpha[0])  # at the start
        self.bending = tip_bending(self.model, batch, found.q_joint, path.shape)  # (1, s), at the start
        self.constants = lane_constants(self.model, batch, self.grid.step_s)
        self.constants.set_thrust(*found.acting_B)
        self.state = trimmed_state(self.model, batch, waiting, found)

    def fly(self, schedules: Sequence[Schedule], *, torque: bool, stop: Stop | None = None) -> Flown:
        """Fly schedules of the path's drives, with the torque of their motors if requested.

        ``stop`` is called between rounds of one flight per thread, and within long flights too, by one thread
        at a time; True raises Interrupted.
        """
        within = one_at_a_time(stop) if stop is not None and self.grid.steps > LONG_FLIGHT else None
        flown: list[tuple[Array, Array]] = [(np.zeros(0), np.zeros(0))] * len(schedules)

        def one(number: int) -> None:
            flown[number] = self._one(schedules[number], within, torque=torque)

        for first in range(0, len(schedules), thread_count()):
            if stop is not None and stop():
                raise Interrupted
            count = min(thread_count(), len(schedules) - first)
            in_threads(lambda part, first=first: one(first + part), count)  # type: ignore[misc]
        euler = np.stack([attitude for attitude, _ in flown])
        away = departure(euler, self.times_s, self.model.flight.turn_rate_rad_s)
        lost = ~np.isfinite(away)
        return Flown(
            np.where(lost, DIVERGED_ANGLE, away),
            np.stack([torques for _, torques in flown]),
            np.asarray(lost.any(axis=(1, 2))),
        )

    def motion(self, schedule: Schedule) -> AirMotion:
        """Return the motion of the aircraft through the air in one schedule."""
        plan = self.path.plan(self.model, schedule, self.grid)
        return chain_motion(self.model, plan, self.constants, self.state)

    def _one(self, schedule: Schedule, stop: Stop | None, *, torque: bool) -> tuple[Array, Array]:
        """Fly one schedule; return the Euler angles (k, 3) at the rows, and the torques (n,)."""
        plan = self.path.plan(self.model, schedule, self.grid)
        rows = self.model.state_rows if torque else 4
        chunks = fly_batch(self.model, plan, self.constants, self.state, record_rows=rows, stop=stop)
        states = np.concatenate([chunk.rows[..., 0] for chunk in chunks])
        attitude = euler_from_quaternion(states[self.grid.at, :4])
        if not torque:
            return attitude, np.zeros(0)
        return attitude, hinge_torques(self.model, plan, self.constants, states)[:, self.moved].ravel()
