"""The request of a job comes back whole: posted again it is the same job."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from tests.app.calls import fault, post
from tests.app.request_documents import (
    RESULT,
    Document,
    identify_document,
    optimize_document,
    sample_document,
    simulate_document,
    study_document,
)
from tests.app.running_service import RunningService

KEYS = map("key-{}".format, itertools.count())


def identified(service: RunningService) -> Document:
    """A finished identification with two links, as its job shows it."""
    document = identify_document()
    document["model"] = {"links_per_wing": 2}
    job = post(service, "/identify", document).raise_for_status().json()
    service.finish(service.claim(job["id"]), "succeeded", result=RESULT)
    found: Document = service.client.get(f"/jobs/{job['id']}").raise_for_status().json()
    return found


def uploaded(service: RunningService) -> Iterator[tuple[str, Document, list[str]]]:
    """An identification of an uploaded flight that is deleted afterwards."""
    flight = sample_document("train_rate_0.5")
    del flight["role"]
    trajectory = post(service, "/trajectories", flight).raise_for_status().json()["id"]
    document = identify_document()
    document["samples"] = [{"trajectory_id": trajectory, "weight": 2.0}]
    yield "identify", document, [f"/trajectories/{trajectory}"]


def referring(service: RunningService) -> Iterator[tuple[str, Document, list[str]]]:
    """Requests that name a model or a job that is deleted afterwards."""
    for place in ("model_id", "job_id"):
        job = identified(service)
        name = job["model_id"] if place == "model_id" else job["id"]
        warm = identify_document()
        warm["model"] = {"links_per_wing": 2}
        warm["search"] = {"seed": 3, "warm_start": {place: name}}
        yield "identify", warm, [f"/models/{name}" if place == "model_id" else f"/jobs/{name}"]
    model = identified(service)["model_id"]
    flown = simulate_document()
    flown["model"] = {"kind": "equivalent", "model_id": model}
    flown["environment"] = {"gust": {"amplitude_m_s": 3.0, "gradient_m": 20.0}}
    yield "simulate", flown, []
    best = optimize_document()
    best["model"] = {"model_id": model}
    yield "optimize", best, [f"/models/{model}"]


def plain(_service: RunningService) -> Iterator[tuple[str, Document, list[str]]]:
    """Requests that hold everything themselves, with terms of their own."""
    yield "identify", identify_document(), []
    yield "study", study_document(), []
    yield "simulate", simulate_document(), []
    yield "optimize", optimize_document(), []
    document = identify_document()
    document["execution"] = {"priority": 7, "label": "wind tunnel", "mode": "distributed", "chunks": 3}
    yield "identify", document, []


@pytest.mark.parametrize("requests", [plain, uploaded, referring])
def test_the_request_posted_again_is_the_same_job(
    service: RunningService, requests: Callable[[RunningService], Any]
) -> None:
    """Under the same Idempotency-Key it is a repetition, to the last digit, whatever was deleted since."""
    for operation, document, gone in requests(service):
        key = {"Idempotency-Key": next(KEYS)}
        job = post(service, f"/{operation}", document, **key).raise_for_status().json()
        answer = service.client.get(f"/jobs/{job['id']}/request").raise_for_status()
        assert answer.headers["content-type"] == "application/json"
        for path in gone:
            assert service.client.delete(path).status_code == 204
        again = post(service, f"/{operation}", answer.json(), **key).raise_for_status()
        assert again.headers["idempotency-replayed"] == "true", operation
        assert again.json()["id"] == job["id"]
        fresh = post(service, f"/{operation}", answer.json()).raise_for_status().json()
        assert fresh["id"] != job["id"]
        assert (fresh["operation"], fresh["label"]) == (job["operation"], job["label"])
        second = service.client.get(f"/jobs/{fresh['id']}/request").raise_for_status()
        assert second.content == answer.content


def test_the_request_as_it_was_asked_stands_in_it(service: RunningService) -> None:
    """Aircraft, flight, samples and schedules come back as they were sent."""
    requested = simulate_document()
    job = post(service, "/simulate", requested).raise_for_status().json()
    found = service.client.get(f"/jobs/{job['id']}/request").json()
    assert {name: found[name] for name in ("aircraft", "flight", "duration_s")} == {
        name: requested[name] for name in ("aircraft", "flight", "duration_s")
    }
    requested = identify_document()
    job = post(service, "/identify", requested).raise_for_status().json()
    found = service.client.get(f"/jobs/{job['id']}/request").json()
    for sample, sent in zip(found["samples"], requested["samples"], strict=True):
        assert sample == {**sent, "weight": 1.0}


def test_a_deleted_job_has_none(service: RunningService) -> None:
    """The request goes with its job."""
    job = post(service, "/simulate", simulate_document()).raise_for_status().json()["id"]
    service.client.post(f"/jobs/{job}/cancel").raise_for_status()
    assert service.client.delete(f"/jobs/{job}").status_code == 204
    assert fault(service.client.get(f"/jobs/{job}/request"), 404)["code"] == "job_not_found"
