"""The operation ``identify``: an equivalent model from sample flights."""

from __future__ import annotations

from morphcore.export.curves import curve_tables
from morphcore.export.plots import identification_plots
from morphcore.identify import IdentifyResult, identification_from_document
from worker.operations import Document
from worker.operations.library_work import SearchWork, library_errors


def begin(request: Document, threads: int) -> SearchWork[IdentifyResult]:
    """Check the request and prepare the search.

    Raises
    ------
    WorkRefused : the request cannot be flown.
    """
    with library_errors():
        return SearchWork(identification_from_document(request, threads=threads), _files)


def _files(result: IdentifyResult, document: Document) -> dict[str, bytes]:
    curves = result.curves()
    return {**identification_plots(document, curves), **curve_tables(curves)}
