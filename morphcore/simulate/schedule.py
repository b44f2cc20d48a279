"""Schedules of one hinge: angle (or extension), rate and acceleration over time, rad (or m) and s."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from morphcore.errors import InvalidInput
from morphdata import schedules as documents
from morphdata.history import DEFAULT_RAMP_S

if TYPE_CHECKING:  # imported late: not every flight interpolates
    from scipy.interpolate import Akima1DInterpolator, CubicSpline

Array = NDArray[np.float64]


@dataclass(frozen=True)
class HingeMotion:
    """Motion of one hinge at some times, each (k,): angle (rad), rate (rad/s), acceleration (rad/s^2)."""

    angle: Array
    rate: Array
    acceleration: Array


class Schedule(Protocol):
    """Prescribed motion of one hinge."""

    def motion(self, time_s: ArrayLike) -> HingeMotion:
        """The motion at the given times, s."""
        ...


@dataclass(frozen=True)
class Hold:
    """A hinge that does not move."""

    angle_rad: float = 0.0

    def motion(self, time_s: ArrayLike) -> HingeMotion:
        """Constant angle."""
        zero = np.zeros_like(np.asarray(time_s, dtype=np.float64))
        return HingeMotion(zero + self.angle_rad, zero, zero)


@dataclass(frozen=True)
class ConstantRate:
    """From one angle to another at constant rate, with the rate ramped linearly up and down.

    The morph starts at ``start_s``; ramps of ``ramp_s`` at both ends lie inside its ``duration_s``.
    """

    initial_rad: float
    final_rad: float
    duration_s: float
    start_s: float = 0.0
    ramp_s: float = DEFAULT_RAMP_S

    def __post_init__(self) -> None:
        if self.duration_s <= 0:
            raise InvalidInput(
                "duration_s is not positive", pointer="/schedule/duration_s", hint="give a time in s"
            )
        if not 0 <= self.ramp_s <= self.duration_s / 2:
            raise InvalidInput(
                "ramp_s is not in 0..duration_s / 2", pointer="/schedule/ramp_s", hint="shorten the ramps"
            )

    def motion(self, time_s: ArrayLike) -> HingeMotion:
        """Trapezoidal rate."""
        t = np.asarray(time_s, dtype=np.float64) - self.start_s
        rate = (self.final_rad - self.initial_rad) / (self.duration_s - self.ramp_s)
        steepness = rate / self.ramp_s if self.ramp_s > 0 else 0.0

        def ramped(begin: float) -> tuple[Array, Array, Array]:
            """A rate that rises from 0 to ``rate`` over one ramp and stays constant."""
            s = np.maximum(t - begin, 0.0)
            rising = s < self.ramp_s
            angle = np.where(rising, 0.5 * steepness * s**2, rate * (s - self.ramp_s / 2))
            return (
                angle,
                np.where(rising, steepness * s, np.where(s > 0, rate, 0.0)),
                np.where(rising & (s > 0), steepness, 0.0),
            )

        up, down = ramped(0.0), ramped(self.duration_s - self.ramp_s)
        return HingeMotion(self.initial_rad + up[0] - down[0], up[1] - down[1], up[2] - down[2])


@dataclass(frozen=True)
class Quadratic:
    """Angle quadratic in time: initial + (final - initial) (t / duration)^2, then held."""

    initial_rad: float
    final_rad: float
    duration_s: float
    start_s: float = 0.0

    def motion(self, time_s: ArrayLike) -> HingeMotion:
        """The motion; the rate drops to zero abruptly at the end."""
        t = np.asarray(time_s, dtype=np.float64) - self.start_s
        inside = (t >= 0) & (t < self.duration_s)
        s = np.clip(t / self.duration_s, 0.0, 1.0)
        change = self.final_rad - self.initial_rad
        return HingeMotion(
            self.initial_rad + change * s**2,
            np.where(inside, 2 * change * s / self.duration_s, 0.0),
            np.where(inside, 2 * change / self.duration_s**2, 0.0),
        )


@dataclass(frozen=True)
class Spline:
    """Clamped cubic spline through knots: at rest before the first and after the last."""

    knot_time_s: Array
    knot_angle_rad: Array

    def motion(self, time_s: ArrayLike) -> HingeMotion:
        """The motion."""
        from scipy.interpolate import CubicSpline

        spline = CubicSpline(self.knot_time_s, self.knot_angle_rad, bc_type="clamped")
        return _held(spline, time_s, float(self.knot_time_s[0]), float(self.knot_time_s[-1]))


@dataclass(frozen=True)
class Tabulated:
    """A measured history, interpolated differentiably and without overshoot next to flat parts.

    Akima (1970), with the weights of makima: exact where the rate is constant, and local, so that
    the corner of a ramp does not ring through the history as it would in a cubic spline. (Where the rate
    changes, the rate is right to about 2 per cent on the 10 ms rows of the examples, which moves the attitude
    by 2e-6 rad; see tests/simulate/test_schedule.py.)
    """

    time_s: Array
    angle_rad: Array

    @cached_property
    def _curve(self) -> Akima1DInterpolator:
        from scipy.interpolate import Akima1DInterpolator

        return Akima1DInterpolator(self.time_s, self.angle_rad, method="makima")

    def motion(self, time_s: ArrayLike) -> HingeMotion:
        """The motion; held at both ends."""
        if self.time_s.size < 3 or np.ptp(self.angle_rad) == 0.0:
            return Hold(float(self.angle_rad[0])).motion(time_s)
        return _held(self._curve, time_s, float(self.time_s[0]), float(self.time_s[-1]))


def scheduled(document: documents.AnySchedule) -> Schedule:
    """Return the schedule that a document describes."""
    values = [value for value, _ in document.named]
    if document.kind == "hold":
        return Hold(*values)
    if document.kind == "constant_rate":
        return ConstantRate(values[0], values[1], document.morph_s, document.start_s, document.ramp_s)
    if document.kind == "quadratic":
        return Quadratic(values[0], values[1], document.duration_s, document.start_s)
    if document.kind == "spline":
        return Spline(np.array(document.knot_time_s), np.array(values))
    return Tabulated(np.array(document.time_s), np.array(values))


def _held(
    curve: CubicSpline | Akima1DInterpolator, time_s: ArrayLike, begin: float, end: float
) -> HingeMotion:
    t = np.asarray(time_s, dtype=np.float64)
    inside = (t >= begin) & (t <= end)
    s = np.clip(t, begin, end)
    return HingeMotion(
        np.asarray(curve(s)),
        np.where(inside, curve(s, nu=1), 0.0),
        np.where(inside, curve(s, nu=2), 0.0),
    )
