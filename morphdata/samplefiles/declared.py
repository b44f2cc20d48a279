"""What the owner of a file declares about it: axes, the order of a quaternion, which columns are which."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

from morphdata.faults import InvalidInput
from morphdata.samplefiles.channel_titles import channel_meant
from morphdata.samplefiles.fault import FileFault, shown
from morphdata.samplefiles.frames import QUATERNION, Body, Earth, Frames
from morphdata.samplefiles.titles import ATTITUDE, NUMBERED, drive_meant, meaning
from morphdata.samplefiles.units import plain

QuaternionOrder = Literal["wxyz", "xyzw"]
NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
SOURCE = re.compile(rf"(?P<title>.+?)(?:\*(?P<scale>[+-]?{NUMBER}))?(?P<offset>[+-]{NUMBER})?")
MAX_COLUMNS = 200  # that are declared
LONGEST_SOURCE = 300
HINT = "write NAME=TITLE, NAME=TITLE*SCALE or NAME=TITLE*SCALE+OFFSET: sweep_left_deg=servo_1*0.09-45"


@dataclass(frozen=True)
class Source:
    """The column of a file that gives one of ours: ``scale * column + offset``.

    Attributes
    ----------
    title : str
        Of the file's column.
    scale, offset : float
        In the unit that our name ends in (``sweep_left_deg``), SI where it names none.
    """

    title: str
    scale: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class Declared:
    """What is declared about a file.

    Attributes
    ----------
    frames : Frames
        Axes of its attitude and channels.
    quaternion : {"wxyz", "xyzw"} or None
        Order of quaternions in columns that are numbered, ``q0`` to ``q3``.
    columns : mapping of str to Source
        Columns by the names they shall have, with a unit or without (``theta_deg``, ``sweep_left``).
    between : tuple of float, optional
        First and last time of the rows that are used, s; of the file's clock, or since the first row where
        this counts from an epoch.
    """

    frames: Frames = field(default_factory=Frames)
    quaternion: QuaternionOrder | None = None
    columns: Mapping[str, Source] = field(default_factory=dict)
    between: tuple[float, float] | None = None

    def called(self, title: str) -> str:
        """What a column of the file is called here; "" if another one was declared in its place."""
        for name, source in self.columns.items():
            if title == source.title or plain(title) == plain(source.title):
                return name
        numbered = NUMBERED.fullmatch(plain(title))
        if numbered and self.quaternion is not None:
            return f"q{self.quaternion[int(numbered[1])]}"
        return "" if self.columns and _column_of(title) in self._declared_columns() else title

    def require_found(self, titles: Sequence[str]) -> None:
        """Raise FileFault where a declared column is not among the titles of a file."""
        known = {plain(title) for title in titles}
        for name, source in self.columns.items():
            if plain(source.title) not in known:
                listed = ", ".join(shown(title) for title in titles[:20] if title)
                raise FileFault(
                    "missing",
                    f"there is no column {shown(source.title)!r}, which was declared to be {name}",
                    f"the file has {listed}" if listed else "check the name",
                )

    def affine(self, column: str) -> tuple[float, float] | None:
        """Scale and offset, SI, of one of our columns (``sweep_left``); None where there are none."""
        for name, source in self.columns.items():
            if _column_of(name) == column:
                offset = source.offset * (_factor_of(name) or 1.0)
                return None if (source.scale, offset) == (1.0, 0.0) else (source.scale, offset)
        return None

    def _declared_columns(self) -> set[str | None]:
        return {_column_of(name) for name in self.columns}


NOTHING = Declared()


def declared(
    earth: str = "NED",
    body: str = "FRD",
    quaternion: str | None = None,
    columns: Mapping[str, str] | None = None,
    between: Sequence[float] | None = None,
) -> Declared:
    """Check what a user declares about a file.

    Parameters
    ----------
    earth : str
        ``NED`` or ``ENU``, in any case.
    body : str
        ``FRD`` or ``FLU``.
    quaternion : str, optional
        Order of the columns ``q0`` to ``q3``: ``wxyz`` or ``xyzw``.
    columns : mapping of str to str, optional
        Title of the file's column by the name it shall have, with scale and offset: ``servo_1*0.09-45``.
    between : pair of float, optional
        First and last time of the rows that are used, s.

    Raises
    ------
    InvalidInput
        At ``/earth``, ``/body``, ``/quaternion``, ``/columns/NAME`` or ``/between``.

    Examples
    --------
    >>> declared("enu", columns={"sweep_left_deg": "servo_1*0.09-45"}).columns["sweep_left_deg"]
    Source(title='servo_1', scale=0.09, offset=-45.0)
    """
    words: Any = {"earth": _one_of(earth, Earth, "earth"), "body": _one_of(body, Body, "body")}
    order: Any = None if quaternion is None else _one_of(quaternion, QuaternionOrder, "quaternion")
    given = columns or {}
    if len(given) > MAX_COLUMNS:
        raise InvalidInput(
            f"{len(given)} columns are declared", pointer="/columns", hint=f"at most {MAX_COLUMNS} can be"
        )
    sources = {name: _source(name, text) for name, text in given.items()}
    names = [_column_of(name) for name in sources]
    if len(set(names)) != len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InvalidInput(f"{twice} is declared twice", pointer="/columns", hint="keep one of them")
    return Declared(Frames(**words), order, sources, _window(between))


def _window(between: Sequence[float] | None) -> tuple[float, float] | None:
    if between is None:
        return None
    try:
        begin, end = map(float, between)
    except (TypeError, ValueError):
        begin = end = math.nan
    if not (math.isfinite(begin) and math.isfinite(end) and begin < end):
        hint = "give two times in s, the earlier first"
        raise InvalidInput(f"{shown(between)} is no window of time", pointer="/between", hint=hint)
    return begin, end


def _one_of(given: str, choices: Any, name: str) -> str:
    for choice in get_args(choices):
        if given.lower() == choice.lower():
            return str(choice)
    known = " or ".join(get_args(choices))
    raise InvalidInput(f"{name} is {shown(given)!r}", pointer=f"/{name}", hint=f"give {known}")


def _source(name: str, text: str) -> Source:
    pointer = f"/columns/{shown(name).replace('~', '~0').replace('/', '~1')}"
    if _column_of(name) is None:
        hint = (
            "give t, phi, theta, psi, qw to qz, a drive or a channel, with a unit or without: sweep_left_deg"
        )
        raise InvalidInput(f"{shown(name)!r} is no column of a sample", pointer=pointer, hint=hint)
    match = SOURCE.fullmatch(text) if len(text) <= LONGEST_SOURCE else None
    if match is None:
        raise InvalidInput(f"{name}={shown(text)} names no column", pointer=pointer, hint=HINT)
    return Source(match["title"], float(match["scale"] or 1.0), float(match["offset"] or 0.0))


def _column_of(name: str) -> str | None:
    """The column that a name means, without its unit; None where it means none."""
    found = meaning(name, (*ATTITUDE, *QUATERNION)) or channel_meant(name) or drive_meant(name)
    return None if found is None else found[0]


def _factor_of(name: str) -> float | None:
    found = meaning(name, (*ATTITUDE, *QUATERNION)) or channel_meant(name) or drive_meant(name)
    return None if found is None else found[1]
