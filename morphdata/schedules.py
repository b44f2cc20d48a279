"""Sweep schedules: what each hinge does over time."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import ConfigDict, FailFast, Field

from morphdata.base import MAX_ROWS, Angle, Document
from morphdata.samplefiles.flight import LONGEST_FLIGHT_S

MAX_DURATION_S = LONGEST_FLIGHT_S
MAX_KNOTS = 1000

EXAMPLE_SCHEDULE: dict[str, Any] = {
    "kind": "constant_rate",
    "initial_rad": 0.0,
    "final_rad": 1.0,
    "duration_s": 2.0,
    "start_s": 0.2,
}

Moment = Annotated[float, Field(ge=0.0, le=MAX_DURATION_S)]
Duration = Annotated[float, Field(gt=0.0, le=MAX_DURATION_S)]
ClockTime = Annotated[float, Field(ge=-MAX_DURATION_S, le=1e6)]
Rate = Annotated[float, Field(gt=0.0, le=100.0)]


class Hold(Document):
    """A hinge that does not move."""

    kind: Literal["hold"]
    angle_rad: Angle = 0.0


class ConstantRate(Document):
    """From one angle to another at constant rate, with ramps of the rate inside the duration."""

    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE_SCHEDULE]})

    kind: Literal["constant_rate"]
    initial_rad: Angle = 0.0
    final_rad: Angle
    duration_s: Duration | None = None
    rate_rad_s: Rate | None = Field(
        default=None, description="Instead of `duration_s`: mean rate, without its sign."
    )
    start_s: Moment = 0.0
    ramp_s: Annotated[float, Field(ge=0.0, le=60.0)] = Field(
        default=0.1, description="The rate rises and falls linearly in this time."
    )


class Quadratic(Document):
    """Angle quadratic in time, then held."""

    kind: Literal["quadratic"]
    initial_rad: Angle = 0.0
    final_rad: Angle
    duration_s: Duration
    start_s: Moment = 0.0


class Spline(Document):
    """Clamped cubic spline through knots: at rest before the first and after the last."""

    kind: Literal["spline"]
    knot_time_s: Annotated[list[ClockTime], FailFast(), Field(min_length=2, max_length=MAX_KNOTS)]
    knot_angle_rad: Annotated[list[Angle], FailFast(), Field(min_length=2, max_length=MAX_KNOTS)]


class Tabulated(Document):
    """A history in rows, interpolated differentiably; held before the first row and after the last."""

    kind: Literal["tabulated"]
    time_s: Annotated[list[ClockTime], FailFast(), Field(min_length=3, max_length=MAX_ROWS)]
    angle_rad: Annotated[list[Angle], FailFast(), Field(min_length=3, max_length=MAX_ROWS)]


AnySchedule = Hold | ConstantRate | Quadratic | Spline | Tabulated
Schedule = Annotated[AnySchedule, Field(discriminator="kind")]


class Schedules(Document):
    """What the hinges do: both sides the same, or each side its own."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"both": EXAMPLE_SCHEDULE}]})

    both: Schedule | None = None
    left: Schedule | None = None
    right: Schedule | None = None
