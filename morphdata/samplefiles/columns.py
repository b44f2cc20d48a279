"""The columns of one flight as they come out of a file."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from morphdata.samplefiles.channel_columns import MAX_CHANNELS, channel_columns, without_gaps
from morphdata.samplefiles.channel_titles import channel_meant
from morphdata.samplefiles.declared import NOTHING, Declared
from morphdata.samplefiles.fault import FileFault, shown
from morphdata.samplefiles.flight import MAX_ROWS, angle_fault, from_first_row
from morphdata.samplefiles.frames import (
    EULER,
    HERE,
    QUATERNION,
    Frames,
    channels_in_here,
    euler_in_ned,
    euler_of_quaternions,
    quaternion_fault,
)
from morphdata.samplefiles.titles import (
    FLIGHT,
    SWEEPS,
    drive_in_brackets,
    drive_meant,
    known_units,
    missing_columns,
    slides,
)

MAX_DRIVES = 64  # 16 surfaces of 4 hinges each
MAX_DRIVE_NUMBERS = 2_000_000  # in all columns that could be drives: 20 of the longest flight

Numbers = Iterable[float]


@dataclass(frozen=True)
class Wanted:
    """What a reader is asked for.

    Parameters
    ----------
    names : the columns that are read strictly, and given in SI units.
    optional : those of them that may be missing.
    others : whether further columns of numbers are given too, as they are; those that could be drives are
        given in any case, in rad, and so are those of channels, in SI units.
    max_rows : a longer file is refused.
    declared : what the file's owner says about it.
    """

    names: tuple[str, ...] = FLIGHT
    optional: tuple[str, ...] = SWEEPS
    others: bool = False
    max_rows: int = MAX_ROWS
    declared: Declared = NOTHING

    def called(self, titles: Iterable[str]) -> list[str]:
        """What columns are called by what was declared about them.

        Raises
        ------
        FileFault : a declared column is missing.
        """
        listed = list(titles)
        self.declared.require_found(listed)
        return [self.declared.called(title) for title in listed]

    def further(self, titles: Iterable[str]) -> list[str]:
        """Which of the further columns are read."""
        if self.others:
            return [title for title in titles if title]
        listed = list(titles)
        drives = _preferred([title for title in listed if drive_meant(title) is not None], MAX_DRIVES)
        channels = [title for title in listed if channel_meant(title) is not None][:MAX_CHANNELS]
        return [title for title in listed if title in {*drives, *channels}]

    def too_many_rows(self) -> FileFault:
        """The fault of a file that is too long."""
        return FileFault(
            "too_many_rows",
            f"the file has more than {self.max_rows} rows",
            "10 ms between rows are enough: leave out rows, or split the flight",
        )


@dataclass(frozen=True)
class FlightColumns:
    """Columns of numbers, equally long.

    Attributes
    ----------
    values : the wanted ones by name, SI units.
    others : further ones by their own titles, units as they are.
    lines : of a text file the line of each row, from 1; else empty.
    candidates : further ones that could be drives by the drive's name, rad or m.
    units : of candidates whose titles name a unit, "rad" or "m".
    unreadable : what is wrong with columns that could be drives or are channels as well, by the name.
    channels : further ones of channels by the channel's column, SI units; NaN where a value is missing.
    """

    values: dict[str, array[float]]
    others: dict[str, array[float]] = field(default_factory=dict)
    lines: Sequence[int] = ()
    candidates: dict[str, array[float]] = field(default_factory=dict)
    unreadable: dict[str, FileFault] = field(default_factory=dict)
    channels: dict[str, array[float]] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)

    @property
    def drives(self) -> dict[str, array[float]]:
        """All columns that could be drives, by the drive's name; rad."""
        return {**{name: self.values[name] for name in SWEEPS if name in self.values}, **self.candidates}


def _preferred(names: Sequence[str], maximum: int) -> list[str]:
    """So many of the names that drives may have, those with a side first; in their order."""
    kept = set(
        sorted(names, key=lambda name: not any(f"_{side}" in name for side in ("left", "right")))[:maximum]
    )
    return [name for name in names if name in kept]


def column_in_si(name: str, values: Sequence[float], factor: float | None, title: str) -> array[float]:
    """A flight's column in SI units; time from the first row where its clock counts from an epoch.

    Raises
    ------
    FileFault : naming the first row that is no finite number.
    """
    return in_si(from_first_row(values, factor) if name == "t" else values, factor, title)


