"""Laws of the file of an identified model: one job for each model and format, then the file."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.jobs import store
from app.keys.records import Scope
from app.settings import Settings
from tests.app.request_documents import RESULT, identify_document
from tests.app.running_service import DEAD_BROKER, RunningService, running_service
from tests.worker.operations.jobs_of_the_library import RealWorker, parameters

NOT_WAITING = {"Prefer": "wait=0"}


def identified(service: RunningService, owner: str = "local", **model: Any) -> str:
    """Play a worker that identifies a model, and give the model's id."""
    with service.database.write() as session:
        job = store.create_job(session, owner=owner, operation="identify", request=identify_document())
        claim = store.claim_job(session, job.id, "a test")
        assert claim is not None
        store.finish_job(session, claim, "succeeded", result={**RESULT, "model": {**parameters(), **model}})
        model_id = store.get_job(session, owner, job.id).model_id
    assert model_id is not None
    return model_id


@pytest.fixture
def fresh(tmp_path: Path) -> Iterator[RunningService]:
    """A service without any job."""
    settings = Settings(
        database_url=f"sqlite:///{tmp_path / 's.sqlite3'}", broker_url=DEAD_BROKER, event_poll_s=0.02
    )
    with running_service(settings) as running:
        yield running


def test_the_first_call_starts_a_job_and_the_next_has_its_file(fresh: RunningService) -> None:
    """202 with the job until it ends, then the file for good; each format has a job of its own."""
    model_id = identified(fresh)
    address = f"/models/{model_id}/export"
    first = fresh.client.get(address, params={"format": "npz"}, headers=NOT_WAITING)
    again = fresh.client.get(address, params={"format": "npz"}, headers=NOT_WAITING)
    assert (first.status_code, again.status_code) == (202, 202)
    assert first.headers["location"] == again.headers["location"] == f"/jobs/{first.json()['id']}"
    assert int(first.headers["retry-after"]) > 0
    assert first.json()["operation"] == "export"
    RealWorker(fresh.database).run()
    answer = fresh.client.get(address, params={"format": "npz"})
    assert (answer.status_code, answer.headers["content-type"]) == (200, "application/x-npz")
    assert answer.headers["content-disposition"] == f'attachment; filename="{model_id}.npz"'
    with np.load(io.BytesIO(answer.content)) as found:
        assert found["links.length_m"].tolist() == [1.5] * 4
        assert str(found["origin.model_id"]) == model_id
        assert json.loads(str(found["origin.fit"])) == RESULT["fit"]
    artifact = fresh.client.get(f"{first.headers['location']}/artifacts/model.npz")
    assert (artifact.content, artifact.headers["content-type"]) == (answer.content, "application/x-npz")
    assert artifact.headers["content-disposition"].startswith("attachment")
    other = fresh.client.get(address, params={"format": "json"}, headers=NOT_WAITING)
    assert other.json()["id"] != first.json()["id"]
    jobs = fresh.client.get("/jobs", params={"operation": "export"}).json()["jobs"]
    assert [job["request"]["format"] for job in jobs] == ["json", "npz"]


def test_a_call_waits_for_a_worker_that_is_quick(fresh: RunningService) -> None:
    """Within the wait the answer to the first call is the file."""
    address = f"/models/{identified(fresh)}/export"
    fresh.client.get(address, params={"format": "mat"}, headers=NOT_WAITING)
    worker = RealWorker(fresh.database)
    worker.run()
    assert fresh.client.get(address, params={"format": "mat"}).content.startswith(b"MATLAB 5.0 MAT-file")


def test_a_failed_export_tells_what_its_job_tells(fresh: RunningService) -> None:
    """A model that has no trim: the job's code, sentence and hint, each time, until the job is deleted."""
    soft = [[1e-3, 1e-3, 1e-3]]  # such joints carry no wing
    address = f"/models/{identified(fresh, stiffness_nm_rad=soft)}/export"
    job_id = fresh.client.get(address, params={"format": "npz"}, headers=NOT_WAITING).json()["id"]
    RealWorker(fresh.database).run()
    job = fresh.client.get(f"/jobs/{job_id}").json()
    assert job["status"] == "failed"
    for _ in range(2):
        problem = fresh.client.get(address, params={"format": "npz"})
        assert problem.status_code == 409
        reported = problem.json()
        assert (reported["code"], reported["detail"]) == (job["error"]["code"], job["error"]["detail"])
        assert reported["job"] == f"/jobs/{job_id}"
        assert f"DELETE /jobs/{job_id}" in reported["hint"]
    assert fresh.client.delete(f"/jobs/{job_id}").status_code == 204
    anew = fresh.client.get(address, params={"format": "npz"}, headers=NOT_WAITING)
    assert (anew.status_code, anew.json()["id"] != job_id) == (202, True)


def test_another_job_takes_the_place_of_a_cancelled_one(fresh: RunningService) -> None:
    """Cancelled is not failed: a repeated request gets a file."""
    address = f"/models/{identified(fresh)}/export"
    first = fresh.client.get(address, params={"format": "json"}, headers=NOT_WAITING).json()["id"]
    assert fresh.client.post(f"/jobs/{first}/cancel").json()["status"] == "cancelled"
    second = fresh.client.get(address, params={"format": "json"}, headers=NOT_WAITING)
    assert (second.status_code, second.json()["id"] != first) == (202, True)
    third = fresh.client.get(address, params={"format": "json"}, headers=NOT_WAITING)
    assert third.json()["id"] == second.json()["id"]


def test_unknown_formats_and_models_are_refused(fresh: RunningService) -> None:
    """With the formats there are; a model of somebody else is none."""
    model_id = identified(fresh)
    refused = fresh.client.get(f"/models/{model_id}/export", params={"format": "zip"})
    assert refused.status_code == 422
    assert refused.json()["pointer"] == "#query/format"
    assert "'npz', 'mat' or 'json'" in refused.json()["hint"]
    assert fresh.client.get(f"/models/{model_id}/export").status_code == 422
    other = identified(fresh, "someone")
    assert fresh.client.get(f"/models/{other}/export", params={"format": "npz"}).status_code == 404
    assert fresh.client.get("/jobs", params={"operation": "export"}).json()["jobs"] == []


def test_the_operation_takes_a_model_by_its_id(fresh: RunningService) -> None:
    """POST /export is what the model's call makes: its job leaves the file with its digest."""
    document = identify_document()
    request = {
        "aircraft": document["aircraft"], "flight": document["flight"],
        "model": {"model_id": identified(fresh)}, "format": "json",
    }  # fmt: skip
    job = fresh.client.post("/export", json=request)
    assert job.status_code == 202
    RealWorker(fresh.database).run()
    result = fresh.client.get(f"{job.headers['location']}/result").json()
    file = fresh.client.get(f"{job.headers['location']}/artifacts/{result['file']}")
    assert len(file.content) == result["size_bytes"]
    assert file.json()["model"]["stiffness_nm_rad"] == parameters()["stiffness_nm_rad"]


def test_both_scopes_are_demanded(fresh: RunningService) -> None:
    """It reads a model and starts a job: its description requires both scopes."""
    call = fresh.client.get("/openapi.json").json()["paths"]["/models/{model_id}/export"]["get"]
    (demanded,) = call["security"]
    assert set(demanded["api_key"]) == {Scope.DATA_READ, Scope.JOBS_WRITE}
