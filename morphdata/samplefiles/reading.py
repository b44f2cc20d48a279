"""Which reader takes which file."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, BinaryIO

from morphdata.faults import InvalidInput
from morphdata.samplefiles.columns import FlightColumns, Wanted
from morphdata.samplefiles.declared import NOTHING, Declared
from morphdata.samplefiles.fault import FileFault, shown
from morphdata.samplefiles.flight import flight_faults
from morphdata.samplefiles.titles import FLIGHT

ENDINGS = {
    "": "csv",
    ".csv": "csv",
    ".txt": "csv",
    ".json": "json",
    ".parquet": "parquet",
    ".pq": "parquet",
    ".mat": "matlab",
    ".ulg": "ulog",
}
READERS = {
    "csv": "csv_text",
    "json": "json_text",
    "parquet": "parquet_file",
    "matlab": "matlab_file",
    "ulog": "ulog_file",
}
FORMATS = "CSV (.csv), JSON (.json), Parquet (.parquet), MATLAB (.mat) or ULog (.ulg)"


def kind_of(ending: str) -> str:
    """The kind of a file by the ending of its name; FileFault for one that is not read."""
    kind = ENDINGS.get(ending.lower())
    if kind is None:
        raise FileFault("unknown_format", f"{shown(ending)!r} files are not supported", f"give {FORMATS}")
    return kind


def read_columns(stream: BinaryIO, kind: str, wanted: Wanted | None = None) -> FlightColumns:
    """Read the columns of a flight.

    Parameters
    ----------
    stream : open for reading from its beginning, seekable.
    kind : from `kind_of`.
    wanted : the six columns of a flight when left out.

    Raises
    ------
    FileFault : the file is broken, or is not a flight.
    """
    module: Any = importlib.import_module(f"morphdata.samplefiles.{READERS[kind]}")
    columns: FlightColumns = getattr(module, f"read_{kind}")(stream, wanted or Wanted())
    return columns


def read_file(path: Path, names: Sequence[str] = FLIGHT, declared: Declared = NOTHING) -> FlightColumns:
    """Read the named columns of a file, what could be drives, and its further columns of numbers.

    Raises
    ------
    InvalidInput
        The file is missing, is of another kind or broken, a column is missing or holds something that is not
        a finite number.
    """
    try:
        kind = kind_of(path.suffix)
        with path.open("rb") as stream:
            return read_columns(stream, kind, Wanted(names=tuple(names), others=True, declared=declared))
    except FileNotFoundError:
        raise InvalidInput(f"{path} does not exist", hint="check the path") from None
    except OSError as error:
        raise InvalidInput(f"{path} cannot be read: {error}", hint=f"give {FORMATS}") from None
    except FileFault as fault:
        where = f"{path}, {fault.place}" if fault.place else f"{path}"
        raise InvalidInput(f"{where}: {fault.detail}", hint=fault.hint) from None


def place_in(path: Path, columns: FlightColumns, row: int) -> str:
    """Where a row stands, for people."""
    return f"{path}, line {columns.lines[row]}" if len(columns.lines) else f"{path}, row {row}"


def read_flight(path: Path, declared: Declared = NOTHING) -> FlightColumns:
    """Read a file that holds one flight, what could be its drives, and its further columns of numbers.

    Parameters
    ----------
    path : of the file.
    declared : what its owner says about it.

    Raises
    ------
    InvalidInput
        As of `read_file`; or time does not increase, the flight is too long, or an angle is not in rad.
    """
    columns = read_file(path, declared=declared)
    for fault in flight_faults({**columns.values, **columns.drives}):
        place = str(path) if fault.row is None else place_in(path, columns, fault.row)
        raise InvalidInput(f"{place}: {fault.detail}", hint=fault.hint)
    return columns
