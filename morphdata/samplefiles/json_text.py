"""Flights as JSON: one object of lists, ``{"t": [...], "theta_deg": [...], ...}``."""

from __future__ import annotations

import json
import math
import sys
from array import array
from dataclasses import replace
from typing import Any, BinaryIO

from morphdata.faults import InvalidInput
from morphdata.samplefiles.cells import Clock, Numbers
from morphdata.samplefiles.channel_titles import channel_meant
from morphdata.samplefiles.columns import (
    FlightColumns,
    Wanted,
    column_in_si,
    equally_long,
    further_column,
    gathered,
    not_finite,
)
from morphdata.samplefiles.comments import is_comment, is_octave
from morphdata.samplefiles.declared import NOTHING, declared
from morphdata.samplefiles.fault import TITLES, FileFault, octave_text, shown
from morphdata.samplefiles.frames import HERE
from morphdata.samplefiles.titles import chosen

HINT = 'give one object of lists: {"t": [0.0, 0.01], "sweep_left": [...], ...}'


def read_json(stream: BinaryIO, wanted: Wanted) -> FlightColumns:
    """Read an object whose fields are the columns; the form of a sample inline in a request is one.

    Raises
    ------
    FileFault : naming field and row.
    """
    document = _parsed(stream.read())
    if not isinstance(document, dict):
        raise FileFault("not_an_object", "the JSON text is not an object", HINT)
    wanted = _with_frames(document, wanted)
    document = _as_called(document, wanted)
    titles = list(document)
    found = chosen(titles, wanted.names, wanted.optional)
    names = {name: titles[position] for name, (position, _) in found.items()}
    values = {}
    for name, title in names.items():
        items = document[title]
        if not isinstance(items, list):
            raise FileFault("list_type", f"{shown(title)} is not a list", HINT, title=title)
        if len(items) > wanted.max_rows:
            raise wanted.too_many_rows()
        if name == "t" and items and isinstance(items[0], str):
            items = _dates(items, title)
        for row, item in enumerate(items):
            if not _is_number(item):
                raise not_finite(title, item, row)
        values[name] = column_in_si(name, items, found[name][1], title)
    columns = equally_long(FlightColumns(values), names)
    rows = len(values[wanted.names[0]])
    further = [title for title in titles if title not in names.values() and isinstance(document[title], list)]
    faults = {}
    for title in wanted.further(further):
        try:
            columns.others[title] = _column_of_numbers(title, document[title], rows)
        except FileFault as fault:
            faults[title] = fault
    return gathered(wanted, further, columns, faults=faults)


def _with_frames(document: dict[str, Any], wanted: Wanted) -> Wanted:
    """What is wanted, in the axes that the document itself declares as an inline sample does."""
    axes = document.get("frames")
    if axes is None:
        return wanted
    try:
        if not set(axes) <= {"earth", "body"}:
            raise TypeError("it has other fields")  # noqa: TRY301
        own = declared(**axes).frames
    except (InvalidInput, TypeError, AttributeError) as error:
        hint = 'give {"earth": "NED" or "ENU", "body": "FRD" or "FLU"}'
        raise FileFault("unknown_frames", f"frames cannot be read: {shown(error)}", hint) from None
    if wanted.declared.frames not in (HERE, own):
        detail = "the axes in frames are not those that are declared for the file"
        raise FileFault("two_frames", detail, "declare them once")
    return replace(wanted, declared=replace(wanted.declared, frames=own))


def _as_called(document: dict[str, Any], wanted: Wanted) -> dict[str, Any]:
    """The document with its columns under the names that were declared."""
    if wanted.declared == NOTHING:
        return document
    called = wanted.called(document)
    twice = next((name for name in called if name and called.count(name) > 1), None)
    if twice is not None:
        detail = f"{shown(twice)} is given and declared, too"
        raise FileFault("column_twice", detail, "keep one of them", title=TITLES)
    return dict(zip(called, document.values(), strict=True))


def _dates(items: list[Any], title: str) -> list[float]:
    """Times, s, of dates (ISO 8601), from the first one."""
    clock = Clock(1.0, Numbers())
    times = []
    for row, item in enumerate(items):
        time_s = clock.read(item) if isinstance(item, str) and ":" in item else math.nan
        if not math.isfinite(time_s):
            raise not_finite(title, item, row)
        times.append(time_s)
    return times


def _column_of_numbers(title: str, items: list[Any], rows: int) -> array[float]:
    if len(items) != rows:
        detail = f"{shown(title)} has {len(items)} rows, time has {rows}"
        raise FileFault("unequal_lengths", detail, "give equal lengths", title=title)
    gaps = channel_meant(title) is not None
    for row, item in enumerate(items):
        if not _is_number(item) and not (gaps and item is None):
            raise not_finite(title, item, row)
    return further_column(items, title)


def _is_number(item: object) -> bool:
    # an integer beyond the floats would overflow
    return isinstance(item, float) or (
        isinstance(item, int) and not isinstance(item, bool) and abs(item) <= sys.float_info.max
    )


def _parsed(data: bytes) -> Any:
    try:
        text = data.decode(json.detect_encoding(data)).removeprefix("\ufeff")
    except UnicodeDecodeError:
        raise FileFault("not_json", "the text is not UTF-8", "save it in UTF-8") from None
    if data and not text:
        raise FileFault("not_json", "the text is not UTF-8", "save it in UTF-8")
    if is_octave(text):
        raise octave_text()
    try:
        # no line inside a JSON text begins like a comment: a string cannot go on in the next line
        lines = (
            "" if is_comment(line) and not line.lstrip().startswith('"') else line
            for line in text.split("\n")
        )
        return json.loads("\n".join(lines), object_pairs_hook=_object)
    except json.JSONDecodeError as error:
        raise FileFault("not_json", f"this is not JSON: {error.msg} in line {error.lineno}", HINT) from None
    except RecursionError:
        raise FileFault("not_json", "the text is nested too deeply", HINT) from None
    except ValueError as error:  # an integer of thousands of digits
        raise FileFault("not_json", f"this is not JSON: {str(error)[:80]}", "shorten the number") from None


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    document = dict(pairs)
    if len(document) != len(pairs):
        keys = [key for key, _ in pairs]
        seen: set[str] = set()
        twice = next(key for key in keys if key in seen or seen.add(key))  # type: ignore[func-returns-value]
        raise FileFault("column_twice", f"the key {shown(twice)!r} appears twice", "keep one of them")
    return document
