"""Sample flights: measured drives and attitude over time, inline or by reference to an uploaded flight."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    ConfigDict,
    Discriminator,
    Field,
    GetJsonSchemaHandler,
    Tag,
    model_validator,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticKnownError

from morphdata.axes import ATTITUDE_FIELDS, Axes, QuaternionSeries, in_axes_of_here
from morphdata.base import AngleSeries, ChannelSeries, Document, Identifier, SampleName, TimeSeries
from morphdata.channels import channel_field, document_name, is_channel
from morphdata.drive_keys import resolved, resolved_columns, shown_names, unmeasured_sides
from morphdata.drives import RESERVED, SWEEPS, Drive, field_name, wrong_unit
from morphdata.faults import Fault, InvalidInput, refuse
from morphdata.samplefiles.channel_columns import with_gaps
from morphdata.samplefiles.declared import NOTHING, Declared
from morphdata.samplefiles.fault import as_sentence, said_of
from morphdata.samplefiles.flight import INLINE, flight_faults
from morphdata.samplefiles.reading import read_flight
from morphdata.samplefiles.titles import DRIVE
from morphdata.samplefiles.units import DEGREE

Role = Literal["train", "held_out"]
Weight = Annotated[float, Field(gt=0.0, le=1e6)]

EXAMPLE_SAMPLE: dict[str, Any] = {
    "name": "rate_0.5",
    "role": "train",
    "time_s": [0.0, 0.01, 0.02, 0.03],
    "sweep_left_rad": [0.0, 0.0, 0.001, 0.003],
    "sweep_right_rad": [0.0, 0.0, 0.001, 0.003],
    "phi_rad": [0.0, 0.0, 0.0, 0.0],
    "theta_rad": [0.0623, 0.0623, 0.0622, 0.0622],
    "psi_rad": [0.0, 0.0, 0.0, 0.0],
    "weight": 1.0,
}
EXAMPLE_FOLD: dict[str, Any] = {
    name: values for name, values in EXAMPLE_SAMPLE.items() if not name.startswith("sweep")
} | {"name": "fold_30", "sweep_rad": [0.0, 0.0, 0.001, 0.003], "fold_left_deg": [0.0, 0.0, 0.1, 0.3]}
UNITS = {"_rad": 1.0, "_deg": DEGREE, "_m": 1.0}  # of the columns of drives inline
MISSPELT = 0.9  # so near to one of them no column is that of a drive


def _column(name: str) -> str:
    """Take the name of a further column: of a drive or of a channel, with its unit."""
    if channel_field(name) is not None:
        return name
    key = drive_key(name)
    misspelt = difflib.get_close_matches(name, ATTITUDE_FIELDS, n=1, cutoff=MISSPELT)
    if key is None or not DRIVE.fullmatch(key) or key in RESERVED or misspelt:
        raise PydanticKnownError("extra_forbidden")
    return name


def drive_key(field: str) -> str | None:
    """Return the drive, or the word of both sides, of a column inline; None of all other columns."""
    suffix = _suffix(field)
    return field.removesuffix(suffix) if suffix and channel_field(field) is None else None


def _suffix(field: str) -> str:
    """Return the unit at the end of a field of a drive, with its mark; "" for another field."""
    return next((unit for unit in UNITS if field.endswith(unit)), "")


class TrajectoryColumns(Document):
    """Columns of one flight, equally long; time rises, steps may be uneven.

    Every drive of the aircraft may have its column, `fold_left_rad`, or both sides of a kind one,
    `fold_rad`; with `_deg` for `_rad` in degrees. Drives that slide have theirs in metres, `span_left_m`.
    Measured channels have theirs, named like those of
    simulated flights, the unit at the end: `p_rad_s`, `nz`, `tip_right_z_m`. Null is a missing value.
    """

    model_config = ConfigDict(extra="allow")

    __pydantic_extra__: dict[Annotated[str, AfterValidator(_column)], ChannelSeries] = Field(init=False)

    time_s: TimeSeries
    sweep_left_rad: AngleSeries | None = Field(
        default=None,
        description="Angle of the drive `sweep_left`, positive aft; of an aircraft whose left side has only "
        "another kind of hinge, the angle of that.",
    )
    sweep_right_rad: AngleSeries | None = Field(
        default=None, description="The same of the right side, positive aft."
    )
    phi_rad: AngleSeries = Field(description="Roll (z-y-x Euler angles, body FRD against earth NED).")
    theta_rad: AngleSeries = Field(description="Pitch.")
    psi_rad: AngleSeries = Field(description="Yaw.")
    qw: QuaternionSeries = Field(
        default=None,
        description="In the place of the three angles: the rotation from body to earth as a unit quaternion, "
        "qw + qx i + qy j + qz k, which turns vectors of the body into the earth's axes.",
    )
    qx: QuaternionSeries = None
    qy: QuaternionSeries = None
    qz: QuaternionSeries = None
    frames: Axes | None = Field(
        default=None,
        description="Axes of the angles or the quaternion and of the channels, if they are others than NED "
        "and FRD. Drives have signs of their own.",
    )

    @model_validator(mode="before")
    @classmethod
    def _in_here(cls, given: Any) -> Any:
        """Turn attitude and channels to NED and FRD, where they are sound; the fields say what is not."""
        return in_axes_of_here(given) if isinstance(given, dict) else given

    @classmethod
    def __get_pydantic_json_schema__(
        cls, core_schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Describe that a quaternion may stand in the place of the angles."""
        schema = super().__get_pydantic_json_schema__(core_schema, handler)
        if handler.mode == "validation":
            described = handler.resolve_ref_schema(schema)
            required = described["required"]
            described["required"] = [name for name in required if name not in ATTITUDE_FIELDS]
        return schema

    @property
    def drive_fields(self) -> dict[str, str]:
        """Field of each column of a drive, by the drive's name or the word of both sides."""
        given = [field for field in (INLINE[name] for name in SWEEPS) if getattr(self, field) is not None]
        given += self.model_extra or {}
        return {key: field for field in given if (key := drive_key(field)) is not None}

    @property
    def drive_units(self) -> dict[str, str]:
        """Unit, rad or m, of each column of a drive, by the drive's name or the word of both sides."""
        return {key: "m" if _suffix(field) == "_m" else "rad" for key, field in self.drive_fields.items()}

    @property
    def drives(self) -> dict[str, list[float]]:
        """Angles of each column of a drive, rad (or m), by the drive's name or the word of both sides."""
        return {key: self._angles(field) for key, field in self.drive_fields.items()}

    @property
    def channel_fields(self) -> dict[str, str]:
        """Field of each measured channel, by the channel's column (``p``, ``tip_z_right_wing``)."""
        found = {field: channel_field(field) for field in self.model_extra or {}}
        return {meant[0]: field for field, meant in found.items() if meant is not None}

    @property
    def channels(self) -> dict[str, list[float | None]]:
        """Values of each measured channel, SI units, by the channel's column; None where one is missing."""
        return {column: self._measured(field) for column, field in self.channel_fields.items()}

    def _measured(self, field: str) -> list[float | None]:
        values: list[float | None] = getattr(self, field)
        _, factor = channel_field(field) or (field, 1.0)
        return values if factor == 1.0 else [None if value is None else factor * value for value in values]

    def _angles(self, field: str) -> list[float]:
        angles: list[float] = getattr(self, field)
        factor = UNITS[_suffix(field)]
        return angles if factor == 1.0 else [factor * angle for angle in angles]

    def faults(self) -> Iterator[Fault]:
        """The columns are those of a flight."""
        drives = self.drive_fields
        yield from self._repeated_faults(drives, self.channel_fields)
        gaps = {key: gap for key, field in drives.items() if (gap := self._gap(field)) is not None}
        yield from gaps.values()
        fields = {**{name: INLINE[name] for name in ("t", "phi", "theta", "psi")}, **drives}
        named = {name: getattr(self, field) for name, field in fields.items() if name not in drives}
        named |= {key: self._angles(field) for key, field in drives.items() if key not in gaps}
        for fault in flight_faults(named, fields):
            row = "" if fault.row is None else f"/{fault.row}"
            yield Fault(
                fault.code,
                as_sentence(fault.detail),
                f"/{fields[fault.title or 't']}{row}",
                as_sentence(fault.hint),
            )
        yield from self._channel_faults()

    def _gap(self, field: str) -> Fault | None:
        """Return the first row in which a drive has no angle as a fault; None where there is none."""
        angles: list[float | None] = getattr(self, field)
        if None not in angles:
            return None
        row = angles.index(None)
        hint = "Leave out the row; only channels may have gaps."
        return Fault("float_type", f"{field} has no value at row {row}.", f"/{field}/{row}", hint)

    def _channel_faults(self) -> Iterator[Fault]:
        """Channels are as long as the flight, and hold a value."""
        rows = len(self.time_s)
        for field in self.channel_fields.values():
            values: list[float | None] = getattr(self, field)
            if len(values) != rows:
                detail = f"{field} has {len(values)} rows, time_s has {rows}."
                yield Fault("unequal_lengths", detail, f"/{field}", f"Give one {field} for every time.")
            elif all(value is None for value in values):
                yield Fault("no_values", f"{field} holds no value.", f"/{field}", "Leave the channel out.")

    def _repeated_faults(self, drives: Mapping[str, str], channels: Mapping[str, str]) -> Iterator[Fault]:
        """No drive and no channel is given in rad and in degrees."""
        for field in (*map(INLINE.__getitem__, SWEEPS), *(self.model_extra or {})):
            key, meant = drive_key(field), channel_field(field)
            if key is not None and getattr(self, field) is not None and drives[key] != field:
                yield _given_twice(field, drives[key])
            elif meant is not None and channels[meant[0]] != field:
                yield _given_twice(field, channels[meant[0]])

    def drive_faults(self, drives: Mapping[str, Drive]) -> Iterator[Fault]:
        """Check that the columns are drives of an aircraft, that no side is missing, and the ranges.

        A drive that has no column holds its angle.

        Parameters
        ----------
        drives : mapping of str to Drive
            Of the aircraft.
        """
        fields = self.drive_fields
        followed, faults = resolved(fields, drives)
        yield from (_at_field(fault, fields) for fault in faults)
        if not faults:
            yield from (_at_field(fault, fields) for fault in unmeasured_sides(followed, drives))
        if drives and not fields:
            yield no_drive(drives)
        angles = {key: self._angles(field) for key, field in fields.items() if key in followed.values()}
        reported = set()
        units = self.drive_units
        for name, key in followed.items():
            fault = (
                wrong_unit(drives[name], units[key], f"/{fields[key]}")
                if units[key] != drives[name].unit
                else _range_fault(drives[name], angles[key], f"/{fields[key]}")
            )
            if fault is not None and key not in reported:
                reported.add(key)
                yield fault


