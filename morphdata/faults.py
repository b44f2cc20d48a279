"""What is wrong with a document: one value per fault, and the errors that carry faults."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, Self


@dataclass(frozen=True, slots=True)
class Fault:
    """One thing that is wrong in a document.

    Attributes
    ----------
    code : str
        Stable and machine-readable, ``sweep_out_of_range``.
    detail : str
        A sentence for people.
    pointer : str
        JSON pointer (RFC 6901) into the document, or ``#header/Name``, ``#query/name``, ``#path/name``;
        empty: the whole.
    hint : str
        What to do about it.
    """

    code: str
    detail: str
    pointer: str = ""
    hint: str = ""

    def under(self, pointer: str) -> Fault:
        """Return the same fault of a document that stands at `pointer` in a larger one."""
        return replace(self, pointer=f"{pointer}{self.pointer}") if pointer else self


class Pickled:
    """Makes an exception survive pickling whole, however it is constructed: base of every error of the house.

    Python calls an exception's class with its ``args`` again, which fails for keyword arguments and for
    constructors that write their own sentence; a process pool then hangs.
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
        All of them; left out: one, made of message, pointer and hint.
    """

    code = "invalid_input"

    def __init__(
        self, message: str, *, pointer: str = "", hint: str = "", faults: tuple[Fault, ...] = ()
    ) -> None:
        super().__init__(message, pointer=pointer, hint=hint)
        self.faults = faults or (Fault(self.code, message, pointer, hint),)

    @classmethod
    def of(cls, faults: Iterable[Fault]) -> Self:
        """Return the error of one or more faults."""
        every = tuple(faults)
        first = every[0]
        return cls(first.detail, pointer=first.pointer, hint=first.hint, faults=every)


class Interrupted(Exception):
    """Long work was asked to stop, and has ended between two chunks."""


def refuse(faults: Iterable[Fault]) -> None:
    """Raise InvalidInput that names all of these faults; return where there is none."""
    found = tuple(faults)
    if found:
        raise InvalidInput.of(found)