def in_si(values: Numbers, factor: float | None, title: str) -> array[float]:
    """Values times `factor`; FileFault names the first row that is no finite number."""
    scale = 1.0 if factor is None else factor
    scaled = array("d", values if scale == 1.0 else (value * scale for value in values))
    if not all(map(math.isfinite, scaled)):
        row = next(number for number, value in enumerate(scaled) if not math.isfinite(value))
        raise not_finite(title, scaled[row], row)
    return scaled


def further_column(values: Iterable[float | None], title: str) -> array[float]:
    """A further column, units as they are; NaN in the gaps of a channel, which alone may have some.

    Raises
    ------
    FileFault : naming the first row that is no finite number.
    """
    return without_gaps(values) if channel_meant(title) else in_si(values, 1.0, title)  # type: ignore[arg-type]


def not_finite(title: str, value: object, row: int, line: int | None = None) -> FileFault:
    """The fault of a cell that is no finite number."""
    said = "missing" if value is None or value == "" else repr(shown(value))
    return FileFault(
        "finite_number",
        f"{shown(title)} is {said}, not a finite number",
        "remove or repair the row",
        row=row,
        line=line,
        title=title,
    )


def equally_long(columns: FlightColumns, titles: dict[str, str]) -> FlightColumns:
    """The columns, if they are of one length; FileFault names the odd one by its title."""
    names = list(columns.values)
    rows = len(columns.values[names[0]])
    for name in names[1:]:
        if len(columns.values[name]) != rows:
            raise FileFault(
                "unequal_lengths",
                f"{shown(titles[name])} has {len(columns.values[name])} rows, "
                f"{shown(titles[names[0]])} has {rows}",
                "give equal lengths",
                title=titles[name],
            )
    return columns


