"""The stage of the equivalent model, called from Python and counted, shared by all candidate steppers.

A stage is what costs time: one pass root -> tips, one lattice product, one articulated-body pass.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.kernels.one_stage import one_stage
from morphcore.aero.kernels.loads import L_SLOW_DECAY
from morphcore.lanes import lane_type
from morphcore.models.equivalent import (
    ChainModel,
    LaneConstants,
    ParameterBatch,
    lane_constants,
    to_lanes,
)
from morphcore.models.kernels.layout import (
    JOINTS,
    LINKS_C,
    S_FREE,
    constant_rows,
    joint_rows_of_scratch,
    state_rows,
)
from morphcore.models.parameters import lag_weights
from morphcore.multibody.kernels.articulated import LINK_ROWS
from morphcore.simulate.batch import shared_numbers
from morphcore.simulate.operator_table import OperatorTable
from morphcore.simulate.plan import FlightPlan
from morphcore.simulate.schedule import Schedule
from morphcore.simulate.surface_motion import surface_accelerations, surface_rows
from morphcore.simulate.trim import Trim, trimmed_state

Array = NDArray[np.float64]
Air = Callable[[Array], Array]

MAX_MOMENTS = 64  # kept; each holds a lattice operator
SAME_TIME_S = 1e-9  # times closer than that are one


@dataclass(frozen=True)
class Moment:
    """Inputs of the stage at one time: operator, strips, hinges and wind."""

    operator: Array
    strips: Array
    hinges: Array
    wind_N: Array


class Course:
    """Schedules, wind and lattice at any time of a flight, from one fine plan.

    All steppers read the same table of lattices, so that their errors are those of time alone.
    """

    def __init__(
        self, model: ChainModel, schedules: Sequence[Schedule], fine: FlightPlan, air: Air | None = None
    ) -> None:
        self.model = model
        self.schedules = schedules
        self.fine = fine
        self.air = air
        self._known: dict[int, Moment] = {}

    @property
    def start_s(self) -> float:
        """First time, s."""
        return self.fine.grid.start_s

    def at(self, time_s: float) -> Moment:
        """Everything at one time."""
        key = round(time_s / SAME_TIME_S)
        if key not in self._known:
            if len(self._known) == MAX_MOMENTS:
                del self._known[next(iter(self._known))]  # the oldest: steppers look back a step at most
            self._known[key] = self._moment(time_s)
        return self._known[key]

    def _moment(self, time_s: float) -> Moment:
        grid, table = self.fine.grid, self.fine.table
        time = np.array([time_s])
        position = np.interp(time, grid.times_s, table.position)
        operators, strips = OperatorTable(table.matrices, table.strips, position).between(0, 1)
        motions = [schedule.motion(time) for schedule in self.schedules]
        angles, rates = (np.stack([getattr(m, name) for m in motions], axis=1) for name in ("angle", "rate"))
        rows = surface_rows(self.model.aircraft, angles, rates)[0]
        wind = self.fine.wind_N[0] if self.air is None else self.air(time)[0]
        return Moment(operators[0], strips[0], rows, np.asarray(wind))

    def mean_acceleration(self, begin_s: float, end_s: float) -> Array:
        """(s, 6) mean acceleration of the surfaces between two times, as `FlightPlan.mean_accelerations`."""
        times = np.array([begin_s, 0.5 * (begin_s + end_s), end_s])
        motions = [schedule.motion(times) for schedule in self.schedules]
        angles, rates = (np.stack([getattr(m, name) for m in motions], axis=1) for name in ("angle", "rate"))
        mean = (rates[2:] - rates[:1]) / (end_s - begin_s)
        return np.asarray(surface_accelerations(self.model.aircraft, angles[1:2], rates[1:2], mean)[0])


@dataclass(frozen=True)
class Lag:
    """Lag states (links, 3, width) that are settled up to a time, and the motion of the links then."""

    time_s: float
    slow: Array
    fast: Array
    motion: Array


class Stages:
    """Rates of one block of lanes, with the joints' implicit terms; counts its calls.

    The mechanical state u (rows, width) is attitude, velocities, position, joint angles and rates.
    """

    def __init__(self, model: ChainModel, batch: ParameterBatch, course: Course, found: Trim) -> None:
        self.model = model
        self.course = course
        self.count = 0
        self._constants: dict[int, Array] = {}
        laid: LaneConstants = lane_constants(model, batch, 1.0)
        laid.set_thrust(*found.acting_B)
        self._rows, self._ranges = laid.rows[0], laid.ranges[0]
        lag_s = np.stack([model.on_surface(batch, s)["lag_s"] for s in range(len(model.surfaces))], axis=1)
        self._lag_s = to_lanes(np.repeat(lag_s, model.surfaces[:, 1], axis=1))[0]
        state = to_lanes(trimmed_state(model, batch, course.fine, found))[0]
        self.width = state.shape[1]
        _, self.joint_rates, self.slow, self.fast, self.previous, _ = state_rows(
            model.links, model.coordinates
        )
        shape = (model.links, 3, self.width)
        self.first = state[: self.slow].copy()
        self.first_lag = Lag(
            course.start_s,
            *(
                state[i : i + 3 * model.links].reshape(shape).copy()
                for i in (self.slow, self.fast, self.previous)
            ),
        )
        stiffness, damping, overlap = constant_rows(model.links, model.coordinates)
        self.stiffness, self.damping = self._rows[stiffness:damping], self._rows[damping:overlap]
        self._state = np.zeros_like(state)
        self._scratch = np.zeros((model.scratch_rows, self.width))
        rows, columns = model.lattice.operator_shape
        self._inputs, self._outputs = np.zeros((columns, self.width)), np.zeros((rows, self.width))
        self._base = np.zeros((JOINTS, self.width))
        self._shared = shared_numbers(model)
        tau, added, acceleration, gimbals, _ = joint_rows_of_scratch(model.links, model.coordinates)
        self._tau, self._added = self._scratch[tau:added], self._scratch[added:acceleration]
        self._acceleration = self._scratch[acceleration:gimbals]
        self._twists = self._scratch[S_FREE : S_FREE + 6 * model.links].reshape(model.links, 6, self.width)

    def lag_weights(self, step_s: float) -> Array:
        """Weights (links, width, 4) of both lag states for a step of any length, of none too."""
        if abs(step_s) < SAME_TIME_S:
            return np.broadcast_to([1.0, 0.0, 1.0, 0.0], (*self._lag_s.shape, 4))
        return lag_weights(self._lag_s, step_s)

    def lag_constants(self, step_s: float) -> Array:
        """The block's constants with the lag weights of a step of that length."""
        key = round(step_s / SAME_TIME_S)
        if key not in self._constants:
            rows = self._rows.copy()
            weights = self.lag_weights(step_s)
            for link in range(self.model.links):
                column = LINKS_C + LINK_ROWS * link + L_SLOW_DECAY
                rows[column : column + 4] = weights[link].T
            self._constants[key] = rows
        return self._constants[key]

    def __call__(
        self,
        time_s: float,
        hinge_acceleration: Array,
        u: Array,
        lag: Lag,
        implicit_s: float = 0.0,
        slope: Array | None = None,
    ) -> tuple[Array, Lag]:
        """Rates k = F(t, u) + A (implicit_s k + slope), and the lag states settled at that time.

        A is the Jacobian of the joints' springs and dampers (see simulate/kernels/step.py).
        """
        self.count += 1
        step_s = time_s - lag.time_s
        constants = self.lag_constants(step_s)
        weights = self.lag_weights(step_s).transpose(2, 0, 1)[:, :, None, :]
        slow, fast = (
            lag.motion + weights[i] * (state - lag.motion) for i, state in ((0, lag.slow), (2, lag.fast))
        )
        q, v = u[JOINTS : self.joint_rates], u[self.joint_rates :]
        g = implicit_s
        hq, hv = (
            (0.0, 0.0) if slope is None else (slope[JOINTS : self.joint_rates], slope[self.joint_rates :])
        )
        self._added[:] = g * (self.damping + g * self.stiffness)
        self._tau[:] = -self.stiffness * (q + g * (v + hv) + hq) - self.damping * (v + hv)
        self._state[: self.slow] = u
        self._state[self.slow : self.fast] = slow.reshape(-1, self.width)
        self._state[self.fast : self.previous] = fast.reshape(-1, self.width)
        self._state[self.previous :] = lag.motion.reshape(-1, self.width)
        moment = self.course.at(time_s)
        one_stage(
            lane_type(self.width), self.model.surfaces, self._ranges, self._shared, moment.strips,
            moment.hinges, hinge_acceleration, moment.operator, moment.wind_N, constants, self._state,
            self._scratch, self._inputs, self._outputs, self._base,
        )  # fmt: skip
        acceleration = self._acceleration
        rates = np.concatenate([self._base, v + g * acceleration + hv, acceleration])
        motion = self._twists[:, (5, 0, 1)].copy()
        change = motion - lag.motion
        return rates, Lag(time_s, slow + weights[1] * change, fast + weights[3] * change, motion)
