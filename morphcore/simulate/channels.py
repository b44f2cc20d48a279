"""The list of a flight's output channels: what a trajectory can hold besides attitude and hinge angles.

Record, CSV file, result document, command and page are driven by this list and by ``morphdata/channels.py``,
which holds each channel's unit and description. To add a channel, add one entry to both; if it needs numbers
that the record lacks, the models record them as a `Part`.

Conventions
-----------
B : body axes, forward, right, down, with the origin at the reference point. N : north, east, down.

- ``alpha`` = atan2(w, u) and ``beta`` = asin(v / V), of the velocity (u, v, w) in B of the reference point
  relative to the air: wind, gust and turbulence are subtracted.
- ``fx fy fz`` : specific force f = a - g in B at the reference point, as measured by an accelerometer there.
- ``nx ny nz`` : load factors (fx, fy, -fz) / g, positive forward, to the right and **up**. In steady level
  flight nz = cos(alpha), +1 to first order, and nx = sin(alpha). g is the flight's own gravity.
- ``tip_z`` : tip of a surface's elastic axis below its root along z of B, hence negative for a wing that its
  lift bends up. ``tip_left_z``, ``tip_right_z`` : of the first hinged surface of a side.
- ``tip_twist`` : the torsion of the rotation Rx(flap) Ry(torsion) Rz(edgewise) from the axes of a tip to
  those of its root, nose up.
- ``hinge_torque`` : the total torque of a drive's motors, along its positive coordinate; of a drive that
  slides it is ``drive_force``. At a corner of a schedule's
  rate the hinge's acceleration, and with it torque and load factor, is that of the morph.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from morphcore.frames import quaternion_from_euler, rotation_from_quaternion
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.simulate.record import FlightRecord, Part
from morphdata.channel_choice import ChannelChoice, channels_faults
from morphdata.channels import channel_facts, column_parts, default_channels
from morphdata.faults import refuse

Array = NDArray[np.float64]
Evaluate = Callable[[FlightRecord, Aircraft, Flight], Array | Mapping[str, Array]]


@dataclass(frozen=True)
class Channel:
    """One quantity of a flight over time.

    Attributes
    ----------
    name : str
        As in ``morphdata/channels.py``.
    evaluate : callable, (FlightRecord, Aircraft, Flight) -> ndarray, shape (k,), or mapping of str to ndarray
        Its values at the record's k times. A mapping holds several columns, or none, keyed by the suffix of
        the name ("" for the name alone).
    needs : frozenset of {"twist", "loads"}
        Parts of the record that models leave out unless a channel needs them.
    """

    name: str
    evaluate: Evaluate
    needs: frozenset[Part] = field(default=frozenset())

    @property
    def unit(self) -> str:
        """Unit of its values, "1" if dimensionless."""
        return channel_facts(self.name).unit

    def columns(self, record: FlightRecord, aircraft: Aircraft, flight: Flight) -> dict[str, Array]:
        """Its columns (k,) by their names."""
        values = self.evaluate(record, aircraft, flight)
        if isinstance(values, Mapping):
            named = ((f"{self.name}_{part}" if part else self.name, each) for part, each in values.items())
            return {name: np.array(column) for name, column in named}
        return {self.name: np.array(values)}


def requested_channels(
    names: Sequence[str] | None, model_kind: str, gravity_m_s2: float
) -> tuple[Channel, ...]:
    """Find the requested channels of a flight.

    Parameters
    ----------
    names : sequence of str, optional
        None: the default channels.
    model_kind : {"rigid", "equivalent", "flexible"}
    gravity_m_s2 : float

    Raises
    ------
    InvalidInput
        A name is unknown or given twice, or this flight has no such channel.
    """
    if names is None:
        names = default_channels()
    else:
        names = ChannelChoice.parse({"channels": list(names)}).channels
        refuse(each.under("/channels") for each in channels_faults(names, model_kind, gravity_m_s2))
    known = {channel.name: channel for channel in CHANNELS}
    return tuple(known[name] for name in names)


def parts_of(channels: Iterable[Channel]) -> frozenset[Part]:
    """The parts of a record that some channels need."""
    return frozenset[Part]().union(*(channel.needs for channel in channels))


def channel_columns(
    channels: Iterable[Channel], record: FlightRecord, aircraft: Aircraft, flight: Flight
) -> dict[str, Array]:
    """Columns (k,) of some channels, in order, SI units and radians."""
    columns: dict[str, Array] = {}
    for channel in channels:
        columns |= channel.columns(record, aircraft, flight)
    return columns


# motion of the fuselage


def _axis(name: str, number: int) -> Evaluate:
    return lambda record, _aircraft, _flight: getattr(record, name)[:, number]


def _rotation(record: FlightRecord) -> Array:
    """R_NB (k, 3, 3)."""
    return rotation_from_quaternion(quaternion_from_euler(*record.euler.T))


def _through_air_B(record: FlightRecord) -> Array:
    """Velocity of the reference point relative to the air in B, (k, 3) m/s."""
    return np.asarray(np.einsum("kij,ki->kj", _rotation(record), record.velocity_N - record.wind_N))


def _alpha(record: FlightRecord, _aircraft: Aircraft, _flight: Flight) -> Array:
    u, _, w = _through_air_B(record).T
    return np.asarray(np.arctan2(w, u))


def _beta(record: FlightRecord, _aircraft: Aircraft, _flight: Flight) -> Array:
    u, v, w = _through_air_B(record).T
    return np.asarray(np.arctan2(v, np.hypot(u, w)))  # asin(v / V), also where V is 0


def _airspeed(record: FlightRecord, _aircraft: Aircraft, _flight: Flight) -> Array:
    return np.asarray(np.linalg.norm(record.velocity_N - record.wind_N, axis=1))


# specific force


def _specific_force_B(record: FlightRecord, flight: Flight) -> Array:
    """f_B = dv_B/dt + omega_B x v_B - g_B, (k, 3) m/s^2."""
    assert record.loads is not None  # noqa: S101 - `needs` says so
    R_NB = _rotation(record)
    velocity_B = np.einsum("kij,ki->kj", R_NB, record.velocity_N)
    acceleration_B = record.loads.velocity_rate_B + np.cross(record.omega_B, velocity_B)
    return np.asarray(acceleration_B - flight.gravity_m_s2 * R_NB[:, 2])


def _force(number: int) -> Evaluate:
    return lambda record, _aircraft, flight: _specific_force_B(record, flight)[:, number]


def _load_factor(number: int, sign: float) -> Evaluate:
    return lambda record, _aircraft, flight: (
        sign * _specific_force_B(record, flight)[:, number] / flight.gravity_m_s2
    )


# surfaces and their drives


def _tip_of_side(side: str) -> Evaluate:
    """Of the side's first hinged surface; no column if there is none."""

    def evaluate(record: FlightRecord, aircraft: Aircraft, _flight: Flight) -> Mapping[str, Array]:
        hinged = [k for k, each in enumerate(aircraft.surfaces) if each.side == side and each.hinges]
        return {"": record.tips_z[:, hinged[0]]} if hinged else {}

    return evaluate


