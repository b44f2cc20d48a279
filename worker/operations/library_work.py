"""Adapter from a search of the library to the work of an operation."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from morphcore.search.checkpoint import UnreadableCheckpoint
from morphcore.stopping import stoppable
from worker.operations import Document, Outcome, Step, Stop

log = logging.getLogger(__name__)

RESULT_FILE = "result.json"
PROGRESS = ("fraction", "generation", "best_cost", "flights", "phase", "message")
BEGUN_AGAIN = ", restarted: the saved state is of another version"


class SearchWork:
    """A search of the library as work.

    Parameters
    ----------
    run
        The library's search, with ``steps(checkpoint, stop)``, ``result(checkpoint)`` and
        ``best_so_far(checkpoint)``.
    files
        ``files(result, document)`` returns plots and tables of a result by name.
    """

    def __init__(self, run: Any, files: Callable[[Any, Document], Mapping[str, bytes]]) -> None:
        self._run = run
        self._files = files
        self._stop: Stop = lambda: False

    def steps(self, checkpoint: bytes | None, stop: Stop) -> Iterator[Step]:
        """Search; restart, with a note, if the checkpoint cannot be read."""
        self._stop = stop
        try:
            for step in self._run.steps(checkpoint=checkpoint, stop=stop):
                yield shown(step)
        except UnreadableCheckpoint:
            log.warning("a checkpoint cannot be read: the search starts again", exc_info=True)
            for step in self._run.steps(stop=stop):
                yield shown(step, BEGUN_AGAIN)

    def outcome(self, checkpoint: bytes, *, files: bool = True) -> Outcome:
        """Return the result, with its plots and tables if wanted; can stop between two flights or plots."""
        with stoppable(self._stop):
            result = self._run.result(checkpoint)
            document = result.to_document()
            drawn = self._files(result, document) if files else {}
            return Outcome(document, {**result_file(document), **drawn})

    def best_so_far(self, checkpoint: bytes) -> Outcome:
        """Return the best result so far, without plots: drawing them takes seconds."""
        document = self._run.best_so_far(checkpoint).to_document()
        return Outcome(document, result_file(document))


def shown(step: Any, note: str = "") -> Step:
    """Convert a step of the library, adding a note to its message."""
    progress = {name: getattr(step, name) for name in PROGRESS}
    return Step({**progress, "message": f"{step.message}{note}"}, step.checkpoint)


def result_file(document: Document) -> dict[str, bytes]:
    """Return the result document as a file."""
    return {RESULT_FILE: json.dumps(document, indent=1).encode()}
