"""What is wrong with a file, as one value that the library and the service tell in their own words."""

from __future__ import annotations

from dataclasses import dataclass

from morphdata.faults import Pickled

SHOWN_CHARACTERS = 60  # of a title or cell that a stranger wrote
TITLES = "titles"


def shown(text: object) -> str:
    """A piece of a stranger's text, short, with every character that a terminal would obey escaped."""
    return str(text)[:SHOWN_CHARACTERS].encode("unicode_escape").decode("ascii")


def as_sentence(text: str) -> str:
    """A fault's detail or hint with a full stop and a capital, unless it begins with a field's name."""
    begin = text[:1] if "_" in text.partition(" ")[0] else text[:1].upper()
    return f"{begin}{text[1:]}."


@dataclass(eq=False)
class FileFault(Pickled, Exception):
    """The file cannot be read as a flight.

    Attributes
    ----------
    code : str
        Stable and machine-readable.
    detail : str
        A sentence for people, without the file's name.
    hint : str
        What to do about it.
    row : int or None
        Row of numbers, from 0.
    line : int or None
        Line of a text file on which that row stands, from 1.
    title : str
        The column; `TITLES` when the set of columns is wrong, empty when it is about the whole file.
    """

    code: str
    detail: str
    hint: str
    row: int | None = None
    line: int | None = None
    title: str = ""

    def __str__(self) -> str:
        return self.detail

    @property
    def place(self) -> str:
        """Where in the file, for people: ``line 3``, ``row 2``, or nothing."""
        if self.line is not None:
            return f"line {self.line}"
        return "" if self.row is None else f"row {self.row} (from 0)"


def said_of(fault: FileFault) -> str:
    """What is wrong with a file and where, without the file's name."""
    return f"{fault.detail} ({fault.place})" if fault.place else fault.detail


def octave_text() -> FileFault:
    """The fault of Octave's own text format, which it writes under any name."""
    return FileFault(
        "octave_text",
        "this is an Octave text file",
        "save it from Octave for MATLAB: save -v7 flight.mat t sweep_left sweep_right phi theta psi",
    )
