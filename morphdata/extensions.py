"""Schedules of drives that slide: like those of angles, in metres."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, ClassVar, Literal

from pydantic import FailFast, Field

from morphdata.drives import Extension, Unit
from morphdata.faults import Fault
from morphdata.history import (
    DEFAULT_RAMP_S,
    MAX_KNOTS,
    ClockTime,
    Duration,
    ExtensionHistory,
    Moment,
    Rate,
    history_faults,
    rate_faults,
)
from morphdata.samplefiles.flight import MAX_ROWS


class HeldExtension(ExtensionHistory):
    """A prismatic hinge that does not move."""

    values: ClassVar[tuple[str, ...]] = ("extension_m",)
    kind: Literal["hold"]
    extension_m: Extension


class ConstantRateExtension(ExtensionHistory):
    """From one extension to another at constant rate, with ramps of the rate inside the duration."""

    values: ClassVar[tuple[str, ...]] = ("initial_m", "final_m")
    kind: Literal["constant_rate"]
    initial_m: Extension = 0.0
    final_m: Extension
    duration_s: Duration | None = None
    rate_m_s: Rate | None = Field(
        default=None, description="Instead of `duration_s`: mean rate, without its sign."
    )
    start_s: Moment = 0.0
    ramp_s: Moment = Field(
        default=DEFAULT_RAMP_S, description="The rate rises and falls linearly in this time."
    )

    @property
    def morph_s(self) -> float:
        """Duration of the morph, as given or from the mean rate."""
        if self.duration_s is not None:
            return self.duration_s
        return abs(self.final_m - self.initial_m) / (self.rate_m_s or 1.0)

    def faults(self) -> Iterator[Fault]:
        """Check that duration or rate is given, and that the ramps fit into the morph."""
        yield from rate_faults(self.duration_s, self.rate_m_s, self.morph_s, self.ramp_s, self.unit)


class QuadraticExtension(ExtensionHistory):
    """Extension quadratic in time, then held."""

    values: ClassVar[tuple[str, ...]] = ("initial_m", "final_m")
    kind: Literal["quadratic"]
    initial_m: Extension = 0.0
    final_m: Extension
    duration_s: Duration
    start_s: Moment = 0.0


class SplineExtension(ExtensionHistory):
    """Clamped cubic spline through knots: at rest before the first and after the last."""

    values: ClassVar[tuple[str, ...]] = ("knot_extension_m",)
    kind: Literal["spline"]
    knot_time_s: Annotated[list[ClockTime], FailFast(), Field(min_length=2, max_length=MAX_KNOTS)]
    knot_extension_m: Annotated[list[Extension], FailFast(), Field(min_length=2, max_length=MAX_KNOTS)]

    def faults(self) -> Iterator[Fault]:
        """Check that there is an extension for every time, and that time increases."""
        yield from history_faults(self, "knot_time_s", "knot_extension_m", "extension")


class TabulatedExtension(ExtensionHistory):
    """A history in rows, interpolated differentiably; held before the first row and after the last."""

    values: ClassVar[tuple[str, ...]] = ("extension_m",)
    kind: Literal["tabulated"]
    time_s: Annotated[list[ClockTime], FailFast(), Field(min_length=3, max_length=MAX_ROWS)]
    extension_m: Annotated[list[Extension], FailFast(), Field(min_length=3, max_length=MAX_ROWS)]

    def faults(self) -> Iterator[Fault]:
        """Check that there is an extension for every time, and that time increases."""
        yield from history_faults(self, "time_s", "extension_m", "extension")


ExtensionSchedule = (
    HeldExtension | ConstantRateExtension | QuadraticExtension | SplineExtension | TabulatedExtension
)
EXTENSION_FIELDS = ("extension_m", "initial_m", "final_m", "rate_m_s", "knot_extension_m")
# limits of drives that turn, and those of drives that slide
SLIDING_LIMITS = {
    "max_rate_rad_s": "max_rate_m_s",
    "max_accel_rad_s2": "max_accel_m_s2",
    "max_hinge_torque_nm": "max_drive_force_n",
}


def limits_of(unit: Unit) -> str:
    """Return the names of the limits of rate and acceleration of drives of a unit, for messages."""
    rate, acceleration = list(SLIDING_LIMITS if unit == "rad" else SLIDING_LIMITS.values())[:2]
    return f"{rate} or {acceleration}"


def knot_values(schedule: Mapping[str, Any]) -> list[float]:
    """Return the angles, rad, or extensions, m, at the knots of a found schedule."""
    slid = schedule.get("knot_extension_m")
    return list(schedule["knot_sweep_rad"] if slid is None else slid)
