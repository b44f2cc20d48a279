"""The operation ``study``: equivalent models of several sizes from the same sample flights."""

from __future__ import annotations

from morphcore.export.study_plots import study_plots, study_table
from morphcore.identify.study import study_from_request
from morphcore.identify.study_result import StudyResult
from morphdata.study import StudyRequest
from worker.operations import Document
from worker.operations.library_work import SearchWork


def begin(request: Document, threads: int) -> SearchWork:
    """Check the request and prepare the searches."""
    return SearchWork(study_from_request(StudyRequest.parse(request), threads), _files)


def _files(_result: StudyResult, document: Document) -> dict[str, bytes]:
    return {**study_plots(document), "study.csv": study_table(document)}
