"""Motion of the air: uniform wind, 1-cosine gust, Dryden turbulence. All off by default.

Gust and turbulence are fields frozen in the air, functions of the way along the flight path and of the place
across it. The reference point moves along the path at the flight's airspeed, and every part of the aircraft
meets the field when it gets there: its place is ahead or behind by its distance along the path. A field is
a sum of waves (`Wave`), sampled along the path at a spacing that does not depend on a model's time step, so
that all models of a request meet the same air. Velocities are in N (north, east, down); the flight starts
due north, so u, v, w of the turbulence lie along north, east and down.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from morphcore.aero.gust_lag import KUESSNER, Lag, before_wagner
from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Aircraft, Flight
from morphdata.environment import Environment, Gust, Turbulence

Array = NDArray[np.float64]

FOOT_M = 0.3048
LOW_ALTITUDE_FT = 1000.0  # MIL-F-8785C: below it the low-altitude model,
HIGH_ALTITUDE_FT = 2000.0  # above this one isotropic turbulence, linear in between
LOWEST_ALTITUDE_FT = 10.0  # m; the low-altitude scales shrink to zero at the ground, so the model starts here
HIGH_SCALE_FT = 1750.0  # MIL-F-8785C, section 3.7.2.1: all three scales of the Dryden form
LOW_INTENSITY = 0.1  # MIL-F-8785C, section 3.7.3.4: sigma_w over the mean wind at 20 ft
SLOW, FAST = np.sqrt(3.0), 1.0 - np.sqrt(3.0)  # (1 + sqrt3 s) / (1 + s)^2 = SLOW / (1 + s) + FAST / (1 + s)^2


GUST_SPACINGS = 400  # over a gust: a straight line between its values is right to 3e-5
TINY_GUST_SPACINGS = 8  # over a gust much shorter than a chord
SETTLED = 20.0  # longest lags after which nothing of a gust is left
SPACINGS_PER_LENGTH = 100.0  # of turbulence, per its shortest length
MAX_SPACINGS = 300_000  # of turbulence, along a whole flight
DEFAULT_CHORD_M = 1.0
LONGEST_LAG = max(KUESSNER.longest, before_wagner().longest)  # semichords


@dataclass(frozen=True)
class Wave:
    """A velocity along the path (n, 3), m/s in N, times a factor across it.

    start_m, spacing_m : places of the values, from where the reference point is at time zero. right_m, factor
    : (r,) rows of the factor, linear between, constant beyond; right_m is counted from the reference point.
    """

    start_m: float
    spacing_m: float
    velocity_N: Array
    right_m: Array
    factor: Array

    def at(self, along_m: Array, right_m: Array, velocity_N: Array | None = None) -> Array:
        """Velocities (..., 3) at places (...); ``velocity_N`` (n, 3) instead of its own along the path."""
        own = self.velocity_N if velocity_N is None else velocity_N
        places = self.start_m + self.spacing_m * np.arange(own.shape[0])
        factor = np.interp(right_m, self.right_m, self.factor)
        out = np.zeros((*np.broadcast_shapes(along_m.shape, right_m.shape), 3))
        for axis in np.flatnonzero(own.any(axis=0)):
            out[..., axis] = factor * np.interp(along_m, places, own[:, axis], left=0.0)
        return out


@dataclass(frozen=True)
class MovingAir:
    """Gust and turbulence along one flight, without its uniform wind.

    waves : their sum is the air's velocity. airspeed_m_s : with which the reference point crosses them.
    """

    waves: tuple[Wave, ...]
    airspeed_m_s: float

    def velocity(self, along_m: Array, right_m: Array) -> Array:
        """Velocity (..., 3) m/s in N at places along and across the path (...)."""
        out = np.zeros((*np.broadcast_shapes(along_m.shape, right_m.shape), 3))
        for wave in self.waves:
            out += wave.at(along_m, right_m)
        return out

    def at_reference(self, times_s: Array) -> Array:
        """Velocity (k, 3) m/s in N where the reference point is at times (k,)."""
        along = self.airspeed_m_s * times_s
        return self.velocity(along, np.zeros_like(along))

    def followed(self, lag: Lag, semichord_m: Array, along_m: Array, right_m: Array) -> Array:
        """The velocity (k, m, 3) that a lag makes of the air at places (k, m), for semichords (m,)."""
        out = np.zeros((*along_m.shape, 3))
        for size in np.unique(semichord_m):
            own = semichord_m == size
            for number, wave in enumerate(self.waves):
                lagged = self._lagged(lag, float(size), number)
                out[:, own] += wave.at(along_m[:, own], right_m[:, own], lagged)
        return out

    @cached_property
    def _known(self) -> dict[tuple[Lag, float, int], Array]:
        return {}

    def _lagged(self, lag: Lag, semichord_m: float, number: int) -> Array:
        """A wave's velocity (n, 3) after a lag for one semichord."""
        key = (lag, semichord_m, number)
        if key not in self._known:
            wave = self.waves[number]
            columns = wave.velocity_N.T
            spacing = wave.spacing_m / semichord_m
            still = np.zeros(columns.shape[1])
            out = [lag.of(column, spacing) if column.any() else still for column in columns]
            self._known[key] = np.stack(out, axis=1)
        return self._known[key]


