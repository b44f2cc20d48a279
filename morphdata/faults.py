"""What is wrong with a document: one value per fault, with the field and the way out."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Fault:
    """One thing that is wrong in a request.

    Attributes
    ----------
    code : str
        Stable and machine-readable, ``sweep_out_of_range``.
    detail : str
        A sentence for people.
    pointer : str
        JSON pointer (RFC 6901) into the body, or ``#header/Name``, ``#query/name``, ``#path/name``;
        empty: the whole.
    hint : str
        What to do about it.
    """

    code: str
    detail: str
    pointer: str = ""
    hint: str = ""
