"""The interface between operations and workers.

The descriptor of an operation names a function ``begin(request, threads) -> Work``. Its module is imported on
first use because the pool's parent process must never load the compiler.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any, Protocol, runtime_checkable

from morphdata.faults import MorphError
from morphdata.operations import operation_named

Document = dict[str, Any]
Stop = Callable[[], bool]


@dataclass(frozen=True, slots=True)
class Step:
    """One step of long work.

    ``progress`` has a ``fraction`` (0..1), a ``phase`` and a ``message``; that of a search also
    ``generation``, ``best_cost`` and ``flights``. The ``checkpoint`` is the complete state: work resumed from
    it ends bit-identically. If it is empty, the next attempt starts from the beginning.
    """

    progress: Document
    checkpoint: bytes


@dataclass(frozen=True, slots=True)
class Outcome:
    """The result document of finished or interrupted work, with its files by name."""

    document: Document
    artifacts: Mapping[str, bytes] = field(default_factory=dict)


class Work(Protocol):
    """Long work as an iterator of steps with serialisable state.

    `steps` and `outcome` raise `Interrupted` soon after ``stop()`` returns True, and a `MorphError` if the
    request cannot be carried out.
    """

    def steps(self, checkpoint: bytes | None, stop: Stop) -> Iterator[Step]:
        """Yield one step after another."""

    def outcome(self, checkpoint: bytes, *, files: bool = True) -> Outcome:
        """Return the result at the last step's checkpoint, with its files unless nobody wants them."""

    def best_so_far(self, checkpoint: bytes) -> Outcome | None:
        """Return the result at any checkpoint within a second; None if there is none before the end."""


@runtime_checkable
class SpreadWork(Work, Protocol):
    """Work whose steps can be computed in parts by several workers."""

    def tasks(self, checkpoint: bytes, max_parts: int) -> list[bytes] | None:
        """Divide the step after a checkpoint into independent parts; None if it cannot be divided."""

    def fly(self, task: bytes, stop: Stop) -> bytes:
        """Return the outcome of one part, independent of the worker and of the other parts."""

    def combine(self, checkpoint: bytes, outcomes: Sequence[bytes], elapsed_s: float) -> Step:
        """Return the step after a checkpoint from the outcomes of all its parts, in order."""


Begin = Callable[[Document, int], Work]


class UnknownOperation(MorphError):
    """This worker does not know the operation of a job; a newer worker may."""

    code = "unknown_operation"


def find_operation(name: str) -> Begin:
    """Import the function that starts an operation; raise `UnknownOperation` if there is none."""
    try:
        operation = operation_named(name)
    except LookupError as error:
        raise UnknownOperation(f"this worker cannot run it: {error}", hint="update the workers") from None
    module, _, function = operation.begin.partition(":")
    begin: Begin = getattr(import_module(module), function)
    return begin
