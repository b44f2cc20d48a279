"""What every model reports of a flight, and the trajectory made of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from morphcore.errors import FlightDiverged
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.simulate.trajectory import Trajectory
from morphcore.simulate.trim import Trim
from morphdata.drives import SIDES

Array = NDArray[np.float64]

LARGEST_SPEED_RATIO = 10.0  # of the airspeed at the start: no glide gets there


@dataclass(frozen=True)
class FlightRecord:
    """A flown flight at its output times (k times, s surfaces).

    euler : (k, 3) rad; omega_B : (k, 3) rad/s; velocity_N, position_N : (k, 3) m/s and m of the reference
    point; angles : (k, h) of all hinges, rad; tips_z : (k, s) tips below their roots along z of B, m.
    trim : the start.
    """

    euler: Array
    omega_B: Array
    velocity_N: Array
    position_N: Array
    angles: Array
    tips_z: Array
    trim: Trim


def require_sound(
    history: Array, velocity: Array, flight: Flight, times: Array, within: NDArray[np.bool_] | None = None
) -> None:
    """Check a flight (k times): all of its history (k, rows) finite, no speed absurd, all times ``within``.

    velocity : (k, 3) m/s. within : (k,) what the model itself can tell of its domain.

    Raises
    ------
    FlightDiverged : with the last sound time.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        speed = np.sqrt(np.sum(velocity**2, axis=1))
        sound = np.all(np.isfinite(history), axis=1) & (speed < LARGEST_SPEED_RATIO * flight.airspeed_m_s)
        if within is not None:
            sound &= within
    if not np.all(sound):
        raise FlightDiverged(time_s=float(times[max(int(np.argmin(sound)) - 1, 0)]))


def recorded_trajectory(aircraft: Aircraft, times: Array, record: FlightRecord) -> Trajectory:
    """The trajectory: the angles of all drives, and the tips of each side's first hinged surface."""
    columns = np.concatenate([record.omega_B, record.velocity_N, record.position_N], axis=1)
    names = ("p", "q", "r", "vx", "vy", "vz", "x", "y", "z")
    extra = {name: column.copy() for name, column in zip(names, columns.T, strict=True)}
    drives: dict[str, Array] = {}
    for column, hinge in enumerate(aircraft.hinges):  # all hinges of a drive turn alike
        drives.setdefault(hinge.drive, record.angles[:, column].copy())
    for side in SIDES:
        for number, surface in enumerate(aircraft.surfaces):
            if surface.side == side and surface.hinges:
                extra[f"tip_{side}_z"] = record.tips_z[:, number].copy()
                break
    phi, theta, psi = record.euler.T.copy()
    trajectory = Trajectory(
        name="simulated",
        time_s=times,
        drives=drives,
        phi=phi,
        theta=theta,
        psi=psi,
        extra=extra,
    )
    for values in (times, phi, theta, psi, *drives.values()):
        values.setflags(write=False)
    return trajectory
