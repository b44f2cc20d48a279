"""Standard output and error that take every character, and outlive their readers."""

from __future__ import annotations

import codecs
import io
import os
import sys
import unicodedata
from contextlib import suppress
from typing import IO

from rich.console import Console

SPELT = "morphid-spelt"  # name of the way to write what an encoding lacks
REPLACEABLE = frozenset({"strict", "backslashreplace", "surrogateescape"})  # what streams begin with
WORDS = {
    **dict(zip("φθψαΔ", ("phi", "theta", "psi", "alpha", "Delta"), strict=True)),
    **dict(zip("≤≥±²³→…°", ("<=", ">=", "+-", "^2", "^3", "->", "...", "deg"), strict=True)),
    **dict(zip("×−–—·≈─│µμ“”’", ("x", *'---.~-|uu""\''), strict=True)),
}


def _spelt(error: UnicodeError) -> tuple[str, int]:
    """Write in ASCII what an output's encoding does not have."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join(map(_in_ascii, error.object[error.start : error.end])), error.end


def _in_ascii(character: str) -> str:
    bare = unicodedata.normalize("NFKD", character).encode("ascii", "ignore").decode("ascii")
    return WORDS.get(character) or bare or "?"


codecs.register_error(SPELT, _spelt)


def prepare_streams() -> None:
    """Let standard output and error write every character, in words where their encoding lacks it."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and stream.errors in REPLACEABLE:
            stream.reconfigure(errors=SPELT)


def silence(stream: IO[str]) -> None:
    """Let what is still written to a stream go nowhere, for its reader has left (``morphid ... | head``)."""
    with suppress(OSError, ValueError):  # of a stream without a file
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


def flush_streams() -> None:
    """Write out what is left; at the interpreter's end a reader who has left would be a traceback."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except BrokenPipeError:
            silence(stream)


class Terminal(Console):
    """A console whose reader may leave: the work goes on, files are written, the exit code is the work's."""

    def on_broken_pipe(self) -> None:
        """Print to nowhere from now on."""
        self.quiet = True
        silence(self.file)
