"""The list of a flight's output channels: what a trajectory can hold besides attitude and hinge angles.

Record, CSV file, result document, command and page are driven by this list and by ``morphdata/channels.py``,
which holds each channel's unit and description. To add a channel, add one entry to both; if it needs numbers
that the record lacks, the models record them as a `Part`.

Conventions
-----------
B : body axes, forward, right, down, with the origin at the reference point. N : north, east, down.

- ``alpha`` = atan2(w, u) and ``beta`` = asin(v / V), of the velocity (u, v, w) in B of the reference point
  relative to the air: wind, gust and turbulence are subtracted.
- ``fx fy fz`` : specific force f = a - g in B at the reference point and at given points, as measured by an
  accelerometer there; at a point on a surface in the surface's own axes there.
- ``nx ny nz`` : load factors (fx, fy, -fz) / g, positive forward, to the right and **up**. In steady level
  flight nz = cos(alpha), +1 to first order, and nx = sin(alpha). g is the flight's own gravity.
- ``tip_z`` : tip of a surface's elastic axis below its root along z of B, hence negative for a wing that its
  lift bends up. ``tip_left_z``, ``tip_right_z`` : of the first hinged surface of a side.
- ``tip_twist`` : the torsion of the rotation Rx(flap) Ry(torsion) Rz(edgewise) from the axes of a tip to
  those of its root, nose up.
- ``hinge_torque`` : the total torque of a drive's motors, along its positive coordinate; of a drive that
  slides it is ``drive_force``. At a corner of a schedule's rate the hinge's acceleration, and with it torque
  and load factor, is that of the morph.
- ``root_shear``, ``root_bending``, ``root_torsion`` : what the loads outboard of the root of a surface's
  elastic axis, outside its hinges, add up to: air, apparent mass, weight and inertia. In the axes of the
  root; positive upward (-z), bending the tip up, and nose up, on both sides.
- ``surface_lift``, ``surface_drag``, ``surface_side_force`` : force of the air on a surface, apparent mass
  included, in the wind axes of the reference point (Stevens, Lewis & Johnson 2016, section 2.3): across
  the flight path in the plane of symmetry, upward; against it; and to the right.
- ``section_lift``, ``section_cl`` : from the circulation of a strip, normal to its own motion, per length
  across its chord.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from morphcore.frames import quaternion_from_euler, rotation_from_quaternion
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.simulate.points import specific_force
from morphcore.simulate.record import FlightRecord, Part
from morphcore.simulate.surface_loads import SurfaceLoads
from morphdata.channels import channel_facts, column_parts, default_channels

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
    needs : frozenset of {"twist", "loads", "surfaces"}
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


def requested_channels(names: Sequence[str] | None) -> tuple[Channel, ...]:
    """Find the requested channels of a flight; None: the default channels."""
    known = {channel.name: channel for channel in CHANNELS}
    return tuple(known[name] for name in (default_channels() if names is None else names))


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
    acceleration_B = record.loads.twist_rate_B[:, 3:] + np.cross(record.omega_B, velocity_B)
    return np.asarray(acceleration_B - flight.gravity_m_s2 * R_NB[:, 2])


def _at_points(record: FlightRecord, flight: Flight) -> dict[str, Array]:
    """Specific force (k, 3) at the reference point, named "", and at all given points by their names."""
    assert record.loads is not None  # noqa: S101 - `needs` says so
    found = {"": _specific_force_B(record, flight)}
    still = np.zeros_like(record.omega_B)
    for point in record.points:
        if point.surface is not None:
            found[point.name] = record.point_force[point.name]
            continue
        # what rotation adds to the reference point
        twist = np.concatenate([record.omega_B, still], axis=1)
        rate = np.concatenate([record.loads.twist_rate_B[:, :3], still], axis=1)
        found[point.name] = found[""] + specific_force(np.array(point.position_B), twist, rate)
    return found


def _force(number: int) -> Evaluate:
    return lambda record, _aircraft, flight: {
        name: force[:, number] for name, force in _at_points(record, flight).items()
    }


def _load_factor(number: int, sign: float) -> Evaluate:
    return lambda record, _aircraft, flight: {
        name: sign * force[:, number] / flight.gravity_m_s2
        for name, force in _at_points(record, flight).items()
    }


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
    assert record.loads.hinge_torque is not None  # noqa: S101
    torques: dict[str, Array] = {}
    for column, hinge in zip(record.loads.hinge_torque.T, aircraft.hinges, strict=True):
        if hinge.prismatic == sliding:
            torques[hinge.drive] = torques[hinge.drive] + column if hinge.drive in torques else column
    return torques


def _hinge_torque(record: FlightRecord, aircraft: Aircraft, _flight: Flight) -> Mapping[str, Array]:
    return _of_motors(record, aircraft, sliding=False)


def _drive_force(record: FlightRecord, aircraft: Aircraft, _flight: Flight) -> Mapping[str, Array]:
    return _of_motors(record, aircraft, sliding=True)


def _surfaces(record: FlightRecord) -> SurfaceLoads:
    assert record.loads is not None  # noqa: S101 - `needs` says so
    assert record.loads.surfaces is not None  # noqa: S101
    return record.loads.surfaces


def _at_root(number: int, sign: float, *, by_side: bool = False) -> Evaluate:
    """A component of what the hinges exert on each surface's root, which balances the loads."""

    def evaluate(record: FlightRecord, aircraft: Aircraft, _flight: Flight) -> Mapping[str, Array]:
        values = sign * _surfaces(record).root_W[:, :, number]
        if by_side:
            values = values * np.array([surface.span_sign for surface in aircraft.surfaces])
        return _per_surface(aircraft, values)

    return evaluate


