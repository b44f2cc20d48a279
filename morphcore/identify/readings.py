"""What sensors of a flown aircraft would read: channels of parameter sets along a plan, at any time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from morphcore.frames import euler_from_quaternion, euler_rates, rotation_from_quaternion
from morphcore.models.equivalent import ChainModel, ParameterBatch
from morphcore.models.kernels.layout import JOINTS, OMEGA, POSITION, VELOCITY
from morphcore.simulate.chain_outputs import tips_twist, tips_z
from morphcore.simulate.channels import CHANNELS, parts_of
from morphcore.simulate.plan import FlightPlan
from morphcore.simulate.record import FlightRecord, Loads
from morphcore.simulate.trim import Trim
from morphdata.channels import channel_of
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
    known_channels = {channel.name: channel for channel in CHANNELS}
    facts = dict.fromkeys(each.name for name in names if (each := channel_of(name)) is not None)
    channels = [known_channels[name] for name in facts]
    particles, times = states.shape[:2]
    flat = states.reshape(particles * times, -1)
    R_NB = rotation_from_quaternion(flat[:, :OMEGA])
    known = flat.shape[1]
    velocity_B = flat[:, VELOCITY:POSITION] if known >= POSITION else np.zeros((flat.shape[0], 3))
    loads = None
    if "loads" in parts_of(channels):
        rates = np.gradient(states[..., OMEGA:POSITION], plan.grid.step_s, axis=1, edge_order=2)
        loads = Loads(twist_rate_B=rates.reshape(-1, 6))
    below = twist = np.zeros((flat.shape[0], 0))
    if known > JOINTS or any(name.startswith("tip_") for name in names):
        q_joint = states[..., JOINTS : JOINTS + model.coordinates]
        below = tips_z(model, batch, plan.hinges, q_joint).reshape(flat.shape[0], -1)
        twist = tips_twist(model, batch, q_joint).reshape(flat.shape[0], -1)
        if plan.halved and whole.mirror is not None:  # the other half did the same
            below, twist = whole.mirror.spread(below), whole.mirror.spread(twist)
    record = FlightRecord(
        euler=euler_from_quaternion(flat[:, :OMEGA]),
        omega_B=flat[:, OMEGA:VELOCITY],
        velocity_N=np.einsum("kij,kj->ki", R_NB, velocity_B),
        position_N=np.zeros((flat.shape[0], 3)),
        wind_N=np.tile(plan.wind_N, (particles, 1)),
        angles=np.zeros((flat.shape[0], 0)),
        tips_z=below,
        trim=found,
        tips_twist=twist,
        loads=loads,
    )
    columns: dict[str, Array] = {}
    for channel in channels:
        columns |= channel.columns(record, whole.aircraft, model.flight)
    return {name: columns[name].reshape(particles, times) for name in names}