def _given_twice(field: str, other: str) -> Fault:
    return Fault("given_twice", f"{field} and {other} are both given.", f"/{field}", "Give one of them.")


def no_drive(drives: Mapping[str, Drive]) -> Fault:
    """Return the fault of a sample without any angle of a drive."""
    name, drive = next(iter(drives.items()))
    return Fault(
        "no_drive",
        "No column says how the aircraft's drives moved.",
        "",
        f"Add {field_name(name, drive.unit)}; its drives are {shown_names(drives)}.",
    )


def _at_field(fault: Fault, fields: Mapping[str, str]) -> Fault:
    """Return a fault at ``/key`` at the field of that key instead."""
    key = fault.pointer.removeprefix("/")
    return Fault(fault.code, fault.detail, f"/{fields.get(key, f'{key}_rad')}", fault.hint)


def _range_fault(drive: Drive, angles: Sequence[float], pointer: str) -> Fault | None:
    """Return the first angle that is out of a drive's range as a fault; None where all are in it."""
    if drive.fault(min(angles), "") is None and drive.fault(max(angles), "") is None:
        return None
    furthest = max(angles, key=abs)
    faults = (drive.fault(angle, f"{pointer}/{row}", furthest) for row, angle in enumerate(angles))
    return next(fault for fault in faults if fault is not None)