def _wind_axes(record: FlightRecord) -> tuple[Array, Array, Array]:
    """Unit vectors (k, 3) in B: along the motion through the air, to the right, and down across it.

    Those of the body at rest.
    """
    through_B = _through_air_B(record)
    alpha = np.arctan2(through_B[:, 2], through_B[:, 0])
    down = np.stack([-np.sin(alpha), np.zeros_like(alpha), np.cos(alpha)], axis=1)
    speed = np.linalg.norm(through_B, axis=1, keepdims=True)
    ahead = np.divide(through_B, speed, out=np.tile([1.0, 0.0, 0.0], (alpha.size, 1)), where=speed > 0.0)
    return ahead, np.cross(down, ahead), down


def _of_air(axis: int, sign: float) -> Evaluate:
    """A component in wind axes of the air's force on each surface."""
    return lambda record, aircraft, _flight: _per_surface(
        aircraft, sign * np.einsum("ksi,ki->ks", _surfaces(record).air_B, _wind_axes(record)[axis])
    )


def _per_strip(name: str) -> Evaluate:
    def evaluate(record: FlightRecord, aircraft: Aircraft, _flight: Flight) -> Mapping[str, Array]:
        parts = column_parts(surface.name for surface in aircraft.surfaces)
        strips: tuple[Array, ...] = getattr(_surfaces(record), name)
        return {
            f"{part}_{number}": column
            for part, values in zip(parts, strips, strict=True)
            for number, column in enumerate(values.T, start=1)
        }

    return evaluate


TWIST: frozenset[Part] = frozenset({"twist"})
LOADS: frozenset[Part] = frozenset({"loads"})
SURFACES: frozenset[Part] = frozenset({"surfaces"})

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
    Channel("hinge_torque", _hinge_torque, SURFACES),
    Channel("drive_force", _drive_force, SURFACES),
    Channel("root_shear", _at_root(5, 1.0), SURFACES),
    Channel("root_bending", _at_root(0, 1.0, by_side=True), SURFACES),
    Channel("root_torsion", _at_root(1, -1.0), SURFACES),
    Channel("surface_lift", _of_air(2, -1.0), SURFACES),
    Channel("surface_drag", _of_air(0, -1.0), SURFACES),
    Channel("surface_side_force", _of_air(1, 1.0), SURFACES),
    Channel("section_lift", _per_strip("section_lift"), SURFACES),
    Channel("section_cl", _per_strip("section_cl"), SURFACES),
]
