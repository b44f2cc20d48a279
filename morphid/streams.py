"""Standard output and error that accept every character and survive closed pipes."""

from __future__ import annotations

import codecs
import io
import os
import sys
import unicodedata
from contextlib import suppress
from typing import IO

from rich.console import Console

SPELT = "morphid-spelt"  # name of our handler for characters that an encoding lacks
REPLACEABLE = frozenset(
    {"strict", "backslashreplace", "surrogateescape"}
)  # error handlers that streams start with
WORDS = {
    **dict(zip("φθψαΔ", ("phi", "theta", "psi", "alpha", "Delta"), strict=True)),
    **dict(zip("≤≥±²³→…°", ("<=", ">=", "+-", "^2", "^3", "->", "...", "deg"), strict=True)),
    **dict(zip("×−–—·≈─│µμ“”’", ("x", *'---.~-|uu""\''), strict=True)),
}


def _spelt(error: UnicodeError) -> tuple[str, int]:
    """Spell in ASCII the characters that an output's encoding lacks."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join(map(_in_ascii, error.object[error.start : error.end])), error.end


def _in_ascii(character: str) -> str:
    bare = unicodedata.normalize("NFKD", character).encode("ascii", "ignore").decode("ascii")
    return WORDS.get(character) or bare or "?"


codecs.register_error(SPELT, _spelt)


def prepare_streams() -> None:
    """Make standard output and error accept every character, spelled out if their encoding lacks it."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and stream.errors in REPLACEABLE:
            stream.reconfigure(errors=SPELT)


def silence(stream: IO[str]) -> None:
    """Discard further output to a stream whose reader has left (``morphid ... | head``)."""
    with suppress(OSError, ValueError):  # for a stream without a file
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


def flush_streams() -> None:
    """Flush the streams; at interpreter exit, a closed pipe would cause a traceback."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except BrokenPipeError:
            silence(stream)


class Terminal(Console):
    """A console whose reader may leave: the work continues, files are written, the exit code is its own."""

    def on_broken_pipe(self) -> None:
        """Discard output from now on."""
        self.quiet = True
        silence(self.file)
