"""The kinematics of steady flight: attitude, rates and motion through the air of climbs, turns and sideslips.

In steady flight nothing changes in body axes but position and heading, so the rates are those of a turn about
the vertical. Attitude: Stevens, Lewis & Johnson (2016), section 3.6, their equations for the rate of climb
and for the turn.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from morphcore.frames import wrap_angle
from morphcore.geometry.aircraft import Flight

Array = NDArray[np.float64]


def air_velocity_B(flight: Flight, alpha: Array) -> Array:
    """Velocity through the air in B, (..., 3) m/s, at angles of attack (...), rad."""
    angle = np.asarray(alpha, dtype=np.float64)
    ahead, aside = math.cos(flight.sideslip_rad), math.sin(flight.sideslip_rad)
    return flight.airspeed_m_s * np.stack(
        [ahead * np.cos(angle), np.full_like(angle, aside), ahead * np.sin(angle)], axis=-1
    )


def pitch(flight: Flight, alpha: Array, bank: Array) -> Array:
    """Pitch angle theta (...), rad, with which the path climbs as it should; bank : the roll angle phi.

    The path climbs by the sine a sin(theta) - b cos(theta), a and b being the components of the stream's unit
    vector along x of B and downward across it.
    """
    if not (flight.banks or np.any(bank)):
        return np.asarray(alpha + flight.climb_rad)
    x, y, z = np.moveaxis(air_velocity_B(flight, alpha) / flight.airspeed_m_s, -1, 0)
    down = y * np.sin(bank) + z * np.cos(bank)
    climb = math.sin(flight.climb_rad) / np.hypot(x, down)
    return np.asarray(np.arctan2(down, x) + np.arcsin(np.clip(climb, -1.0, 1.0)))


def rates_B(flight: Flight, theta: Array, bank: Array) -> Array:
    """Rates p, q, r in B, (..., 3) rad/s: those of the turn about the vertical, or the flight's own."""
    if not flight.rotates:
        return np.zeros((*np.shape(theta), 3))
    down = np.stack([-np.sin(theta), np.cos(theta) * np.sin(bank), np.cos(theta) * np.cos(bank)], axis=-1)
    return np.asarray(flight.turn_rate_rad_s * down + np.array(flight.rates_B))


def first_bank(flight: Flight) -> float:
    """Bank angle of the coordinated turn, rad, from which a trim begins."""
    if not flight.gravity_m_s2:
        return 0.0
    return math.atan(flight.airspeed_m_s * flight.turn_rate_rad_s / flight.gravity_m_s2)


def departure(euler: Array, time_s: Array, turn_rate_rad_s: float) -> Array:
    """Wrapped departure (..., k, 3) of Euler angles from those that a steady flight keeps from its start."""
    away = euler - euler[..., :1, :]
    if turn_rate_rad_s:
        away[..., 2] -= turn_rate_rad_s * (time_s - time_s[0])
    return np.asarray(wrap_angle(away))


def described(flight: Flight) -> str:
    """What steady flight this is: "level flight", "a climb of 0.1 rad with a turn of 0.2 rad/s"."""
    parts = [
        ("a climb of {:.3g} rad" if flight.climb_rad > 0.0 else "a descent of {:.3g} rad", flight.climb_rad),
        ("a turn of {:.3g} rad/s", flight.turn_rate_rad_s),
        ("a sideslip of {:.3g} rad", flight.sideslip_rad),
    ]
    told = [text.format(abs(value) if "descent" in text else value) for text, value in parts if value]
    if any(flight.rates_B):
        told.append("rates of " + ", ".join(f"{rate:.3g}" for rate in flight.rates_B) + " rad/s")
    return " with ".join(told) or "level flight"