def moving_air(
    environment: Environment,
    flight: Flight,
    times_s: ArrayLike,
    rng: np.random.Generator | None = None,
    aircraft: Aircraft | None = None,
) -> MovingAir:
    """Gust and turbulence of a flight.

    Parameters
    ----------
    times_s : (k,) the flight's, or its first and last, s.
    rng : source of the turbulence; the same state gives the same air, of whatever length.
    aircraft : whose parts meet it; None: a point.

    Raises
    ------
    InvalidInput : turbulence is requested without a generator.
    """
    times, waves = np.asarray(times_s, dtype=np.float64), []
    extent = _Extent() if aircraft is None else _Extent.of(aircraft)
    if environment.gust is not None:
        waves.append(_gust_wave(environment.gust, flight.airspeed_m_s, extent.chords))
    if environment.turbulence is not None:
        if rng is None:
            raise InvalidInput(
                "turbulence needs a random generator",
                pointer="/environment/turbulence",
                hint="pass rng=numpy.random.default_rng(seed)",
            )
        path = flight.airspeed_m_s * np.array([times.min(), times.max()]) + extent.reach * np.array(
            [-1.0, 1.0]
        )
        waves += _turbulence_waves(environment.turbulence, flight, path, rng, extent)
    return MovingAir(tuple(waves), flight.airspeed_m_s)


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
    wind_N = np.asarray(flight.wind_N, dtype=np.float64)
    return np.asarray(wind_N + moving_air(environment, flight, t, rng).at_reference(t))


@dataclass(frozen=True)
class _Extent:
    """How far parts reach from the reference point, shortest and longest chord, and the span; m."""

    reach: float = 0.0
    chords: tuple[float, float] = (DEFAULT_CHORD_M, DEFAULT_CHORD_M)
    span: float = 0.0

    @classmethod
    def of(cls, aircraft: Aircraft) -> _Extent:
        """The extent of an aircraft, whatever its hinges' angles."""
        reach, chords, sides = 0.0, [], []
        for surface in aircraft.surfaces:
            own = surface.chord_at(surface.breaks_m)
            arms = np.linalg.norm(surface.root_arms_B, axis=-1).sum() + surface.length_m + own.max()
            reach = max(reach, float(np.linalg.norm(surface.position_m) + 2.0 * arms))
            chords += [float(own.min()), float(own.max())]
            across = surface.span_sign * surface.span_m * np.cos(surface.dihedral_rad)
            sides += [surface.position_m[1], surface.position_m[1] + float(across)]
        return cls(reach, (min(chords), max(chords)), max(sides) - min(sides))


def _gust_wave(gust: Gust, airspeed: float, chords_m: tuple[float, float]) -> Wave:
    """The gust as a wave: EASA CS-25.341(a)(2), U/2 (1 - cos(pi s / H)) over 0 <= s <= 2 H."""
    length = 2.0 * gust.gradient_m
    count = int(np.clip(np.ceil(200.0 * length / chords_m[0]), TINY_GUST_SPACINGS, GUST_SPACINGS))
    spacing = length / count
    left = int(np.ceil(SETTLED * LONGEST_LAG * 0.5 * chords_m[1] / spacing))
    speed = np.zeros(1 + count + left)
    speed[: count + 1] = 0.5 * gust.amplitude_m_s * (1.0 - np.cos(2.0 * np.pi * np.arange(count + 1) / count))
    direction_N = np.asarray(gust.direction_n, dtype=np.float64)
    velocity_N = speed[:, None] * direction_N / np.sqrt(direction_N @ direction_N)
    rows = gust.spanwise or []
    right = np.array([row.y_m for row in rows] or [0.0])
    factor = np.array([row.factor for row in rows] or [1.0])
    return Wave(airspeed * gust.start_s, spacing, velocity_N, right, factor)


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


