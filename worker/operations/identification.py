"""The operation ``identify``: an equivalent model from sample flights."""

from __future__ import annotations

import json
from collections.abc import Iterator

from morphcore.errors import MorphError
from morphcore.export.curves import curve_tables
from morphcore.export.plots import identification_plots
from morphcore.identify import Identification, Interrupted, identification_from_document
from worker.operations import Document, Outcome, Step, Stop, WorkInterrupted, WorkRefused


class IdentificationWork:
    """Identification as the runner sees it.

    Parameters
    ----------
    run : the library's iterator.
    """

    def __init__(self, run: Identification) -> None:
        self._run = run

    def steps(self, checkpoint: bytes | None, stop: Stop) -> Iterator[Step]:
        """Search, generation by generation."""
        try:
            for step in self._run.steps(checkpoint=checkpoint, stop=stop):
                progress = {
                    "fraction": step.fraction,
                    "generation": step.generation,
                    "best_cost": step.best_cost,
                    "flights": step.flights,
                    "phase": step.phase,
                    "message": step.message,
                }
                yield Step(progress=progress, checkpoint=step.checkpoint)
        except Interrupted:
            raise WorkInterrupted from None
        except MorphError as error:
            raise refusal(error) from error

    def outcome(self, checkpoint: bytes) -> Outcome:
        """Give the identified model with its plots and curves."""
        try:
            result = self._run.result(checkpoint)
        except MorphError as error:
            raise refusal(error) from error
        document: Document = result.to_document()
        curves = result.curves()
        artifacts = {
            "result.json": json.dumps(document, indent=1).encode(),
            **identification_plots(document, curves),
            **curve_tables(curves),
        }
        return Outcome(document=document, artifacts=artifacts)

    def best_so_far(self, checkpoint: bytes) -> Outcome:
        """Give the best model found so far, without plots: drawing them takes seconds."""
        document: Document = self._run.best_so_far(checkpoint).to_document()
        return Outcome(document=document, artifacts={"result.json": json.dumps(document, indent=1).encode()})


def begin(request: Document, threads: int) -> IdentificationWork:
    """Check the request and prepare the search.

    Raises
    ------
    WorkRefused : the request cannot be flown.
    """
    try:
        return IdentificationWork(identification_from_document(request, threads=threads))
    except MorphError as error:
        raise refusal(error) from error


def refusal(error: MorphError) -> WorkRefused:
    """Say in the worker's words what the library refused."""
    return WorkRefused(error.code, error.message, pointer=error.pointer, hint=error.hint)
