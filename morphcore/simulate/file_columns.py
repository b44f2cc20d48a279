"""Columns of files by name, as arrays: CSV, JSON, Parquet or MATLAB, told by the ending of the name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from morphcore.errors import InvalidInput
from morphdata.samplefiles.columns import Wanted
from morphdata.samplefiles.fault import FileFault
from morphdata.samplefiles.reading import FORMATS, kind_of, read_columns

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FileColumns:
    """Columns of a file, each (k,), read-only.

    Attributes
    ----------
    path : the file.
    values : the columns that were asked for, SI units.
    others : further columns of numbers under their own titles, units as they are.
    lines : of a text file the line of each row; else empty.
    """

    path: Path
    values: dict[str, Array]
    others: dict[str, Array]
    lines: Sequence[int]

    def place(self, row: int) -> str:
        """Where a row stands, for people."""
        return f"{self.path}, line {self.lines[row]}" if len(self.lines) else f"{self.path}, row {row}"


def read_file_columns(path: str | Path, names: Sequence[str]) -> FileColumns:
    """Read the named columns of a file, and its further columns of numbers.

    Raises
    ------
    InvalidInput : the file is missing, is of another kind or broken, a column is missing or holds something
        that is not a finite number.
    """
    path = Path(path)
    try:
        kind = kind_of(path.suffix)
        with path.open("rb") as stream:
            found = read_columns(stream, kind, Wanted(names=tuple(names), others=True))
    except FileNotFoundError:
        raise InvalidInput(f"{path} does not exist", hint="check the path") from None
    except OSError as error:
        raise InvalidInput(f"{path} cannot be read: {error}", hint=f"give {FORMATS}") from None
    except FileFault as fault:
        where = f"{path}, {fault.place}" if fault.place else f"{path}"
        raise InvalidInput(f"{where}: {fault.detail}", hint=fault.hint) from None
    return FileColumns(
        path=path,
        values={name: _read_only(column) for name, column in found.values.items()},
        others={title: _read_only(column) for title, column in found.others.items()},
        lines=found.lines,
    )


def _read_only(column: Sequence[float]) -> Array:
    values = np.array(column, dtype=np.float64)
    values.setflags(write=False)
    return values
