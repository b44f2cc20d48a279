"""Checks of the rows of one flight, by the rules that the library has too."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from morphdata.faults import Fault
from morphdata.samplefiles.fault import FileFault, as_sentence
from morphdata.samplefiles.flight import INLINE, flight_faults
from morphdata.samples import TrajectoryColumns


def columns_faults(columns: TrajectoryColumns, pointer: str) -> list[Fault]:
    """What is wrong with a flight that stands in a JSON document."""
    named = {name: getattr(columns, field) for name, field in INLINE.items()}
    return [
        _fault(fault, f"{pointer}/{INLINE[fault.title or 't']}{_row(fault)}")
        for fault in flight_faults(named, INLINE)
    ]


def file_faults(columns: Mapping[str, Sequence[float]], pointer: str) -> list[Fault]:
    """What is wrong with a flight that came in a file, whose columns are called as in `FLIGHT`."""
    return [_fault(fault, f"{pointer}{_place(fault)}") for fault in flight_faults(columns)]


def _place(fault: FileFault) -> str:
    """Where in a file: a time by its column, an angle by its row."""
    column = f"/{INLINE[fault.title]}" if fault.title else ""
    return f"{column}{_row(fault)}" if fault.title == "t" else f"{_row(fault)}{column}"


def _row(fault: FileFault) -> str:
    return "" if fault.row is None else f"/{fault.row}"


def _fault(fault: FileFault, pointer: str) -> Fault:
    return Fault(fault.code, as_sentence(fault.detail), pointer, as_sentence(fault.hint))
