"""The work of the operations: what each has to offer a worker, and where it begins.

The descriptor of an operation names a function ``begin(request, threads) -> Work``. Its module is imported
on first use, so that the pool's parent process never loads the compiler; for the same reason such modules
translate the library's errors.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any, Protocol, runtime_checkable

from morphdata.faults import Pickled
from morphdata.operations import operation_named

Document = dict[str, Any]
Stop = Callable[[], bool]


class WorkInterrupted(Exception):
    """The work saw its stop signal and ended between two chunks; the last step's checkpoint holds."""


class WorkRefused(Pickled, Exception):
    """The work cannot be done as requested; carries what the user is told.

    Parameters
    ----------
    code : stable, for programs.
    detail : a sentence.
    pointer : JSON pointer to the field at fault, "" for the whole.
    hint : what to do about it.
    """

    def __init__(self, code: str, detail: str, *, pointer: str = "", hint: str = "") -> None:
        super().__init__(detail)
        self.code = code
        self.detail = detail
        self.pointer = pointer
        self.hint = hint


@dataclass(frozen=True, slots=True)
class Step:
    """One step of long work.

    Parameters
    ----------
    progress : what the user sees: ``fraction`` (0..1), ``phase`` and ``message``; of a search also
        ``generation``, ``best_cost`` and ``flights``.
    checkpoint : complete state; work begun from it goes on to the bit-identical end. Empty where there is
        nothing to go on from: the next attempt begins anew.
    """

    progress: Document
    checkpoint: bytes


@dataclass(frozen=True, slots=True)
class Outcome:
    """What finished (or interrupted) work leaves behind.

    Parameters
    ----------
    document : the result, in the names that API.md fixes.
    artifacts : file name -> content.
    """

    document: Document
    artifacts: Mapping[str, bytes] = field(default_factory=dict)


class Work(Protocol):
    """Long work as an iterator of steps with serialisable state."""

    def steps(self, checkpoint: bytes | None, stop: Stop) -> Iterator[Step]:
        """Give one step after another.

        Raises
        ------
        WorkInterrupted : soon after ``stop()`` turned true.
        WorkRefused : what was asked cannot be done.
        """

    def outcome(self, checkpoint: bytes) -> Outcome:
        """Give the result at the last step's checkpoint, with everything that belongs to it.

        Raises
        ------
        WorkInterrupted : soon after the ``stop()`` of the steps turned true.
        """

    def best_so_far(self, checkpoint: bytes) -> Outcome | None:
        """Give the result at any checkpoint, within a second: someone waits for the job to end.

        None for work that has nothing to show before its end.
        """


@runtime_checkable
class SpreadWork(Work, Protocol):
    """Work whose steps other workers can take part in."""

    def tasks(self, checkpoint: bytes, most: int) -> list[bytes] | None:
        """Give what the step after a checkpoint needs, in at most so many parts that fly on their own.

        None where that step is not made of such parts.
        """

    def fly(self, task: bytes, stop: Stop) -> bytes:
        """Give the outcome of one part, the same whoever flies it and whatever else it flies.

        Raises
        ------
        WorkInterrupted : soon after ``stop()`` turned true.
        """

    def told(self, checkpoint: bytes, outcomes: Sequence[bytes], elapsed_s: float) -> Step:
        """Give the step after a checkpoint from the outcomes of all its parts, in their order."""


Begin = Callable[[Document, int], Work]


class UnknownOperation(Pickled, LookupError):
    """This worker does not know the operation of a job; a newer one may."""


def find_operation(name: str) -> Begin:
    """Import the function that begins an operation.

    Raises
    ------
    UnknownOperation : no such operation.
    """
    try:
        operation = operation_named(name)
    except LookupError as error:
        raise UnknownOperation(f"this worker cannot run it: {error}") from None
    module, _, function = operation.begin.partition(":")
    begin: Begin = getattr(import_module(module), function)
    return begin
