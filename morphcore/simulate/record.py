"""The record of a flight that every model returns, and the trajectory made from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.environment import MovingAir
from morphcore.aero.stall import StallRecord
from morphcore.errors import FlightDiverged
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.simulate.points import Point
from morphcore.simulate.shape import Shape
from morphcore.simulate.surface_loads import SurfaceLoads
from morphcore.simulate.trajectory import Trajectory
from morphcore.simulate.trim import Trim

Array = NDArray[np.float64]

LARGEST_SPEED_RATIO = 10.0  # multiple of the airspeed at the start that no glide reaches


# parts of a record that models omit unless requested: twist of the tips, accelerations, loads of the surfaces
Part = Literal["twist", "loads", "surfaces"]


@dataclass(frozen=True)
class Outputs:
    """What a model records besides the motion.

    parts : of the record. points : at which specific force is reported. shape_rows : (t,) output rows of the
    shape.
    """

    parts: frozenset[Part] = frozenset()
    points: tuple[Point, ...] = ()
    shape_rows: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    @property
    def of_states(self) -> bool:
        """Whether they need more of the states than the motion that every flight records."""
        return "surfaces" in self.parts or self.shape_rows.size > 0


@dataclass(frozen=True)
class Loads:
    """Accelerations and loads at the output times (k times, s surfaces, h hinges).

    twist_rate_B : (k, 6) time derivative of the components in B of omega and of the reference point's
    velocity, rad/s^2 and m/s^2. hinge_torque : (k, h) of the motors along the hinges' positive coordinates,
    N m. surfaces : loads of the surfaces. Both are None unless requested.
    """

    twist_rate_B: Array
    hinge_torque: Array | None = None
    surfaces: SurfaceLoads | None = None


@dataclass(frozen=True)
class FlightRecord:
    """A flown flight at its output times (k times, s surfaces).

    euler : (k, 3) rad; omega_B : (k, 3) rad/s; velocity_N, position_N : (k, 3) m/s and m of the reference
    point; wind_N : (k, 3) m/s of the air there; angles : (k, h + c) of all hinges, then of all controls, rad;
    tips_z : (k, s) tips below their roots along z of B, m. trim : the start. tips_twist : (k, s) twist of the
    tips relative to their roots, nose up, rad, and loads : both None unless requested (`Part`). bending :
    (k, s) displacement of the tips by bending over the span if the lattice does not bend; else None. shape :
    at the requested rows. point_force : by name (k, 3) specific force at the requested points of surfaces, in
    their own axes, m/s^2. points : all that were requested. stall : how near sections came to the limits of
    their lift; None without limits.
    """

    euler: Array
    omega_B: Array
    velocity_N: Array
    position_N: Array
    wind_N: Array
    angles: Array
    tips_z: Array
    trim: Trim
    tips_twist: Array | None = None
    loads: Loads | None = None
    bending: Array | None = None
    shape: Shape | None = None
    point_force: Mapping[str, Array] = field(default_factory=dict)
    points: tuple[Point, ...] = ()
    stall: StallRecord | None = None


def air_at_reference(flight: Flight, air: MovingAir | None, times_s: Array) -> Array:
    """Velocity (k, 3) m/s in N of the air at the reference point: uniform wind, gust and turbulence."""
    wind_N = np.tile(flight.wind_N, (times_s.size, 1))
    return wind_N if air is None else wind_N + air.at_reference(times_s)


def require_sound(
    history: Array, velocity: Array, flight: Flight, times: Array, within: NDArray[np.bool_] | None = None
) -> None:
    """Check a flight (k times): history (k, rows) finite, speeds plausible, all times ``within`` the domain.

    velocity : (k, 3) m/s. within : (k,) whether the model's own conditions hold.

    Raises
    ------
    FlightDiverged : with the last valid time.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        speed = np.sqrt(np.sum(velocity**2, axis=1))
        sound = np.all(np.isfinite(history), axis=1) & (speed < LARGEST_SPEED_RATIO * flight.airspeed_m_s)
        if within is not None:
            sound &= within
    if not np.all(sound):
        raise FlightDiverged(time_s=float(times[max(int(np.argmin(sound)) - 1, 0)]))


def recorded_trajectory(
    aircraft: Aircraft, times: Array, record: FlightRecord, extra: dict[str, Array]
) -> Trajectory:
    """The trajectory with the angles of all drives and some further columns."""
    drives: dict[str, Array] = {}
    units = {part.drive: part.unit for part in aircraft.moved_parts}
    for column, part in enumerate(aircraft.moved_parts):  # all hinges of a drive turn together
        drives.setdefault(part.drive, record.angles[:, column].copy())
    phi, theta, psi = record.euler.T.copy()
    trajectory = Trajectory(
        name="simulated",
        time_s=times,
        drives=drives,
        phi=phi,
        theta=theta,
        psi=psi,
        extra=extra,
        channels=extra,
        units=units,
    )
    for values in (times, phi, theta, psi, *drives.values()):
        values.setflags(write=False)
    return trajectory