class InlineSample(TrajectoryColumns):
    """A sample with its rows."""

    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE_SAMPLE, EXAMPLE_FOLD]})

    name: SampleName
    role: Role = Field(
        default="train", description="`held_out` samples are flown and reported, never fitted."
    )
    weight: Weight = 1.0


class UploadedSample(Document):
    """A sample whose rows were uploaded with POST /trajectories."""

    trajectory_id: Identifier
    name: SampleName | None = Field(default=None, description="The trajectory's own name when left out.")
    role: Role = Field(
        default="train", description="`held_out` samples are flown and reported, never fitted."
    )
    weight: Weight = 1.0


def sample_name(stem: str) -> str:
    """Make a sample's name of a file's: ``my flight (1)`` becomes ``my-flight--1-``."""
    plain = "".join(c if c.isascii() and (c.isalnum() or c in "._-") else "-" for c in stem)[:64]
    return plain.lstrip("._-") or "trajectory"


def columns_of_aircraft(
    measured: Sequence[str], unreadable: Mapping[str, str], drives: Mapping[str, Drive]
) -> dict[str, str]:
    """Choose the columns of a file that move an aircraft; a file may hold others.

    Parameters
    ----------
    measured : sequence of str
        Columns of the file that could be drives, without their units.
    unreadable : mapping of str to str
        Columns that could be drives as well but could not be read, and why; those of channels do not count.
    drives : mapping of str to Drive
        Of the aircraft.

    Returns
    -------
    dict
        Drive -> column; a drive that was not measured is not in it.

    Raises
    ------
    InvalidInput
        No column moves a drive, one could mean several, or that of a drive is among the unreadable.
    """
    unreadable = {name: said for name, said in unreadable.items() if not is_channel(name)}
    followed, faults = resolved_columns([*measured, *unreadable], drives)
    broken = dict.fromkeys(key for key in followed.values() if key in unreadable)
    faults += [
        Fault("unreadable_column", as_sentence(unreadable[key]), "", "Repair the column of the drive.")
        for key in broken
    ]
    if faults:
        raise InvalidInput.of(Fault(fault.code, fault.detail, "", fault.hint) for fault in faults)
    return followed


