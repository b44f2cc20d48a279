"""Which reader takes which file."""

from __future__ import annotations

import importlib
from typing import Any, BinaryIO

from morphdata.samplefiles.columns import FlightColumns, Wanted
from morphdata.samplefiles.fault import FileFault, shown

ENDINGS = {
    "": "csv",
    ".csv": "csv",
    ".txt": "csv",
    ".json": "json",
    ".parquet": "parquet",
    ".pq": "parquet",
    ".mat": "matlab",
}
READERS = {"csv": "csv_text", "json": "json_text", "parquet": "parquet_file", "matlab": "matlab_file"}
FORMATS = "CSV (.csv), JSON (.json), Parquet (.parquet) or MATLAB (.mat, saved with -v7)"


def kind_of(ending: str) -> str:
    """The kind of a file by the ending of its name; FileFault for one that is not read."""
    kind = ENDINGS.get(ending.lower())
    if kind is None:
        raise FileFault(
            "unknown_format", f"files of the kind {shown(ending)!r} are not read", f"give {FORMATS}"
        )
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
