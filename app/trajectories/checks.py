"""Checks of the rows of one flight, by the rules that the library has too."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from app.errors import Fault
from app.schemas.samples import TrajectoryColumns
from samplefiles.fault import FileFault, as_sentence
from samplefiles.flight import INLINE, flight_faults


def columns_faults(columns: TrajectoryColumns, pointer: str) -> list[Fault]:
    """What is wrong with a flight that stands in a JSON document."""
    named = {name: getattr(columns, field) for name, field in INLINE.items()}
    return [
        _fault(fault, f"{pointer}/{INLINE[fault.title]}{_row(fault)}")
        for fault in flight_faults(named, INLINE)
    ]


def file_faults(columns: Mapping[str, Sequence[float]], pointer: str) -> list[Fault]:
    """What is wrong with a flight that came in a file, whose columns are called as in `FLIGHT`."""
    return [
        _fault(fault, f"{pointer}/{INLINE[fault.title]}{_row(fault)}")
        if fault.title == "t"
        else _fault(fault, f"{pointer}{_row(fault)}/{INLINE[fault.title]}")
        for fault in flight_faults(columns)
    ]


def _row(fault: FileFault) -> str:
    return "" if fault.row is None else f"/{fault.row}"


def _fault(fault: FileFault, pointer: str) -> Fault:
    return Fault(fault.code, as_sentence(fault.detail), pointer, as_sentence(fault.hint))
