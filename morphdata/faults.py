"""Faults of documents, and the errors that carry them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, Self


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault of a document.

    Attributes
    ----------
    code : str
        Stable and machine-readable, ``sweep_out_of_range``.
    detail : str
        A human-readable sentence.
    pointer : str
        JSON pointer (RFC 6901) into the document, or ``#header/Name``, ``#query/name``, ``#path/name``;
        empty: the whole document.
    hint : str
        What to do about it.
    """

    code: str
    detail: str
    pointer: str = ""
    hint: str = ""

    def under(self, pointer: str) -> Fault:
        """Return the same fault for a document located at `pointer` in a larger one."""
        return replace(self, pointer=f"{pointer}{self.pointer}") if pointer else self


class Pickled:
    """Base of all our errors: makes an exception survive pickling, however it is constructed.

    To unpickle an exception, Python calls its class with its ``args``, which fails for keyword arguments and
    for constructors that compose their own message; a process pool then hangs.
    """

    args: tuple[Any, ...]

    def __reduce__(self) -> tuple[Any, ...]:
        return _remade, (type(self), self.args, dict(vars(self)))


def _remade(kind: type[BaseException], args: tuple[Any, ...], data: dict[str, Any]) -> BaseException:
    error = kind.__new__(kind, *args)
    error.args = args
    vars(error).update(data)
    return error


class MorphError(Pickled, Exception):
    """Base of all errors about documents, and of those that the numeric library raises.

    Parameters
    ----------
    message : str
        What is wrong, as a sentence.
    pointer : str
        JSON pointer (RFC 6901) to the field at fault in the input document, "" for the whole.
    hint : str
        What the user can do about it.
    """

    code = "error"

    def __init__(self, message: str, *, pointer: str = "", hint: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.pointer = pointer
        self.hint = hint

    def __str__(self) -> str:
        where = f"{self.pointer}: " if self.pointer else ""
        hint = f" ({self.hint})" if self.hint else ""
        return f"{where}{self.message}{hint}"


class InvalidInput(MorphError):
    """Fields of the input are missing, malformed, out of range or in contradiction.

    Parameters
    ----------
    message, pointer, hint : str
        Of the first fault.
    faults : tuple of Fault
        All faults; default: one, made from message, pointer and hint.
    """

    code = "invalid_input"

    def __init__(
        self, message: str, *, pointer: str = "", hint: str = "", faults: tuple[Fault, ...] = ()
    ) -> None:
        super().__init__(message, pointer=pointer, hint=hint)
        self.faults = faults or (Fault(self.code, message, pointer, hint),)

    @classmethod
    def of(cls, faults: Iterable[Fault]) -> Self:
        """Return the error for one or more faults."""
        every = tuple(faults)
        first = every[0]
        return cls(first.detail, pointer=first.pointer, hint=first.hint, faults=every)


class Interrupted(Exception):
    """Long work stopped on request, between two chunks."""


def refuse(faults: Iterable[Fault]) -> None:
    """Raise InvalidInput with all of these faults; return if there are none."""
    found = tuple(faults)
    if found:
        raise InvalidInput.of(found)
