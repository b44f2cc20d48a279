"""What sensors of a flown aircraft would read: channels of parameter sets along a plan, at any time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from morphcore.frames import euler_from_quaternion, euler_rates, rotation_from_quaternion
from morphcore.models.equivalent import ChainModel, ParameterBatch
from morphcore.models.kernels.layout import JOINTS, OMEGA, POSITION, VELOCITY
from morphcore.models.kinematics import link_poses, tip_positions
from morphcore.multibody.kernels.hinge import HINGE_ROWS
from morphcore.simulate.channels import CHANNELS, Channel, parts_of
from morphcore.simulate.plan import FlightPlan
from morphcore.simulate.record import FlightRecord, Loads
from morphcore.simulate.trim import Trim
from morphdata.measurement import ANGLES

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Readings:
    """Channels c of parameter sets p at the times of a plan's grid, K of them.

    Attributes
    ----------
    start_s, step_s : float
        Of the grid.
    values, slopes : ndarray, shape (p, K, c)
        Readings, angles without jumps, and their time derivatives.
    """

    start_s: float
    step_s: float
    values: Array
    slopes: Array

    def at(self, times_s: Array) -> tuple[Array, Array]:
        """Readings and time derivatives (p, k, c) at times (p, k), by cubic Hermite interpolation.

        Beyond the grid they go on straight: before its start a trimmed flight is steady.
        """
        last = self.values.shape[1] - 1
        place = (times_s - self.start_s) / self.step_s
        inside = np.clip(place, 0.0, float(last))
        left = np.minimum(inside.astype(np.int64), last - 1)
        s, beyond = (inside - left)[..., None], ((place - inside) * self.step_s)[..., None]
        low, high = left[..., None], left[..., None] + 1
        a, b = (np.take_along_axis(self.values, index, axis=1) for index in (low, high))
        da, db = (self.step_s * np.take_along_axis(self.slopes, index, axis=1) for index in (low, high))
        cubic, square = 2.0 * (a - b) + da + db, 3.0 * (b - a) - 2.0 * da - db
        rate = (da + s * (2.0 * square + 3.0 * s * cubic)) / self.step_s
        return a + s * (da + s * (square + s * cubic)) + beyond * rate, rate


def rows_needed(channels: Sequence[str], coordinates: int) -> int:
    """Rows of the state that some channels are computed from: attitude and rates, the air, joints."""
    others = [name for name in channels if name not in ANGLES]
    if any(name.startswith("tip_") for name in others):
        return JOINTS + coordinates
    return POSITION if all(name in "pqr" for name in others) is False else VELOCITY


def readings(
    model: ChainModel,
    batch: ParameterBatch,
    plan: FlightPlan,
    found: Trim,
    rows: Array,
    channels: Sequence[str],
    whole: ChainModel,
) -> Readings:
    """Channels out of recorded states.

    Parameters
    ----------
    model : ChainModel
        What flies the plan (`FlightPlan.flown`).
    batch : ParameterBatch
        The p sets.
    plan : FlightPlan
    found : Trim
    rows : ndarray, shape (K, r, p)
        The first rows of the states at all grid times.
    channels : sequence of str
        Names of the columns.
    whole : ChainModel
        That of the whole aircraft, whose surfaces give the columns of tips their names.
    """
    states = np.ascontiguousarray(rows.transpose(2, 0, 1))
    omega_B = states[..., OMEGA:VELOCITY]
    euler = np.unwrap(euler_from_quaternion(states[..., :OMEGA]), axis=1)
    rates = euler_rates(euler, omega_B)
    step = plan.grid.step_s
    values = np.empty((*states.shape[:2], len(channels)))
    slopes = np.empty_like(values)
    others = [name for name in channels if name not in ANGLES]
    columns = _columns(model, batch, plan, found, states, others, whole) if others else {}
    for number, name in enumerate(channels):
        if name in ANGLES:
            axis = ANGLES.index(name)
            values[..., number], slopes[..., number] = euler[..., axis], rates[..., axis]
        else:
            values[..., number] = columns[name]
            slopes[..., number] = np.gradient(columns[name], step, axis=1, edge_order=2)
    return Readings(plan.grid.start_s, step, values, slopes)


def channel_of(column: str) -> Channel | None:
    """Find the channel of a column: its name, or that before the part of a surface; None where none is."""
    exact = [channel for channel in CHANNELS if channel.name == column]
    parts = [channel for channel in CHANNELS if column.startswith(f"{channel.name}_")]
    return next(iter([*exact, *parts]), None)


def _columns(
    model: ChainModel,
    batch: ParameterBatch,
    plan: FlightPlan,
    found: Trim,
    states: Array,
    names: Sequence[str],
    whole: ChainModel,
) -> dict[str, Array]:
    """Columns (p, K) of channels beside the attitude, all states as the rows of one record."""
    channels = list(dict.fromkeys(channel for name in names if (channel := channel_of(name)) is not None))
    particles, times = states.shape[:2]
    flat = states.reshape(particles * times, -1)
    R_NB = rotation_from_quaternion(flat[:, :OMEGA])
    known = flat.shape[1]
    velocity_B = flat[:, VELOCITY:POSITION] if known >= POSITION else np.zeros((flat.shape[0], 3))
    loads = None
    if "loads" in parts_of(channels):
        rates = np.gradient(states[..., VELOCITY:POSITION], plan.grid.step_s, axis=1, edge_order=2)
        loads = Loads(velocity_rate_B=rates.reshape(-1, 3))
    tips_z = twist = np.zeros((flat.shape[0], 0))
    if known > JOINTS or any(name.startswith("tip_") for name in names):
        tips_z, twist = _tips(model, batch, plan, states)
        if plan.halved and whole.mirror is not None:  # the other half did the same
            tips_z, twist = whole.mirror.spread(tips_z), whole.mirror.spread(twist)
    record = FlightRecord(
        euler=euler_from_quaternion(flat[:, :OMEGA]),
        omega_B=flat[:, OMEGA:VELOCITY],
        velocity_N=np.einsum("kij,kj->ki", R_NB, velocity_B),
        position_N=np.zeros((flat.shape[0], 3)),
        wind_N=np.tile(plan.wind_N, (particles, 1)),
        angles=np.zeros((flat.shape[0], 0)),
        tips_z=tips_z,
        trim=found,
        tips_twist=twist,
        loads=loads,
    )
    columns: dict[str, Array] = {}
    for channel in channels:
        columns |= channel.columns(record, whole.aircraft, model.flight)
    return {name: columns[name].reshape(particles, times) for name in names}


def _tips(model: ChainModel, batch: ParameterBatch, plan: FlightPlan, states: Array) -> tuple[Array, Array]:
    """Tips below their roots along z of B, m, and their twist, rad: (p K, surfaces of the whole aircraft)."""
    particles, times = states.shape[:2]
    repeated = batch.select(np.repeat(np.arange(particles), times))
    q_joint = states[..., JOINTS : JOINTS + model.coordinates].reshape(particles * times, -1)
    level = np.zeros((len(model.aircraft.surfaces), HINGE_ROWS))
    level[:, :9] = np.eye(3).ravel()
    tips_W = tip_positions(model, repeated, level, q_joint).reshape(particles, times, -1, 3)
    down_W = plan.hinges[:, :, 6:9]  # third row of R_BW
    tips_z = np.einsum("ksi,pksi->pks", down_W, tips_W).reshape(particles * times, -1)
    R_WL, _ = link_poses(model, repeated, level, q_joint)
    last = model.surfaces[:, 0] + model.surfaces[:, 1] - 1
    twist = np.arcsin(np.clip(R_WL[:, last, 0, 2], -1.0, 1.0))
    return tips_z, twist