def gathered(
    wanted: Wanted,
    titles: Sequence[str],
    columns: FlightColumns,
    units: Mapping[str, float | FileFault] | None = None,
    faults: Mapping[str, FileFault] | None = None,
) -> FlightColumns:
    """The columns that were read, with the further ones that could be drives or are channels.

    Parameters
    ----------
    wanted : what was asked for.
    titles : of all columns of the file but the wanted ones.
    columns : those that were read; the further ones with units as they are, and NaN in channels' gaps.
    units : of further columns, by title, where they stand apart from the title: factor to SI, or what is
        wrong with them.
    faults : what is wrong with further columns that could not be read, by title.

    Raises
    ------
    FileFault : no column could be a drive.
    """
    columns = _between(columns, wanted.declared.between)
    meant, unreadable = _meant(titles, units or {})
    rows = len(next(iter(columns.values.values())))
    maximum = min(MAX_DRIVES, MAX_DRIVE_NUMBERS // max(rows, 1))
    candidates: dict[str, array[float]] = {}
    kept = _preferred([name for name, (title, _) in meant.items() if title in columns.others], maximum)
    read = wanted.further(titles)
    columns = in_declared_axes(_as_declared(columns, wanted.declared), wanted.declared.frames)
    for name, (title, factor) in meant.items():
        if title not in columns.others and title in read:
            unreadable[name] = (faults or {}).get(title) or _no_numbers(title)
        elif name not in kept:
            unreadable[name] = FileFault(
                "too_many_columns",
                f"{shown(title)} is not read: more than {maximum} further columns could be drives",
                "leave out the columns that are none",
            )
        else:
            angles = _affine(in_si(columns.others[title], factor, title), wanted.declared.affine(name))
            fault = angle_fault(name, angles, shown(title))
            if fault is None:
                candidates[name] = angles
            else:
                unreadable[name] = fault
    channels, broken = channel_columns(titles, columns.others, units or {}, faults or {})
    channels = {name: _affine(values, wanted.declared.affine(name)) for name, values in channels.items()}
    channels = channels_in_here(channels, wanted.declared.frames)
    others = {title: values for title, values in columns.others.items() if _whole(title, values)}
    found = FlightColumns(
        columns.values,
        others if wanted.others else {},
        columns.lines,
        candidates,
        unreadable | broken,
        channels,
        {
            name: "m" if slides(title) else "rad"
            for name, (title, factor) in meant.items()
            if name in candidates and factor is not None
        },
    )
    if not found.drives and wanted.optional:
        sided = (fault for name, fault in unreadable.items() if name.endswith(("_left", "_right")))
        raise next(sided, missing_columns(titles, wanted.names, wanted.optional))
    return found


def _between(columns: FlightColumns, window: tuple[float, float] | None) -> FlightColumns:
    """The rows in a window of time."""
    if window is None:
        return columns
    times = columns.values["t"]
    kept = [row for row, time in enumerate(times) if window[0] <= time <= window[1]]
    if not kept:
        detail = f"no row lies between {window[0]:g} s and {window[1]:g} s"
        raise FileFault("no_rows", detail, f"the file goes from {min(times):g} s to {max(times):g} s")

    def cut(table: Mapping[str, array[float]]) -> dict[str, array[float]]:
        return {name: array("d", (values[row] for row in kept)) for name, values in table.items()}

    lines = [columns.lines[row] for row in kept] if len(columns.lines) else ()
    return replace(columns, values=cut(columns.values), others=cut(columns.others), lines=lines)


def _as_declared(columns: FlightColumns, declared: Declared) -> FlightColumns:
    """The columns with declared scales and offsets in those that count."""
    if not declared.columns:
        return columns
    values = {name: _affine(column, declared.affine(name)) for name, column in columns.values.items()}
    return replace(columns, values=values)


def _affine(values: array[float], affine: tuple[float, float] | None) -> array[float]:
    if affine is None:
        return values
    scale, offset = affine
    return array("d", (scale * value + offset for value in values))


def in_declared_axes(columns: FlightColumns, frames: Frames) -> FlightColumns:
    """The columns with the attitude as Euler angles between NED and FRD.

    Raises
    ------
    FileFault : naming the row of a quaternion that is none, or of a pitch angle that is none.
    """
    values = dict(columns.values)
    quaternion = [values.pop(name) for name in QUATERNION if name in values]
    if quaternion:
        rows = list(zip(*quaternion, strict=True))
        for row, components in enumerate(rows):
            detail = quaternion_fault(components)
            if detail is not None:
                line = columns.lines[row] if len(columns.lines) else None
                hint = "repair the row; a quaternion has four components whose squares add up to 1"
                raise FileFault("no_rotation", detail, hint, row=row, line=line, title="qw")
        values |= zip(EULER, euler_of_quaternions(rows, frames), strict=True)
    elif frames != HERE and "theta" in values:
        fault = angle_fault("theta", values["theta"], "theta")  # of other axes it is an angle as steep
        if fault is not None:
            raise fault
        rows = list(zip(*(values[name] for name in EULER), strict=True))
        values |= zip(EULER, euler_in_ned(rows, frames), strict=True)
    return replace(columns, values={name: values[name] for name in sorted(values, key=_place)})


def _place(name: str) -> int:
    return FLIGHT.index(name) if name in FLIGHT else len(FLIGHT)


def _whole(title: str, values: array[float]) -> bool:
    """Whether a further column has a finite number in each row; only those of channels may have gaps."""
    return channel_meant(title) is None or all(map(math.isfinite, values))


def _meant(
    titles: Sequence[str], units: Mapping[str, float | FileFault]
) -> tuple[dict[str, tuple[str, float | None]], dict[str, FileFault]]:
    """The drives that titles could mean, with title and factor to rad, and those that they cannot give."""
    meant: dict[str, tuple[str, float | None]] = {}
    unreadable: dict[str, FileFault] = {}
    for title in titles:
        found = drive_meant(title)
        if found is None:
            name = drive_in_brackets(title)
            if name is not None:
                unreadable[name] = _unknown_unit(f"the unit of {shown(title)!r} is not read", name)
            continue
        name, factor = found
        unit = units.get(title, factor)
        if isinstance(unit, FileFault):
            unreadable[name] = unit
        elif name in meant or name in SWEEPS:
            former = shown(meant[name][0]) if name in meant else name
            unreadable[name] = FileFault(
                "column_twice",
                f"the columns {former!r} and {shown(title)!r} both give {name}",
                "keep one of them",
            )
        else:
            meant[name] = title, unit
    return {name: found for name, found in meant.items() if name not in unreadable}, unreadable


def _unknown_unit(detail: str, name: str) -> FileFault:
    return FileFault("unknown_unit", detail, known_units(name))


def _no_numbers(title: str) -> FileFault:
    return FileFault("not_numbers", f"{shown(title)} does not hold numbers", "give an angle in every row")
