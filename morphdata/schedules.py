"""Sweep schedules: what each hinge does over time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import islice, pairwise
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, FailFast, Field

from morphdata.base import MAX_ROWS, MIN_ROWS, Angle, Document
from morphdata.drives import SIDES
from morphdata.faults import Fault, InvalidInput
from morphdata.samplefiles.flight import LONGEST_FLIGHT_S
from morphdata.samplefiles.reading import place_in, read_file
from morphdata.vehicle import HingeRange

MAX_DURATION_S = LONGEST_FLIGHT_S
MAX_KNOTS = 1000
DEFAULT_RAMP_S = 0.1
SCHEDULE_COLUMNS = ("t", "sweep_left", "sweep_right")

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
    ramp_s: Moment = Field(
        default=DEFAULT_RAMP_S, description="The rate rises and falls linearly in this time."
    )

    @property
    def morph_s(self) -> float:
        """Duration of the morph, given or out of the mean rate."""
        if self.duration_s is not None:
            return self.duration_s
        return abs(self.final_rad - self.initial_rad) / (self.rate_rad_s or 1.0)

    def faults(self) -> Iterator[Fault]:
        """Duration or rate is given, and the ramps fit into the morph."""
        if (self.duration_s is None) == (self.rate_rad_s is None):
            both = self.duration_s is not None
            yield Fault(
                "given_twice" if both else "missing",
                f"duration_s and rate_rad_s are {'both given' if both else 'both missing'}.",
                "/rate_rad_s" if both else "/duration_s",
                "Give one of them: the other follows.",
            )
        elif self.morph_s == 0.0:
            yield Fault(
                "nothing_to_morph",
                "rate_rad_s needs two different angles.",
                "/final_rad",
                'Give another final_rad, or {"kind": "hold"}.',
            )
        elif self.morph_s > MAX_DURATION_S:
            yield Fault(
                "morph_too_long",
                f"At {self.rate_rad_s:g} rad/s the morph takes {self.morph_s:g} s.",
                "/rate_rad_s",
                f"It must take at most {MAX_DURATION_S:g} s: morph faster.",
            )
        elif self.ramp_s > self.morph_s / 2:
            yield Fault(
                "ramp_too_long",
                f"Two ramps of {self.ramp_s:g} s do not fit into a morph of {self.morph_s:g} s.",
                "/ramp_s",
                f"Give at most {self.morph_s / 2:g} s, or morph more slowly.",
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

    def faults(self) -> Iterator[Fault]:
        """There is an angle for every time, and time rises."""
        yield from _history_faults(self, "knot_time_s", "knot_angle_rad")


class Tabulated(Document):
    """A history in rows, interpolated differentiably; held before the first row and after the last."""

    kind: Literal["tabulated"]
    time_s: Annotated[list[ClockTime], FailFast(), Field(min_length=3, max_length=MAX_ROWS)]
    angle_rad: Annotated[list[Angle], FailFast(), Field(min_length=3, max_length=MAX_ROWS)]

    def faults(self) -> Iterator[Fault]:
        """There is an angle for every time, and time rises."""
        yield from _history_faults(self, "time_s", "angle_rad")


def _history_faults(schedule: Document, time: str, angle: str) -> Iterator[Fault]:
    times: Sequence[float] = getattr(schedule, time)
    angles: Sequence[float] = getattr(schedule, angle)
    if len(times) != len(angles):
        yield Fault(
            "unequal_lengths",
            f"There are {len(times)} times and {len(angles)} angles.",
            f"/{angle}",
            "Give one angle for every time.",
        )
    for row, (before, after) in enumerate(pairwise(times), start=1):
        if after <= before:
            yield Fault(
                "time_not_rising",
                f"Time goes from {before:g} s to {after:g} s at row {row}.",
                f"/{time}/{row}",
                "Sort the rows by time and drop repeated ones.",
            )
            break


AnySchedule = Hold | ConstantRate | Quadratic | Spline | Tabulated
Schedule = Annotated[AnySchedule, Field(discriminator="kind")]


class Schedules(Document):
    """What the hinges do: both sides the same, or each side its own."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"both": EXAMPLE_SCHEDULE}]})

    both: Schedule | None = None
    left: Schedule | None = None
    right: Schedule | None = None

    def faults(self) -> Iterator[Fault]:
        """No side is told twice what to do."""
        if self.both is not None and (self.left is not None or self.right is not None):
            yield Fault(
                "given_twice",
                "`both` and a schedule for one side are given.",
                "/both",
                "Give both, or left and right.",
            )

    def of_side(self, side: str) -> tuple[str, AnySchedule] | None:
        """Return the schedule that a side follows, and its name here; None where nothing is said."""
        for name in (side, "both"):
            schedule: AnySchedule | None = getattr(self, name)
            if schedule is not None:
                return name, schedule
        return None

    def range_faults(self, hinges: Mapping[str, HingeRange]) -> Iterator[Fault]:
        """Check that every side with hinges has a schedule, within their range.

        A spline may leave its range between knots; the flight sees that.
        """
        for side in SIDES:
            if side in hinges and self.of_side(side) is None:
                yield Fault(
                    "missing",
                    f"There is no schedule for the {side} hinges.",
                    f"/{side}",
                    'Add it ({"kind": "hold"} keeps them still), or give both sides one schedule as both.',
                )
        for name in ("both", *SIDES):
            schedule: AnySchedule | None = getattr(self, name)
            if schedule is None:
                continue
            for side in SIDES:
                if side in hinges and name in (side, "both"):
                    faults = (
                        hinges[side].fault(side, angle, f"/{name}/{at}") for angle, at in _angles(schedule)
                    )
                    yield from islice(filter(None, faults), 1)


def _angles(schedule: AnySchedule) -> Iterator[tuple[float, str]]:
    """Angles that a schedule names, with their place in it."""
    if isinstance(schedule, Hold):
        yield schedule.angle_rad, "angle_rad"
    elif isinstance(schedule, ConstantRate | Quadratic):
        yield schedule.initial_rad, "initial_rad"
        yield schedule.final_rad, "final_rad"
    elif isinstance(schedule, Spline):
        yield from ((angle, f"knot_angle_rad/{row}") for row, angle in enumerate(schedule.knot_angle_rad))
    else:
        yield from ((angle, f"angle_rad/{row}") for row, angle in enumerate(schedule.angle_rad))


def load_schedules(path: str | Path) -> Schedules:
    """Read a morph schedule from a file with the columns t, sweep_left, sweep_right.

    Units in the names are accepted (``t_ms``, ``sweep_left_deg``); other columns are not looked at, so that a
    sample flight is a schedule too.

    Raises
    ------
    InvalidInput
        A column is missing or holds something that is not a finite number, there are too few rows, or time
        does not rise.
    """
    path = Path(path)
    table = read_file(path, SCHEDULE_COLUMNS)
    times = list(table.values["t"])
    if len(times) < MIN_ROWS:
        raise InvalidInput(f"{path} holds {len(times)} rows", hint=f"give {MIN_ROWS} to {MAX_ROWS} rows")
    for row, (before, after) in enumerate(pairwise(times), start=1):
        if after <= before:
            raise InvalidInput(
                f"{place_in(path, table, row)}: time does not increase",
                hint="sort the rows by time and drop repeated ones",
            )
    return Schedules.parse(
        {
            side: {"kind": "tabulated", "time_s": times, "angle_rad": list(table.values[f"sweep_{side}"])}
            for side in SIDES
        }
    )
