"""A run of the library as the runner sees it: one adapter for every operation, and the library's errors."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Generic, Protocol, TypeVar

from morphcore.errors import MorphError
from morphcore.search.checkpoint import UnreadableCheckpoint
from morphcore.stopping import Interrupted, stoppable
from worker.operations import Document, Outcome, Step, Stop, WorkInterrupted, WorkRefused

log = logging.getLogger(__name__)

RESULT_FILE = "result.json"
PROGRESS = ("fraction", "generation", "best_cost", "flights", "phase", "message")
BEGUN_AGAIN = ", begun again: what was saved is of another version"


class LibraryResult(Protocol):
    """What a run of the library ends in."""

    def to_document(self) -> Document:
        """Give the result in the names that API.md fixes."""
        ...


Result = TypeVar("Result", bound=LibraryResult)
Result_co = TypeVar("Result_co", bound=LibraryResult, covariant=True)


class LibraryRun(Protocol[Result_co]):
    """A search of the library: steps with checkpoints, and the result at any of them."""

    def steps(self, checkpoint: bytes | None = None, stop: Stop | None = None) -> Iterator[Any]:
        """Search; each step has the fields `PROGRESS` and its ``checkpoint``."""
        ...

    def result(self, checkpoint: bytes) -> Result_co:
        """Give the result with everything that belongs to it."""
        ...

    def best_so_far(self, checkpoint: bytes) -> Result_co:
        """Give the result without what takes long."""
        ...


class SearchWork(Generic[Result]):
    """A search of the library as work.

    Parameters
    ----------
    run : the library's iterator.
    files : draws plots and tables of a result (result, its document) -> file name -> content.
    """

    def __init__(
        self, run: LibraryRun[Result], files: Callable[[Result, Document], Mapping[str, bytes]]
    ) -> None:
        self._run = run
        self._files = files
        self._stop: Stop = never

    def steps(self, checkpoint: bytes | None, stop: Stop) -> Iterator[Step]:
        """Search, step by step; from the start, with a note, where the checkpoint cannot be read."""
        self._stop = stop
        with library_errors():
            try:
                for step in self._run.steps(checkpoint=checkpoint, stop=stop):
                    yield shown(step)
            except UnreadableCheckpoint:
                log.warning("a checkpoint cannot be read: the search begins again", exc_info=True)
                for step in self._run.steps(stop=stop):
                    yield shown(step, BEGUN_AGAIN)

    def outcome(self, checkpoint: bytes) -> Outcome:
        """Give the result with its plots and tables.

        Raises
        ------
        WorkInterrupted : the stop signal of the steps, between two flights or pictures.
        """
        with library_errors(), stoppable(self._stop):
            result = self._run.result(checkpoint)
            document = result.to_document()
            return Outcome(document, {**result_file(document), **self._files(result, document)})

    def best_so_far(self, checkpoint: bytes) -> Outcome:
        """Give the best found so far, without plots: drawing them takes seconds."""
        document = self._run.best_so_far(checkpoint).to_document()
        return Outcome(document, result_file(document))


def shown(step: Any, note: str = "") -> Step:
    """Give a step of the library as the runner sees it, with a note in its message."""
    progress = {name: getattr(step, name) for name in PROGRESS}
    return Step({**progress, "message": f"{step.message}{note}"}, step.checkpoint)


def never() -> bool:
    """Tell that nobody asked to stop."""
    return False


def result_file(document: Document) -> dict[str, bytes]:
    """Give the result as a file beside the plots."""
    return {RESULT_FILE: json.dumps(document, indent=1).encode()}


@contextmanager
def library_errors() -> Iterator[None]:
    """Say in the worker's words what the library refused or broke off.

    Raises
    ------
    WorkInterrupted : the library saw its stop signal.
    WorkRefused : what was asked cannot be done.
    """
    try:
        yield
    except Interrupted:
        raise WorkInterrupted from None
    except MorphError as error:
        raise WorkRefused(error.code, error.message, pointer=error.pointer, hint=error.hint) from error
