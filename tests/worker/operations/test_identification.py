"""The operation `identify`, begun again by another worker."""

from __future__ import annotations

from typing import Any

import pytest

from tests.identification_request import identification
from worker.operations import find_operation


@pytest.mark.parametrize(
    "search",
    [
        {"method": "cma", "particles": 8, "generations": 4, "seed": 3},
        {"method": "pso", "particles": 8, "generations": 4, "seed": 3},
        {"method": "hybrid", "generations": 3},
    ],
    ids=lambda search: str(search["method"]),
)
def test_a_job_goes_on_from_any_checkpoint(search: dict[str, Any]) -> None:
    """Whatever a lost worker had done, the next one ends with the same document, but for wall times.

    Step and corrections are left to the search: the next worker chooses what the first one chose.
    """
    request = identification("train_rate_0.8", links=2, search=search)
    work = find_operation("identify")(request, 1)
    steps = list(work.steps(None, lambda: False))
    assert len(steps) > 3
    whole = work.outcome(steps[-1].checkpoint).document
    for cut in (0, len(steps) - 2):
        resumed = find_operation("identify")(request, 1)
        *_, last = resumed.steps(steps[cut].checkpoint, lambda: False)
        found = resumed.outcome(last.checkpoint).document
        for part in ("model", "fit", "uncertainty"):
            assert found[part] == whole[part]
        for name in ("history", "flights", "aero_coefficients"):
            assert found["search"][name] == whole["search"][name]
