"""The parser process: ``python -m app.parsing.child KIND MEMORY CPU WALL ROWS SAID``, a file on its stdin.

It reads one file, writes one frame (`app.parsing.frame`) and exits. Its parent is `app.parsing.pool`.
"""

from __future__ import annotations

import importlib
import json
import os
import sys
from typing import Any, BinaryIO

from app.errors import MalformedBody
from app.parsing.confinement import Limits, confine, confine_time
from app.parsing.frame import BadFrame, pack
from app.parsing.json_text import parse_json
from morphdata.samplefiles.columns import MAX_DRIVES, Wanted
from morphdata.samplefiles.declared import declared
from morphdata.samplefiles.fault import FileFault
from morphdata.samplefiles.reading import read_columns

BODY = "body"  # the JSON body of a request; any other kind is a file's, from `morphdata.samplefiles.reading`
LOADED_BEFORE = {
    "parquet": ("pyarrow.parquet", "pyarrow.compute"),
    "matlab": ("scipy.io", "scipy.io.matlab", "h5py"),
    "ulog": ("numpy", "pyulog"),
}


def answer(kind: str, stream: BinaryIO, wanted: Wanted) -> dict[str, Any]:
    """Return a file's document or columns, or its fault."""
    try:
        if kind == BODY:
            return {"document": parse_json(stream.read())}
        read = read_columns(stream, kind, wanted)
        unreadable = {name: _words(fault) for name, fault in list(read.unreadable.items())[:MAX_DRIVES]}
        return {
            "columns": read.values,
            "candidates": read.candidates,
            "channels": read.channels,
            "unreadable": unreadable,
        }
    except MalformedBody as error:
        return {"malformed": [error.detail, error.pointer, error.hint]}
    except FileFault as fault:
        return {"fault": _words(fault)}
    except (MemoryError, RecursionError) as error:
        return {"failed": type(error).__name__}


def _words(fault: FileFault) -> list[Any]:
    return [fault.code, fault.detail, fault.hint, fault.row, fault.line, fault.title]


def main(arguments: list[str]) -> None:
    """Read standard input under limits and write a frame."""
    kind, *words, rows, said = arguments
    limits = Limits(*map(int, words))
    confine_time(limits)
    for module in LOADED_BEFORE.get(kind, ()):
        try:
            importlib.import_module(module)
        except ImportError:
            break  # the reader's message says what to install
    confine(limits)
    try:
        wanted = Wanted(max_rows=int(rows), declared=declared(**json.loads(said)))
        frame = pack(answer(kind, sys.stdin.buffer, wanted))
    except BadFrame:
        frame = pack({"failed": "TooMuchText"})
    except (MemoryError, RecursionError) as error:
        frame = pack({"failed": type(error).__name__})
    sys.stdout.buffer.write(frame)
    sys.stdout.buffer.flush()
    os._exit(0)  # the libraries' own clean-up may hang


if __name__ == "__main__":
    main(sys.argv[1:])
