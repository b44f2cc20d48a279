"""Laws of every operation's endpoints, over real HTTP, with the broker unavailable."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import pytest

from app.jobs import store
from tests.app.calls import changed, fault, post
from tests.app.request_documents import (
    OPTIMIZE_RESULT,
    RESULT,
    SIMULATE_RESULT,
    STUDY_RESULT,
    Document,
    identify_document,
    optimize_document,
    simulate_document,
    study_document,
)
from tests.app.running_service import RunningService


class Operation(NamedTuple):
    """One operation with a valid request, a change to it that is valid too, and a result."""

    name: str
    request: Callable[[], Document]
    other: tuple[str, Any]
    result: Document


OPERATIONS = [
    Operation("identify", identify_document, ("/search/seed", 2), RESULT),
    Operation("study", study_document, ("/model/links_per_wing", [1, 2]), STUDY_RESULT),
    Operation("simulate", simulate_document, ("/duration_s", 2.4), SIMULATE_RESULT),
    Operation("optimize", optimize_document, ("/morph/final_rad", 0.9), OPTIMIZE_RESULT),
]


@pytest.fixture(params=OPERATIONS, ids=[operation.name for operation in OPERATIONS])
def operation(request: pytest.FixtureRequest) -> Operation:
    """Each operation in turn."""
    found: Operation = request.param
    return found


def test_accepted_work_is_a_queued_row(any_service: RunningService, operation: Operation) -> None:
    """202 with the job's place; the row holds aircraft and flight as they came, on both databases."""
    document = operation.request()
    answer = post(any_service, f"/{operation.name}", document)
    assert answer.status_code == 202, answer.text
    job = answer.json()
    assert answer.headers["location"] == job["links"]["self"] == f"/jobs/{job['id']}"
    assert (job["operation"], job["status"]) == (operation.name, "queued")
    assert job["request"]["aircraft"] == document["aircraft"]["name"]
    with any_service.database.read() as session:
        stored = store.load_request(session, job["id"])
    assert {part: stored[part] for part in ("aircraft", "flight")} == {
        part: document[part] for part in ("aircraft", "flight")
    }
    listed = any_service.client.get("/jobs", params={"operation": operation.name}).json()["jobs"]
    assert job["id"] in [item["id"] for item in listed]
    assert {item["operation"] for item in listed} == {operation.name}


def test_same_key_same_answer(any_service: RunningService, operation: Operation) -> None:
    """An idempotency key gives the first job again for the same body, and a conflict for another."""
    path, document, key = f"/{operation.name}", operation.request(), f"key-of-{operation.name}"
    first = post(any_service, path, document, **{"Idempotency-Key": key})
    again = post(any_service, path, document, **{"Idempotency-Key": key})
    assert again.json()["id"] == first.json()["id"]
    assert again.headers["idempotency-replayed"] == "true"
    assert "idempotency-replayed" not in first.headers
    other = changed(document, *operation.other)
    assert fault(post(any_service, path, other, **{"Idempotency-Key": key}), 409)["code"] == (
        "idempotency_conflict"
    )


def test_a_key_belongs_to_one_operation(service: RunningService) -> None:
    """The same key for another operation is a conflict."""
    assert post(service, "/study", study_document(), **{"Idempotency-Key": "k"}).status_code == 202
    fault(post(service, "/identify", identify_document(), **{"Idempotency-Key": "k"}), 409)


def test_validation_makes_no_job(service: RunningService, operation: Operation) -> None:
    """Validation returns a cost and starts nothing; errors are the same as those of the real call."""
    before = service.client.get("/jobs", params={"limit": 200}).json()
    answer = service.client.post(f"/validate/{operation.name}", json=operation.request())
    assert answer.status_code == 200, answer.text
    assert answer.json()["valid"] is True
    assert answer.json()["operation"] == operation.name
    assert answer.json()["cost"]["core_s"] > 0.0
    wrong = changed(operation.request(), "/flight/airspeed_m_s", -1.0)
    real = fault(post(service, f"/{operation.name}", wrong))
    checked = fault(post(service, f"/validate/{operation.name}", wrong))
    assert checked["errors"] == real["errors"]
    assert service.client.get("/jobs", params={"limit": 200}).json() == before


@pytest.mark.parametrize(
    ("path", "value", "code"),
    [
        ("/flight/airspeed_m_s", float("nan"), "finite_number"),
        ("/flight/air_density_kg_m3", float("inf"), "finite_number"),
        ("/aircraft/surfaces/0/span_m", "3", "float_type"),
        ("/colour", "red", "unknown_field"),
        ("/aircraft/surfaces/1/name", "right wing", "name_not_unique"),
        ("/flight/mach", 0.9, "less_than_equal"),
    ],
)
def test_what_all_refuse(
    service: RunningService, operation: Operation, path: str, value: Any, code: str
) -> None:
    """NaN, infinity, text for numbers, unknown fields, an impossible vehicle: reported by every operation."""
    first = fault(post(service, f"/{operation.name}", changed(operation.request(), path, value)))["errors"][0]
    assert (first["pointer"], first["code"]) == (path, code)
    assert first["hint"]


def test_waits_when_requested(service: RunningService, operation: Operation) -> None:
    """`Prefer: wait` is honoured, and said so."""
    answer = post(service, f"/{operation.name}", operation.request(), Prefer="wait=1")
    assert answer.headers["preference-applied"] == "wait=1"


def test_the_life_of_a_job(any_service: RunningService, operation: Operation) -> None:
    """Claimed, ended, its result given as it was stored, valid by the published form of it."""
    job_id = post(any_service, f"/{operation.name}", operation.request()).json()["id"]
    claim = any_service.claim(job_id)
    any_service.progress(claim, fraction=0.5, phase="flight", message="half way")
    assert any_service.client.get(f"/jobs/{job_id}").json()["progress"]["fraction"] == 0.5
    any_service.finish(claim, "succeeded", result=operation.result)
    assert any_service.client.get(f"/jobs/{job_id}/result").json() == operation.result
    job = any_service.client.get(f"/jobs/{job_id}").json()
    assert (job["model_id"] is not None) == (operation.name in {"identify", "study"})