def load_sample(
    path: str | Path,
    role: Role = "train",
    drives: Mapping[str, Drive] | None = None,
    declared: Declared = NOTHING,
) -> InlineSample:
    """Read a sample flight from its CSV, JSON, Parquet or MATLAB file, as it stands inline in a request.

    Parameters
    ----------
    path : str or Path
        Of the file.
    role : str
        ``train`` or ``held_out``.
    drives : mapping of str to Drive, optional
        Of the aircraft that flew (`Aircraft.drives`): columns that move none of them are left out. By default
        every column that could be a drive is kept. Columns of channels are always kept.
    declared : Declared
        What the file's owner says about its axes and columns.

    Raises
    ------
    InvalidInput
        The file cannot be read, holds no flight, or moves no drive; the sentence names the file and the line.
    """
    path = Path(path)
    columns = read_flight(path, declared)
    names, units = list(columns.drives), dict(columns.units)
    if drives is not None:
        unreadable = {name: said_of(fault) for name, fault in columns.unreadable.items()}
        try:
            followed = columns_of_aircraft(names, unreadable, drives)
            refuse(
                Fault(fault.code, fault.detail, "", fault.hint)
                for fault in unmeasured_sides(followed, drives)
            )
            names = list(dict.fromkeys(followed.values()))
            units = {key: drives[name].unit for name, key in followed.items()} | units
        except InvalidInput as error:
            raise InvalidInput(f"{path}: {error.message}", hint=error.hint) from None
    angles = {name: columns.drives[name] for name in names}
    named = {name: columns.values[name] for name in ("t", "phi", "theta", "psi")} | angles
    return InlineSample.parse(
        {
            "name": sample_name(path.stem),
            "role": role,
            **{
                INLINE.get(name, field_name(name, units.get(name, "rad"))): list(values)
                for name, values in named.items()
            },
            **{document_name(name): with_gaps(values) for name, values in columns.channels.items()},
        }
    )


def _form(value: Any) -> str:
    reference = "trajectory_id" in value if isinstance(value, dict) else isinstance(value, UploadedSample)
    return "uploaded" if reference else "inline"


Sample = Annotated[
    Annotated[InlineSample, Tag("inline")] | Annotated[UploadedSample, Tag("uploaded")],
    Discriminator(_form),
]
