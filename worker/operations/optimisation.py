"""The operation ``optimize``: the morph schedule that disturbs the attitude least."""

from __future__ import annotations

from morphcore.export.schedule_plots import schedule_plots
from morphcore.export.schedule_tables import schedule_tables
from morphcore.optimise import ScheduleResult, optimisation_from_request
from morphdata.optimize import OptimizeRequest
from worker.operations import Document
from worker.operations.library_work import SearchWork


def begin(request: Document, threads: int) -> SearchWork:
    """Check the request and prepare the searches."""
    return SearchWork(optimisation_from_request(OptimizeRequest.parse(request), threads), _files)


def _files(result: ScheduleResult, document: Document) -> dict[str, bytes]:
    curves = result.curves()
    return {**schedule_plots(document, curves), **schedule_tables(curves)}
