"""Schedules: motions of the drives over time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import islice, pairwise
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import (
    ConfigDict,
    Discriminator,
    FailFast,
    Field,
    PrivateAttr,
    Tag,
    model_validator,
)
from pydantic_core import PydanticCustomError

from morphdata.base import Angle, Document
from morphdata.drive_keys import resolved
from morphdata.drives import SWEEPS, Drive, Unit, field_name
from morphdata.extensions import (
    EXTENSION_FIELDS,
    ExtensionSchedule,
)
from morphdata.faults import Fault, InvalidInput, refuse
from morphdata.history import (
    DEFAULT_RAMP_S,
    MAX_KNOTS,
    AngleHistory,
    ClockTime,
    Duration,
    Moment,
    Rate,
    history_faults,
    rate_faults,
)
from morphdata.refusals import FAULTS, HALF_TURN_RAD, escaped
from morphdata.samplefiles.fault import said_of
from morphdata.samplefiles.flight import MAX_ROWS, MIN_ROWS
from morphdata.samplefiles.reading import place_in, read_file
from morphdata.samples import columns_of_aircraft

SCHEDULE_COLUMNS = ("t", *SWEEPS)

EXAMPLE_SCHEDULE: dict[str, Any] = {
    "kind": "constant_rate",
    "initial_rad": 0.0,
    "final_rad": 1.0,
    "duration_s": 2.0,
    "start_s": 0.2,
}


class Hold(AngleHistory):
    """A hinge that does not move."""

    values: ClassVar[tuple[str, ...]] = ("angle_rad",)
    kind: Literal["hold"]
    angle_rad: Angle = 0.0


class ConstantRate(AngleHistory):
    """From one angle to another at constant rate, with ramps of the rate inside the duration."""

    values: ClassVar[tuple[str, ...]] = ("initial_rad", "final_rad")

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
        """Duration of the morph, as given or from the mean rate."""
        if self.duration_s is not None:
            return self.duration_s
        return abs(self.final_rad - self.initial_rad) / (self.rate_rad_s or 1.0)

    def faults(self) -> Iterator[Fault]:
        """Check that duration or rate is given, and that the ramps fit into the morph."""
        yield from rate_faults(self.duration_s, self.rate_rad_s, self.morph_s, self.ramp_s, self.unit)


class Quadratic(AngleHistory):
    """Angle quadratic in time, then held."""

    values: ClassVar[tuple[str, ...]] = ("initial_rad", "final_rad")
    kind: Literal["quadratic"]
    initial_rad: Angle = 0.0
    final_rad: Angle
    duration_s: Duration
    start_s: Moment = 0.0


class Spline(AngleHistory):
    """Clamped cubic spline through knots: at rest before the first and after the last."""

    values: ClassVar[tuple[str, ...]] = ("knot_angle_rad",)
    kind: Literal["spline"]
    knot_time_s: Annotated[list[ClockTime], FailFast(), Field(min_length=2, max_length=MAX_KNOTS)]
    knot_angle_rad: Annotated[list[Angle], FailFast(), Field(min_length=2, max_length=MAX_KNOTS)]

    def faults(self) -> Iterator[Fault]:
        """Check that there is an angle for every time, and that time increases."""
        yield from history_faults(self, "knot_time_s", "knot_angle_rad", "angle")


class Tabulated(AngleHistory):
    """A history in rows, interpolated differentiably; held before the first row and after the last."""

    values: ClassVar[tuple[str, ...]] = ("angle_rad",)
    kind: Literal["tabulated"]
    time_s: Annotated[list[ClockTime], FailFast(), Field(min_length=3, max_length=MAX_ROWS)]
    angle_rad: Annotated[list[Angle], FailFast(), Field(min_length=3, max_length=MAX_ROWS)]

    def faults(self) -> Iterator[Fault]:
        """Check that there is an angle for every time, and that time increases."""
        yield from history_faults(self, "time_s", "angle_rad", "angle")


def _unit(value: Any) -> str:
    """Return the unit of a schedule, by the names of its fields."""
    if isinstance(value, dict):
        return "m" if any(name in value for name in EXTENSION_FIELDS) else "rad"
    return str(getattr(value, "unit", "rad"))


AngleSchedule = Hold | ConstantRate | Quadratic | Spline | Tabulated
AnySchedule = AngleSchedule | ExtensionSchedule
Schedule = Annotated[
    Annotated[AngleSchedule, Field(discriminator="kind"), Tag("rad")]
    | Annotated[ExtensionSchedule, Field(discriminator="kind"), Tag("m")],
    Discriminator(_unit),
]


EXAMPLE_HOLD: dict[str, Any] = {"kind": "hold", "angle_rad": 0.2}


class Schedules(Document):
    """Schedules of the drives that move, by name; the others hold their angle.

    A key is the name of a drive (`fold_left`) or the word of a kind of hinge, which moves both sides together
    (`sweep`). If a side has only one kind of hinge, `both`, `left` and `right` may be used.
    """

    model_config = ConfigDict(
        extra="allow",
        json_schema_extra={
            "examples": [
                {"both": EXAMPLE_SCHEDULE},
                {"sweep": EXAMPLE_SCHEDULE},
                {"sweep": EXAMPLE_SCHEDULE, "fold_left": EXAMPLE_HOLD},
            ]
        },
    )

    __pydantic_extra__: dict[str, Schedule] = Field(init=False)

    both: Schedule | None = Field(default=None, description="Of the only kind of hinge, on both sides.")
    left: Schedule | None = Field(default=None, description="Of the only kind of hinge on the left.")
    right: Schedule | None = Field(default=None, description="Of the only kind of hinge on the right.")

    @model_validator(mode="before")
    @classmethod
    def _by_drive(cls, given: Any) -> Any:
        """Refuse a schedule given without the name of its drive, with a specific message."""
        if isinstance(given, dict) and isinstance(given.get("kind"), str):
            fault = Fault(
                "missing",
                "This is one schedule, without the drive that follows it.",
                "",
                f'Name the drive: {{"sweep": {{"kind": "{given["kind"][:20]}", ...}}}}.',
            )
            raise PydanticCustomError(FAULTS, "the drive is missing", {FAULTS: (fault,)})
        return given

    @property
    def given(self) -> dict[str, AnySchedule]:
        """Every schedule by its key."""
        return {key: schedule for key, schedule in self if schedule is not None}

    def keys_by_drive(self, drives: Mapping[str, Drive]) -> dict[str, str]:
        """Find the key of the schedule that each drive of an aircraft follows.

        Parameters
        ----------
        drives : mapping of str to Drive
            Of the aircraft.

        Returns
        -------
        dict
            Drive -> key; drives that hold their angle are left out.

        Raises
        ------
        InvalidInput
            A key names no drive, is ambiguous, or moves a drive that another key moves.
        """
        keys, faults = resolved(self.given, drives)
        refuse(fault.under("/schedules") for fault in faults)
        return keys

    def by_drive(self, drives: Mapping[str, Drive]) -> dict[str, AnySchedule]:
        """Return the schedule of each drive of an aircraft that moves, by the drive's name.

        Raises
        ------
        InvalidInput
            As in `keys_by_drive`.
        """
        given = self.given
        return {name: given[key] for name, key in self.keys_by_drive(drives).items()}

    def drive_faults(self, drives: Mapping[str, Drive]) -> Iterator[Fault]:
        """Check that every key moves a drive of an aircraft, within its range.

        A spline may leave its range between knots; the flight checks that.
        """
        try:
            keys = self.keys_by_drive(drives)
        except InvalidInput as error:
            yield from error.faults
            return
        given = self.given
        reported = set()
        for name, key in keys.items():
            at, drive = f"/schedules/{escaped(key)}", drives[name]
            if given[key].unit != drive.unit:
                yield unit_fault(name, drive.unit, given[key], at)
                break
            faults = (drive.fault(value, f"{at}/{place}") for value, place in given[key].named)
            for fault in islice(filter(None, faults), 1):
                if key not in reported:
                    reported.add(key)
                    yield fault


def unit_fault(name: str, unit: Unit, schedule: AnySchedule, pointer: str) -> Fault:
    """Return the fault of a schedule in another unit than that of its drive."""
    _, place = next(schedule.named)
    field = place.partition("/")[0]
    words = {"rad": "angle", "m": "extension"}
    stem = field.removesuffix(f"_{schedule.unit}").replace(words[schedule.unit], words[unit])
    return Fault(
        "wrong_unit",
        f"The drive {name!r} {'slides' if unit == 'm' else 'turns'}, and {field} is in {schedule.unit}.",
        f"{pointer}/{place}",
        f"Give its history in {unit}: {stem}_{unit}; in a file, name the column {field_name(name, unit)}.",
    )


class TabulatedSchedules(Schedules):
    """Schedules from a file, whose columns need not all be drives of the aircraft."""

    _path: str = PrivateAttr(default="")
    _unreadable: dict[str, str] = PrivateAttr(default_factory=dict)

    @classmethod
    def of_file(cls, path: Path, histories: dict[str, Any], unreadable: dict[str, str]) -> Self:
        """Build the schedules from a file's columns.

        Parameters
        ----------
        path : Path
            Of the file, for errors.
        histories : dict
            A schedule as a document for every column that could be a drive.
        unreadable : dict of str to str
            Further columns that could be drives, with their faults.
        """
        return cls.parse(histories).read_from(path, unreadable)

    def read_from(self, path: Path, unreadable: dict[str, str]) -> Self:
        """Record the origin of the schedules, and return them."""
        self._path, self._unreadable = str(path), unreadable
        return self

    def keys_by_drive(self, drives: Mapping[str, Drive]) -> dict[str, str]:
        """Find the column of each drive that has one.

        Raises
        ------
        InvalidInput
            No column moves a drive, or one is ambiguous or cannot be read.
        """
        try:
            return columns_of_aircraft(list(self.given), self._unreadable, drives)
        except InvalidInput as error:
            message = f"{self._path}: {error.message}" if self._path else error.message
            raise InvalidInput(message, pointer="/schedules", hint=error.hint) from None


def load_schedules(path: str | Path) -> Schedules:
    """Read schedules from a file with the column t and a column for each drive that moves.

    A column is named after a drive, or after the word of a kind of hinge to move both sides together. Units
    in the names are accepted (``t_ms``, ``fold_left_deg``), and those of drives that slide are needed
    (``span_m``); columns that are not drives of the aircraft are
    ignored, so that a sample flight is also a schedule. A drive without a column holds its angle.

    Raises
    ------
    InvalidInput
        The time column is missing, no column could be a drive, there are too few rows, or time does not
        increase.
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
    unreadable = {name: said_of(fault) for name, fault in table.unreadable.items()}
    histories: dict[str, dict[str, Any]] = {}
    for name, angles in table.drives.items():
        if table.units.get(name) == "m":
            histories[name] = {"kind": "tabulated", "time_s": times, "extension_m": list(angles)}
        elif max(map(abs, angles)) > HALF_TURN_RAD:
            row = next(row for row, angle in enumerate(angles) if abs(angle) > HALF_TURN_RAD)
            unreadable[name] = (
                f"{place_in(path, table, row)}: {name} is {angles[row]:g} rad; if the column is in degrees, "
                f"name it {name}_deg"
            )
        else:
            histories[name] = {"kind": "tabulated", "time_s": times, "angle_rad": list(angles)}
    return TabulatedSchedules.of_file(path, histories, unreadable)
