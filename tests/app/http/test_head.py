"""Laws of HEAD: wherever there is GET, with the same status and headers, and without a body."""

from __future__ import annotations

from collections.abc import Iterator

import httpx
import pytest

from app.main import routed_app
from tests.app.jobs.test_endpoints import new_job
from tests.app.request_documents import RESULT, Document, sample_document
from tests.app.running_service import RunningService

OWN = frozenset({"date", "x-request-id"})  # differ from request to request
UNLISTED = (
    "/",
    "/docs",
    "/openapi.json",
    "/static/app.js",
    "/static/nothing.js",
    "/nothing",
    "/static/../jobs",
)
EXPORT = "/models/{model_id}/export"  # there is no worker: it answers that the job has not ended
STATUS = {EXPORT: 202}
QUERY = {EXPORT: "?format=npz"}
MADE_UP = {"webhook_id": "wh_0", "name": "a.csv"}


@pytest.fixture(scope="module")
def known(service: RunningService) -> Document:
    """Ids to fill into paths: of a job that has ended, of its model, of a flight."""
    job_id = new_job(service)
    service.finish(service.claim(job_id), "succeeded", result=RESULT, artifacts={"a.csv": b"t"})
    model_id = service.client.get(f"/jobs/{job_id}").json()["model_id"]
    sample = sample_document("train_rate_0.8")
    flight = {key: value for key, value in sample.items() if key not in ("role", "weight")}
    trajectory = service.client.post("/trajectories", json=flight).raise_for_status().json()
    return {**MADE_UP, "job_id": job_id, "model_id": model_id, "trajectory_id": trajectory["id"]}


def readable_paths() -> Iterator[str]:
    """Every path of the OpenAPI document that has GET, and the pages and static files."""
    for path, operations in routed_app().openapi()["paths"].items():
        if "get" in operations:
            yield path
    yield from UNLISTED


def reported(answer: httpx.Response) -> Document:
    """The headers that must be the same."""
    return {name: value for name, value in answer.headers.items() if name not in OWN}


@pytest.mark.parametrize("path", list(readable_paths()))
def test_head_is_get_without_its_body(service: RunningService, known: Document, path: str) -> None:
    """Status and headers of GET, to the length of the body that does not come."""
    chosen = path.format(**known) + QUERY.get(path, "")
    head, got = (service.client.request(method, chosen) for method in ("HEAD", "GET"))
    if path == "/metrics":  # its numbers rise with every request
        head.headers.pop("content-length")
        got.headers.pop("content-length")
    assert (head.status_code, reported(head)) == (got.status_code, reported(got))
    assert head.content == b""
    assert path in UNLISTED or got.status_code == STATUS.get(path, 404 if "webhook_id" in path else 200)


@pytest.mark.parametrize("path", ["/identify", "/validate/identify", "/jobs/job_0/cancel"])
def test_where_there_is_no_get_there_is_no_head(service: RunningService, path: str) -> None:
    """405, with the methods that there are."""
    head, got = (service.client.request(method, path) for method in ("HEAD", "GET"))
    assert (head.status_code, reported(head)) == (got.status_code, reported(got)) == (405, reported(head))
    assert "HEAD" not in head.headers["allow"]


def test_head_has_the_answers_of_conditions_and_faults(service: RunningService, known: Document) -> None:
    """What a parameter or a header does to GET it does to HEAD."""
    file = service.client.get("/static/app.js").headers
    cases: list[tuple[str, dict[str, str]]] = [
        ("/jobs?limit=0", {}),
        ("/jobs/job_nothing", {}),
        (f"/jobs/{known['job_id']}", {"Prefer": "wait=20"}),
        (f"/jobs/{known['job_id']}/events", {"Accept": "application/json"}),
        (f"/jobs/{known['job_id']}/events?after=1000", {}),
        ("/static/app.js", {"If-None-Match": file["etag"]}),
        ("/jobs", {"Host": "evil.example"}),
    ]
    for path, headers in cases:
        head, got = (service.client.request(method, path, headers=headers) for method in ("HEAD", "GET"))
        assert (head.status_code, reported(head)) == (got.status_code, reported(got)), path
        assert head.content == b""


def test_many_on_one_connection(service: RunningService, known: Document) -> None:
    """A body that were sent all the same would be read as the next answer."""
    for _ in range(5):
        assert service.client.head(f"/jobs/{known['job_id']}/result").status_code == 200
        assert service.client.get("/livez").json()["status"] == "alive"
