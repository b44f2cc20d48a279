"""Comment lines that loggers and programs write into text files."""

from __future__ import annotations

import re

MARKS = ("#", "%", "//")
SEPARATOR = re.compile(r"sep=.?", re.IGNORECASE)  # a line for a spreadsheet
OCTAVE = re.compile(r"[#%]\s*Created by Octave ")


def is_comment(line: str, further: str = "") -> bool:
    """Whether a line is a comment: begins with ``#``, ``%``, ``//`` or a `further` mark.

    >>> is_comment("% by a logger"), is_comment("; units: SI", ";"), is_comment("0,1,2")
    (True, True, False)
    """
    text = line.lstrip(' \t"')
    marks = (*MARKS, further) if further else MARKS
    return text.startswith(marks) or SEPARATOR.fullmatch(text.strip(' \t\r\n"')) is not None


def uncommented(line: str) -> str:
    """What a comment line says, without its mark."""
    return line.lstrip(' \t#%/;"')


def is_octave(head: str) -> bool:
    """Whether a file that begins so is Octave's own text format."""
    return OCTAVE.match(head.lstrip("\ufeff")) is not None
