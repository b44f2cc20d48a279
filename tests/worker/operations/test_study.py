"""The operation `study`, run by a real worker."""

from __future__ import annotations

import csv
import io
from typing import Any

import pytest

from morphdata.faults import MorphError
from morphdata.study import StudyResult
from tests.worker.operations.jobs_of_the_library import RealWorker, study, undeclared
from worker.attempt import Ending
from worker.operations import find_operation

TIMES = {"flight_s", "identify_s", "wall_s", "plan_s", "reason"}  # measured, or a text on measurements


def timeless(document: Any) -> Any:
    """Leave out what is measured."""
    if isinstance(document, dict):
        return {key: timeless(value) for key, value in document.items() if key not in TIMES}
    return [timeless(item) for item in document] if isinstance(document, list) else document


def test_a_study_ends_with_rows_and_a_recommendation(worker: RealWorker) -> None:
    """A row for each number of links, table and picture, and the recommended model as one of the owner's."""
    job_id = worker.add("study", study(2, 1))
    assert worker.run() is Ending.SUCCEEDED, worker.job(job_id).error
    result = StudyResult.model_validate(worker.result(job_id))
    assert [row.links_per_wing for row in result.rows] == [1, 2]
    assert result.recommended.links_per_wing in {1, 2}
    files = worker.files(job_id)
    assert set(files) == {"result.json", "study.csv", "study.svg", "study.png"}
    assert undeclared(files, "study") == []
    assert len(list(csv.reader(io.StringIO(files["study.csv"].decode())))) == 3
    assert worker.job(job_id).model_id is not None


def test_a_study_goes_on_from_its_checkpoint(monkeypatch: pytest.MonkeyPatch) -> None:
    """Begun again in mid-search it ends with the same rows, but for the times that were measured."""
    monkeypatch.setattr("worker.operations.study.study_plots", lambda *_: {})  # take seconds
    request = study(1, 2)
    work = find_operation("study")(request, 1)
    steps = list(work.steps(None, lambda: False))
    resumed = find_operation("study")(request, 1)
    *_, last = resumed.steps(steps[2].checkpoint, lambda: False)
    undisturbed = work.outcome(steps[-1].checkpoint).document
    assert timeless(resumed.outcome(last.checkpoint).document) == timeless(undisturbed)


def test_a_cancelled_study_keeps_its_rows(worker: RealWorker) -> None:
    """Cancelled, it ends within two seconds with the rows so far, partial, and leaves no model."""
    request = study(1, 2, 3)
    request["search"] |= {"particles": 32, "generations": 500}
    job_id = worker.add("study", request)
    ending, took_s = worker.cancelled_after(job_id, fraction=1e-3)
    assert ending is Ending.CANCELLED
    assert took_s < 2.0
    job = worker.job(job_id)
    assert job.partial
    assert job.model_id is None
    result = StudyResult.model_validate(worker.result(job_id))
    assert result.partial
    assert len(result.rows) == 1


def test_a_bad_list_is_refused() -> None:
    """The library's own check of the list reaches the user with its place."""
    with pytest.raises(MorphError) as refused:
        find_operation("study")(study(2, 2), 1)
    assert refused.value.pointer == "/model/links_per_wing/1"