def rolling_gust(sigma_w: float, length_w_m: float, span_m: float) -> tuple[float, float]:
    """Standard deviation (rad/s) and length (m) of the rolling motion p_g of the air across a span.

    MIL-F-8785C, section 3.7.5: a spectrum sigma_w^2 / L_w 0.8 (pi L_w / 4 b)^(1/3) / (1 + (4 b Omega / pi)^2)
    over the spatial frequency Omega, as of first-order noise of the length 4 b / pi.
    """
    at_zero = sigma_w**2 / length_w_m * 0.8 * (np.pi * length_w_m / (4.0 * span_m)) ** (1.0 / 3.0)
    length = 4.0 * span_m / np.pi
    return float(np.sqrt(0.5 * np.pi * at_zero / length)), length


def _turbulence_waves(
    turbulence: Turbulence,
    flight: Flight,
    path_m: Array,
    rng: np.random.Generator,
    extent: _Extent,
) -> list[Wave]:
    """Turbulence along a path from path_m[0] to path_m[1]: u, v, w of the middle, and p_g across the span.

    u: sqrt(2 L / (pi V)) / (1 + s); v, w: sqrt(L / (pi V)) (1 + sqrt3 s) / (1 + s)^2, with s the frequency
    times L / V (MIL-F-8785C, section 3.7.1.2); p_g: `rolling_gust`. The filters start in their stationary
    state and are stepped by their exact discretisation. The aircraft's motion along the path makes the fields
    q_g and r_g of the specification by itself.
    """
    sigma, length = turbulence_scales(turbulence, flight.altitude_m)
    total = float(path_m[1] - path_m[0])
    spacing = max(
        min(0.5 * extent.chords[0], float(length.min()) / SPACINGS_PER_LENGTH), total / MAX_SPACINGS
    )
    count = int(np.ceil(total / spacing)) + 2
    noise = rng.standard_normal((count, 7))  # row by row: a longer path begins like a shorter one
    velocity_N = np.stack([_dryden(noise[:, 2 * k : 2 * k + 2], spacing / length[k], k) for k in range(3)])
    begin, middle = float(path_m[0]), np.zeros(1)
    waves = [
        Wave(begin, spacing, np.ascontiguousarray((sigma[:, None] * velocity_N).T), middle, middle + 1.0)
    ]
    if extent.span > 0.0 and sigma[2] > 0.0:
        rate, scale = rolling_gust(float(sigma[2]), float(length[2]), extent.span)
        decay = float(np.exp(-spacing / scale))
        kicks = np.sqrt(1.0 - decay**2) * noise[:, 6]
        kicks[0] = noise[0, 6]
        down = np.zeros((count, 3))
        down[:, 2] = rate * _summed(kicks, decay)  # m/s per m to the right
        tips = np.array([-1e3, 1e3])
        waves.append(Wave(begin, spacing, down, tips, tips))
    return waves


def _dryden(noise: Array, step: float, axis: int) -> Array:
    """Velocity (k,) of unit variance along (axis 0) or across the path, from unit noise (k, 2).

    step : between the values, over the length of the turbulence.
    """
    kicks = noise @ _factor(_covariance(np.array(step))).T
    kicks[0] = np.linalg.cholesky(_covariance(np.array(np.inf))) @ noise[0]
    decay = float(np.exp(-step))
    first = _summed(kicks[:, 0], decay)  # of 1 / (1 + s)
    kicks[1:, 1] += decay * step * first[:-1]
    second = _summed(kicks[:, 1], decay)  # of 1 / (1 + s)^2
    return np.asarray(np.sqrt(2.0) * first if axis == 0 else SLOW * first + FAST * second)


def _summed(kicks: Array, decay: float) -> Array:
    """Values x[k] = decay x[k - 1] + kicks[k], (k,)."""
    from scipy.signal import lfilter  # late: few flights meet turbulence

    return np.asarray(lfilter([1.0], [1.0, -decay], kicks))


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
