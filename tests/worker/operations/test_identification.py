"""The operation `identify`, begun again by another worker."""

from __future__ import annotations

from typing import Any

import pytest

from morphcore.identify.identification import VERSION
from tests.identification_request import identification
from tests.worker.operations.jobs_of_the_library import COARSE, RealWorker, undeclared
from worker.attempt import Ending
from worker.operations import find_operation
from worker.operations.identification import IdentificationWork
from worker.operations.library_work import BEGUN_AGAIN


@pytest.mark.parametrize(
    "search",
    [
        {"method": "cma", "particles": 8, "generations": 4, "seed": 3},
        {"method": "pso", "particles": 8, "generations": 4, "seed": 3},
        {"method": "hybrid", "generations": 3},
    ],
    ids=lambda search: str(search["method"]),
)
def test_a_job_goes_on_from_any_checkpoint(search: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever a lost worker had done, the next one ends with the same document, but for wall times.

    Step and corrections are left to the search: the next worker chooses what the first one chose.
    """
    # documents are compared; their pictures take seconds each
    monkeypatch.setattr("worker.operations.identification.identification_plots", lambda *_: {})
    request = identification("train_rate_0.8", links=2, search=search)
    work = find_operation("identify")(request, 1)
    steps = list(work.steps(None, lambda: False))
    assert len(steps) > 3
    outcome = work.outcome(steps[-1].checkpoint)
    assert undeclared(outcome.artifacts, "identify") == []
    whole = outcome.document
    for cut in (0, len(steps) - 2):
        resumed = find_operation("identify")(request, 1)
        *_, last = resumed.steps(steps[cut].checkpoint, lambda: False)
        found = resumed.outcome(last.checkpoint).document
        for part in ("model", "fit", "uncertainty"):
            assert found[part] == whole[part]
        for name in ("history", "flights", "aero_coefficients"):
            assert found["search"][name] == whole["search"][name]


def test_parts_of_another_version_are_not_used() -> None:
    """Costs that answer a checkpoint of another version are dropped: the job begins again."""
    request = identification("train_rate_0.8", links=2, search={"method": "pso", "particles": 32, "seed": 3})
    work = find_operation("identify")(request, 1)
    assert isinstance(work, IdentificationWork)
    step = next(work.steps(None, lambda: False))
    parts = work.tasks(step.checkpoint, 4)
    assert parts is not None
    assert len(parts) == 2
    old = step.checkpoint.replace(VERSION.encode(), b"identification 3")
    assert work.tasks(old, 4) is None
    again = work.combine(old, [work.fly(part, lambda: False) for part in parts], 0.1)
    assert again.progress["phase"] == "baseline"
    assert again.progress["message"].endswith(BEGUN_AGAIN)


def test_a_model_that_flies_nothing_is_a_failed_job(worker: RealWorker) -> None:
    """A wing of 2.1 Pa: the job fails as not flyable, names the wing, and leaves no model."""
    request = identification("train_rate_0.8", links=2, search={"method": "least_squares", "generations": 1})
    request["model"]["lattice"] = COARSE
    request["aircraft"]["surfaces"][0]["material"]["youngs_modulus_pa"] = 2.1
    job_id = worker.add("identify", request)
    assert worker.run() is Ending.FAILED
    job = worker.job(job_id)
    assert job.model_id is None
    error = job.error or {}
    assert error["code"] == "not_flyable"
    assert error["pointer"] == "/aircraft/surfaces/0/material/youngs_modulus_pa"
    assert "right wing" in error["hint"]
    left = worker.result(job_id)
    assert (left["partial"], left["model"]) == (True, None)
    assert left["warnings"][0]["code"] == "not_flyable"