def _per_surface(aircraft: Aircraft, values: Array) -> dict[str, Array]:
    parts = column_parts(surface.name for surface in aircraft.surfaces)
    return dict(zip(parts, values.T, strict=True))


def _tip_z(record: FlightRecord, aircraft: Aircraft, _flight: Flight) -> Mapping[str, Array]:
    return _per_surface(aircraft, record.tips_z)


def _tip_twist(record: FlightRecord, aircraft: Aircraft, _flight: Flight) -> Mapping[str, Array]:
    assert record.tips_twist is not None  # noqa: S101 - `needs` says so
    return _per_surface(aircraft, record.tips_twist)


def _of_motors(record: FlightRecord, aircraft: Aircraft, *, sliding: bool) -> Mapping[str, Array]:
    """Torque, N m, or force, N, (k,) of the motors of each drive that turns, or slides."""
    assert record.loads is not None  # noqa: S101 - `needs` says so
    assert record.loads.hinge_torque is not None  # noqa: S101 - ``models`` in the documents says so
    torques: dict[str, Array] = {}
    for column, hinge in zip(record.loads.hinge_torque.T, aircraft.hinges, strict=True):
        if hinge.prismatic == sliding:
            torques[hinge.drive] = torques[hinge.drive] + column if hinge.drive in torques else column
    return torques


def _hinge_torque(record: FlightRecord, aircraft: Aircraft, _flight: Flight) -> Mapping[str, Array]:
    return _of_motors(record, aircraft, sliding=False)


def _drive_force(record: FlightRecord, aircraft: Aircraft, _flight: Flight) -> Mapping[str, Array]:
    return _of_motors(record, aircraft, sliding=True)


TWIST: frozenset[Part] = frozenset({"twist"})
LOADS: frozenset[Part] = frozenset({"loads"})

CHANNELS: list[Channel] = [
    *(Channel(name, _axis("omega_B", k)) for k, name in enumerate("pqr")),
    *(Channel(f"v{name}", _axis("velocity_N", k)) for k, name in enumerate("xyz")),
    *(Channel(name, _axis("position_N", k)) for k, name in enumerate("xyz")),
    Channel("tip_left_z", _tip_of_side("left")),
    Channel("tip_right_z", _tip_of_side("right")),
    Channel("alpha", _alpha),
    Channel("beta", _beta),
    Channel("airspeed", _airspeed),
    *(Channel(f"f{name}", _force(k), LOADS) for k, name in enumerate("xyz")),
    Channel("nx", _load_factor(0, 1.0), LOADS),
    Channel("ny", _load_factor(1, 1.0), LOADS),
    Channel("nz", _load_factor(2, -1.0), LOADS),  # upward
    Channel("tip_z", _tip_z),
    Channel("tip_twist", _tip_twist, TWIST),
    Channel("hinge_torque", _hinge_torque, LOADS),
    Channel("drive_force", _drive_force, LOADS),
]
