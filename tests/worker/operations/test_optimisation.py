"""The operation `optimize`, run by a real worker."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from morphcore.simulate.schedule import scheduled
from morphdata.faults import MorphError
from morphdata.optimize import OptimizeResult
from morphdata.schedules import load_schedules
from tests.worker.operations.jobs_of_the_library import COARSE, RealWorker, optimisation, undeclared
from tests.worker.operations.test_study import timeless
from worker.attempt import Ending
from worker.operations import find_operation

TABLES = {"schedule.csv", "schedules.csv", "departures.csv"}
PICTURES = {f"{name}.{kind}" for name in ("schedules", "departures") for kind in ("svg", "png")}


def test_an_optimisation_ends_with_a_comparison(worker: RealWorker, tmp_path: Path) -> None:
    """The documented result with the schedule within its limit, and a schedule file that can be flown."""
    job_id = worker.add("optimize", optimisation())
    assert worker.run() is Ending.SUCCEEDED, worker.job(job_id).error
    result = OptimizeResult.model_validate(worker.result(job_id))
    assert not result.partial
    assert result.variation.optimum.equivalent is not None
    assert result.variation.constant.equivalent is not None
    assert result.variation.optimum.equivalent <= result.variation.constant.equivalent
    assert result.variation.optimum.flexible is None
    files = worker.files(job_id)
    assert set(files) == {"result.json", *TABLES, *PICTURES}
    assert undeclared(files, "optimize") == []
    path = tmp_path / "schedule.csv"
    path.write_bytes(files["schedule.csv"])
    given = load_schedules(path).given.get("sweep_left")
    assert given is not None
    left = scheduled(given)
    assert np.allclose(left.motion([0.0, 0.8, 1.0]).angle, [0.0, 0.5, 0.5])
    rates = left.motion(np.linspace(0.0, 1.0, 501)).rate
    # the table is interpolated where the spline was exact: 2 per cent where the rate changes
    assert rates.max() <= 1.2 * 1.02
    titles = next(csv.reader(io.StringIO(files["departures.csv"].decode())))
    assert "rigid_optimum_in_equivalent_theta_rad" in titles
    assert worker.job(job_id).model_id is None


def test_schedules_are_flown_in_the_flexible_model(worker: RealWorker) -> None:
    """With verification every schedule is flown in the flexible model too, and judged there."""
    morph = {"final_rad": 0.3, "duration_s": 0.4, "knots": 3, "settle_s": 0.1}
    request = optimisation(morph=morph, verify="flexible", flexible={"elements": 2, "lattice": COARSE})
    job_id = worker.add("optimize", request)
    assert worker.run() is Ending.SUCCEEDED, worker.job(job_id).error
    document = worker.result(job_id)
    assert all(document["variation"][name]["flexible"] > 0.0 for name in document["variation"])
    assert document["reduction_model"] == "flexible"


def test_an_optimisation_goes_on_from_its_checkpoint(monkeypatch: pytest.MonkeyPatch) -> None:
    """Begun again in mid-search it ends with the same schedule to the bit."""
    monkeypatch.setattr("worker.operations.optimisation.schedule_plots", lambda *_: {})  # take seconds
    work = find_operation("optimize")(optimisation(), 1)
    steps = list(work.steps(None, lambda: False))
    resumed = find_operation("optimize")(optimisation(), 1)
    *_, last = resumed.steps(steps[1].checkpoint, lambda: False)
    undisturbed = work.outcome(steps[-1].checkpoint).document
    found = resumed.outcome(last.checkpoint).document
    assert found["schedule"] == undisturbed["schedule"]
    assert found["variation"] == undisturbed["variation"]
    assert timeless(found["search"]["history"]) == timeless(undisturbed["search"]["history"])


@pytest.mark.parametrize(
    ("parts", "fraction"),
    [
        ({"search": {"method": "pso", "particles": 32, "generations": 5000}}, 1e-4),
        (
            {
                "morph": {"final_rad": 0.5, "duration_s": 0.8, "knots": 3, "settle_s": 4.0},
                "verify": "flexible",
            },
            0.08,
        ),
    ],
    ids=["in its search", "in a flight of the flexible model"],
)
def test_a_cancelled_optimisation_keeps_its_best(
    worker: RealWorker, parts: dict[str, Any], fraction: float
) -> None:
    """Cancelled, it ends within two seconds with the best schedule so far, partial."""
    job_id = worker.add("optimize", optimisation(**parts))
    ending, took_s = worker.cancelled_after(job_id, fraction=fraction)
    assert ending is Ending.CANCELLED
    assert took_s < 2.0
    result = OptimizeResult.model_validate(worker.result(job_id))
    assert result.partial
    assert result.variation.optimum.equivalent is not None


def test_limits_that_no_schedule_keeps_are_refused() -> None:
    """What only the search space shows is refused with its place before anything is flown."""
    limits = {"max_rate_rad_s": 0.63, "max_accel_rad_s2": 1000.0}
    with pytest.raises(MorphError) as refused:
        find_operation("optimize")(optimisation(limits=limits), 1)
    assert refused.value.code == "invalid_input"
    assert refused.value.hint
