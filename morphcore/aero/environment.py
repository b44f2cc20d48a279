"""Motion of the air over time: uniform wind, 1-cosine gust, Dryden turbulence. All off by default.

Gust and turbulence are fields frozen in the air that the fuselage reference point crosses at the flight's
airspeed; the whole aircraft feels the reference point's value. Velocities are in N (north, east, down); the
flight starts due north, so u, v, w of the turbulence lie along north, east and down.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Flight
from morphdata.environment import Environment, Gust, Turbulence

Array = NDArray[np.float64]

FOOT_M = 0.3048
LOW_ALTITUDE_FT = 1000.0  # MIL-F-8785C: below it the low-altitude model,
HIGH_ALTITUDE_FT = 2000.0  # above this one isotropic turbulence, linear in between
LOWEST_ALTITUDE_FT = 10.0  # m; the low-altitude scales shrink to zero at the ground, so the model starts here
HIGH_SCALE_FT = 1750.0  # MIL-F-8785C, section 3.7.2.1: all three scales of the Dryden form
LOW_INTENSITY = 0.1  # MIL-F-8785C, section 3.7.3.4: sigma_w over the mean wind at 20 ft
SLOW, FAST = np.sqrt(3.0), 1.0 - np.sqrt(3.0)  # (1 + sqrt3 s) / (1 + s)^2 = SLOW / (1 + s) + FAST / (1 + s)^2


def air_velocity(
    environment: Environment, flight: Flight, times: ArrayLike, rng: np.random.Generator | None = None
) -> Array:
    """Velocity of the air at the reference point over time.

    Parameters
    ----------
    times : (k,) increasing, s.
    rng : source of the turbulence; the same state gives the same air.

    Returns
    -------
    velocity_N : (k, 3) m/s, the flight's wind included.

    Raises
    ------
    InvalidInput : the times do not increase, or turbulence is requested without a generator.
    """
    t = np.asarray(times, dtype=np.float64)
    if t.ndim != 1 or not np.all(np.isfinite(t)) or np.any(np.diff(t) <= 0.0):
        raise InvalidInput("times are not strictly increasing", hint="sort them and remove duplicates")
    velocity_N = np.tile(np.asarray(flight.wind_N, dtype=np.float64), (t.size, 1))
    if environment.gust is not None:
        velocity_N += gust_velocity(environment.gust, flight.airspeed_m_s, t)
    if environment.turbulence is not None and t.size:
        if rng is None:
            raise InvalidInput(
                "turbulence needs a random generator",
                pointer="/environment/turbulence",
                hint="pass rng=numpy.random.default_rng(seed)",
            )
        velocity_N += turbulence_velocity(environment.turbulence, flight, t, rng)
    return velocity_N


def gust_velocity(gust: Gust, airspeed: float, times: Array) -> Array:
    """Gust velocity in N, (k, 3) m/s, at times (k,) s for an airspeed in m/s.

    EASA CS-25.341(a)(2): U/2 (1 - cos(pi s / H)) over 0 <= s <= 2 H.
    """
    distance = np.clip(airspeed * (times - gust.start_s), 0.0, 2.0 * gust.gradient_m)
    speed = 0.5 * gust.amplitude_m_s * (1.0 - np.cos(np.pi * distance / gust.gradient_m))
    direction_N = np.asarray(gust.direction_n, dtype=np.float64)
    return np.asarray(speed[:, None] * direction_N / np.sqrt(direction_N @ direction_N))


def turbulence_scales(turbulence: Turbulence, altitude_m: float) -> tuple[Array, Array]:
    """Standard deviations (m/s) and lengths (m) of u, v, w, (3,) each, at an altitude above ground.

    MIL-F-8785C, section 3.7.2 (high) and 3.7.3.4 (low altitude).
    """
    altitude = max(altitude_m / FOOT_M, LOWEST_ALTITUDE_FT)
    low = min(altitude, LOW_ALTITUDE_FT)
    base = 0.177 + 0.000823 * low
    sigma_w = LOW_INTENSITY * turbulence.wind_20ft_m_s
    sigma_low = sigma_w * np.array([base**-0.4, base**-0.4, 1.0])
    length_low = FOOT_M * low * np.array([base**-1.2, base**-1.2, 1.0])
    share = np.clip((altitude - LOW_ALTITUDE_FT) / (HIGH_ALTITUDE_FT - LOW_ALTITUDE_FT), 0.0, 1.0)
    sigma = (1.0 - share) * sigma_low + share * turbulence.sigma_high_m_s
    length = (1.0 - share) * length_low + share * FOOT_M * HIGH_SCALE_FT
    return sigma, length


def turbulence_velocity(
    turbulence: Turbulence, flight: Flight, times: Array, rng: np.random.Generator
) -> Array:
    """Turbulence in N, (k, 3) m/s, at times (k,) s: forming filters driven by white noise.

    u: sqrt(2 L / (pi V)) / (1 + s); v, w: sqrt(L / (pi V)) (1 + sqrt3 s) / (1 + s)^2, with s the frequency
    times L / V (MIL-F-8785C, section 3.7.1.2). The filters start in their stationary state and are stepped by
    their exact discretisation, so that the spectrum is right for steps of any length, even or not.
    """
    sigma, length = turbulence_scales(turbulence, flight.altitude_m)
    steps = np.diff(times)[:, None] * flight.airspeed_m_s / length  # in time constants
    noise = rng.standard_normal((times.size, 3, 2))
    decay = np.exp(-steps)
    state = np.empty((times.size, 3, 2))  # of 1 / (1 + s) and of 1 / (1 + s)^2
    state[0] = np.einsum("ij,aj->ai", np.linalg.cholesky(_covariance(np.array(np.inf))), noise[0])
    kicks = np.einsum("kaij,kaj->kai", _factor(_covariance(steps)), noise[1:])
    for k, (factor, step, kick) in enumerate(zip(decay, steps, kicks, strict=True)):
        first, second = state[k].T
        state[k + 1] = np.stack([factor * first, factor * (second + step * first)], axis=-1) + kick
    velocity = SLOW * state[..., 0] + FAST * state[..., 1]
    velocity[:, 0] = np.sqrt(2.0) * state[:, 0, 0]
    return np.asarray(sigma * velocity)


def _covariance(step: Array) -> Array:
    """Covariance (..., 2, 2) of the two filter states after a step, in time constants, of unit white noise.

    The integral of [[1, s], [s, s^2]] exp(-2 s) ds from 0 to the step.
    """
    decay = np.exp(-2.0 * step)
    finite = np.where(np.isinf(step), 0.0, step)
    c11 = 0.5 * -np.expm1(-2.0 * step)
    c12 = 0.25 * (1.0 - decay * (1.0 + 2.0 * finite))
    c22 = 0.25 * (1.0 - decay * (1.0 + 2.0 * finite + 2.0 * finite**2))
    return np.stack([np.stack([c11, c12], axis=-1), np.stack([c12, c22], axis=-1)], axis=-2)


def _factor(covariance: Array) -> Array:
    """Lower Cholesky factors (..., 2, 2); robust for tiny steps, where rounding can spoil the last pivot."""
    l11 = np.sqrt(covariance[..., 0, 0])
    l21 = covariance[..., 0, 1] / l11
    l22 = np.sqrt(np.maximum(covariance[..., 1, 1] - l21**2, 0.0))
    zero = np.zeros_like(l11)
    return np.stack([np.stack([l11, zero], axis=-1), np.stack([l21, l22], axis=-1)], axis=-2)
