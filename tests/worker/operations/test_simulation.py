"""The operation `simulate`, run by a real worker."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import numpy as np
import pytest

from morphcore import load_trajectory
from morphdata.faults import MorphError
from morphdata.simulate import SimulateResult
from tests.worker.operations.jobs_of_the_library import RealWorker, parameters, simulation, undeclared
from worker.attempt import Ending
from worker.operations import find_operation


@pytest.mark.parametrize(
    "model",
    [
        {"kind": "rigid"},
        {"kind": "equivalent", "parameters": parameters()},
        {"kind": "flexible", "elements": 2, "step_s": 0.002},
    ],
    ids=lambda model: str(model["kind"]),
)
def test_each_model_flies(worker: RealWorker, model: dict[str, object]) -> None:
    """A job of each model ends with the documented result, a table, a picture, and no identified model."""
    job_id = worker.add("simulate", simulation(**model))
    assert worker.run() is Ending.SUCCEEDED, worker.job(job_id).error
    result = SimulateResult.model_validate(worker.result(job_id))
    assert result.model.kind == model["kind"]
    assert len(result.trajectory.time_s) == 61
    assert np.isclose(result.trajectory.sweep_left_rad[-1], 0.4)
    files = worker.files(job_id)
    assert set(files) == {"result.json", "flight.csv", "flight.svg", "flight.png"}
    assert undeclared(files, "simulate") == []
    assert json.loads(files["result.json"]) == worker.result(job_id)
    assert worker.job(job_id).model_id is None


def test_the_table_is_a_sample(worker: RealWorker, tmp_path: Path) -> None:
    """`flight.csv` has the columns of the example flights and can be loaded as one."""
    job_id = worker.add("simulate", simulation())
    worker.run()
    table = worker.files(job_id)["flight.csv"]
    columns = next(csv.reader(io.StringIO(table.decode())))
    assert columns[:6] == ["t", "sweep_left", "sweep_right", "phi", "theta", "psi"]
    path = tmp_path / "flight.csv"
    path.write_bytes(table)
    flown = load_trajectory(path)
    assert np.allclose(flown.theta, worker.result(job_id)["trajectory"]["theta_rad"], atol=1e-9)


def test_loads_points_and_shape_are_in_result_and_files(worker: RealWorker) -> None:
    """What a request adds arrives in the result, in the table and in files of the shape."""
    request = {
        **simulation(),
        "channels": ["nz", "root_bending", "section_cl"],
        "points": [{"name": "tip", "surface": "left wing", "at": 1}],
        "shape_times_s": [0.0, 0.5],
    }
    job_id = worker.add("simulate", request)
    assert worker.run() is Ending.SUCCEEDED, worker.job(job_id).error
    result = SimulateResult.model_validate(worker.result(job_id))
    columns = worker.result(job_id)["trajectory"]
    assert columns["nz_tip"][0] == pytest.approx(columns["nz"][0])
    assert columns["root_bending_left_wing_nm"][0] > 1000.0
    assert result.shape is not None
    assert result.shape.time_s == pytest.approx([0.0, 0.5])
    assert [len(each.leading_n_m) for each in result.shape.surfaces] == [2, 2]
    assert result.sections is not None
    assert f"section_cl_left_wing_{len(result.sections[1].at)}" in columns
    files = worker.files(job_id)
    assert {"shape.csv", "shape.npz"} < set(files)
    assert undeclared(files, "simulate") == []
    assert "nz_tip" in files["flight.csv"].decode().partition("\n")[0].split(",")


def test_a_flight_is_cancelled_within_two_seconds(worker: RealWorker) -> None:
    """A long flight of the flexible model stops soon after the request, without a partial result."""
    job_id = worker.add("simulate", simulation(60.0, kind="flexible"))
    ending, took_s = worker.cancelled_after(job_id, fraction=1e-4)
    assert ending is Ending.CANCELLED
    assert took_s < 2.0
    assert not worker.job(job_id).partial
    assert worker.files(job_id) == {}


def test_a_second_attempt_flies_from_the_start(worker: RealWorker) -> None:
    """A worker that shuts down hands the flight back; the next one restarts it, to the same flight."""
    request = simulation(4.0, kind="flexible", lattice={})  # long enough to be interrupted
    job_id = worker.add("simulate", request)
    assert worker.run(lambda: worker.job(job_id).progress is not None) is Ending.RELEASED
    assert worker.run() is Ending.SUCCEEDED, worker.job(job_id).error
    assert "from the beginning" in (worker.job(job_id).progress or {})["message"]
    undisturbed = find_operation("simulate")(request, 1)
    *_, last = undisturbed.steps(None, lambda: False)
    assert worker.result(job_id)["trajectory"] == undisturbed.outcome(last.checkpoint).document["trajectory"]


def test_a_spline_beyond_its_hinge_is_refused() -> None:
    """An angle beyond the hinge between two knots, which only the spline shows, is refused with its place."""
    request = simulation(2.0)
    request["schedules"] = {
        "both": {
            "kind": "spline",
            "knot_time_s": [0.0, 0.9, 1.0, 2.0],
            "knot_angle_rad": [0.0, 0.0, 1.2, 1.2],
        }
    }
    work = find_operation("simulate")(request, 1)
    with pytest.raises(MorphError) as refused:
        next(work.steps(None, lambda: False))
    assert (refused.value.code, refused.value.pointer) == ("invalid_input", "/schedules/both")
