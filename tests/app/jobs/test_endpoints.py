"""Laws of the endpoints of jobs, with the test playing the worker, on both databases."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Iterable, Iterator
from typing import Any

import httpx
import pytest

from app.jobs import store
from tests.app.request_documents import RESULT, Document, identify_document, in_both_spellings
from tests.app.running_service import RunningService
from tests.waiting import until


def new_job(service: RunningService) -> str:
    """Post an identification and return its id."""
    document = identify_document()
    document["samples"] = document["samples"][2:3]
    job_id: str = service.client.post("/identify", json=document).raise_for_status().json()["id"]
    return job_id


def get(service: RunningService, path: str, **options: Any) -> Document:
    """Get a JSON document."""
    document: Document = service.client.get(path, **options).raise_for_status().json()
    return document


def kinds(events: Iterable[Document]) -> list[str]:
    """Give the types of events, signs of life left out."""
    return [event["type"] for event in events if event["type"] != "comment"]


def sse(answer: httpx.Response) -> Iterator[Document]:
    """Read the events of a stream; comments are returned as events of the type `comment`."""
    event: Document = {}
    for line in answer.iter_lines():
        if line.startswith(":"):
            yield {"type": "comment"}
        elif not line:
            if "data" in event:
                yield event
            event = {}
        else:
            name, _, value = line.partition(": ")
            event[{"event": "type"}.get(name, name)] = json.loads(value) if name == "data" else value


def test_life_of_a_job(any_service: RunningService) -> None:
    """Queued, running with progress, succeeded: each state is seen, and all it leaves can be fetched."""
    service = any_service
    job_id = new_job(service)
    pending = service.client.get(f"/jobs/{job_id}/result")
    assert (pending.status_code, pending.json()["code"]) == (409, "result_not_ready")
    claim = service.claim(job_id)
    service.progress(claim, fraction=0.25, generation=5, best_cost=0.125, flights=640, phase="swarm")
    running = get(service, f"/jobs/{job_id}")
    assert (running["status"], running["attempt"], running["progress"]["generation"]) == ("running", 1, 5)
    assert running["deadline_at"] > running["started_at"] > running["created_at"]
    plots = {"convergence.svg": b"<svg/>", "curves_x.csv": b"t\n0\n"}
    service.finish(claim, "succeeded", result=RESULT, artifacts=plots)
    done = get(service, f"/jobs/{job_id}")
    assert done["status"] == "succeeded"
    assert get(service, done["links"]["result"]) == RESULT
    files = get(service, done["links"]["artifacts"])["artifacts"]
    assert [file["name"] for file in files] == sorted(plots)
    for file in files:
        answer = service.client.get(file["href"])
        assert answer.content == plots[file["name"]]
        assert answer.headers["content-type"] == file["media_type"]
        assert "sandbox" in answer.headers["content-security-policy"]
    model = get(service, f"/models/{done['model_id']}")
    assert model["model"] == in_both_spellings(RESULT["model"])
    assert model["aircraft"] == identify_document()["aircraft"]


def test_failure_is_reported(any_service: RunningService) -> None:
    """A failed job reports its code and hint, in the job and in place of the result."""
    job_id = new_job(any_service)
    error = {
        "code": "trim_not_found",
        "detail": "No level flight.",
        "pointer": "/flight",
        "hint": "Fly faster.",
    }
    any_service.finish(any_service.claim(job_id), "failed", error=error)
    assert get(any_service, f"/jobs/{job_id}")["error"] == error
    problem = any_service.client.get(f"/jobs/{job_id}/result").json()
    assert problem["status"] == 409
    assert "trim_not_found" in problem["detail"]


def test_cancel_keeps_the_best_so_far(any_service: RunningService) -> None:
    """A running job that is cancelled leaves its partial result, marked as such."""
    job_id = new_job(any_service)
    claim = any_service.claim(job_id)
    assert any_service.client.post(f"/jobs/{job_id}/cancel").json()["status"] == "cancelling"
    any_service.finish(claim, "cancelled", result=RESULT)
    job = any_service.client.post(f"/jobs/{job_id}/cancel").json()
    assert (job["status"], job["partial"]) == ("cancelled", True)
    assert get(any_service, f"/jobs/{job_id}/result") == {**RESULT, "partial": True}


def test_delete_only_what_ended(any_service: RunningService) -> None:
    """A job that has not ended is not deleted; after its end all it left goes too, but its model stays."""
    job_id = new_job(any_service)
    assert any_service.client.delete(f"/jobs/{job_id}").status_code == 409
    any_service.finish(any_service.claim(job_id), "succeeded", result=RESULT, artifacts={"a.csv": b"t"})
    model_id = get(any_service, f"/jobs/{job_id}")["model_id"]
    assert any_service.client.delete(f"/jobs/{job_id}").status_code == 204
    for path in ("", "/result", "/events", "/artifacts", "/artifacts/a.csv"):
        assert any_service.client.get(f"/jobs/{job_id}{path}").status_code == 404
    assert any_service.client.delete(f"/jobs/{job_id}").status_code == 404
    assert get(any_service, f"/models/{model_id}")["job_id"] is None


def test_pages_hold_every_job_once(any_service: RunningService) -> None:
    """Going through the pages gives every job once, newest first; filters hold."""
    made = [new_job(any_service) for _ in range(5)]
    any_service.client.post(f"/jobs/{made[0]}/cancel")
    seen: list[str] = []
    cursor = None
    while True:
        page = get(any_service, "/jobs", params={"limit": 2, **({"cursor": cursor} if cursor else {})})
        seen += [job["id"] for job in page["jobs"]]
        cursor = page["next_cursor"]
        if cursor is None:
            break
    assert seen == sorted(set(seen), reverse=True)
    assert set(made) <= set(seen)
    queued = get(any_service, "/jobs", params={"status": ["queued", "running"], "operation": "identify"})
    ids = {job["id"] for job in queued["jobs"]}
    assert made[0] not in ids
    assert set(made[1:]) <= ids


def test_stream_replays_and_follows(any_service: RunningService) -> None:
    """A stream sends past events, then new ones, and ends with the job; ids rise by one without a gap."""
    service = any_service
    job_id = new_job(service)
    claim = service.claim(job_id)
    service.progress(claim, fraction=0.1)

    alive = threading.Event()

    def work() -> None:
        assert alive.wait(20.0), "no sign of life while nothing happened"
        service.progress(claim, fraction=0.6)
        service.finish(claim, "succeeded", result=RESULT)

    worker = threading.Thread(target=work)
    worker.start()
    with service.client.stream("GET", f"/jobs/{job_id}/events") as answer:
        assert answer.headers["content-type"].startswith("text/event-stream")
        events = []
        for event in sse(answer):
            events.append(event)
            if event["type"] == "comment" and len(events) > 3:  # past events have been sent
                alive.set()
    worker.join()
    reported = [event for event in events if event["type"] != "comment"]
    assert [event["type"] for event in reported] == ["queued", "started", "progress", "progress", "succeeded"]
    assert [int(event["id"]) for event in reported] == [1, 2, 3, 4, 5]
    assert [event["data"].get("fraction") for event in reported] == [None, None, 0.1, 0.6, None]
    assert len(events) > len(reported)  # signs of life while nothing happened


@pytest.mark.parametrize("how", ["header", "query"])
def test_stream_goes_on_where_it_broke_off(any_service: RunningService, how: str) -> None:
    """After `Last-Event-ID` only later events come; when all of an ended job were seen, 204 says so."""
    job_id = new_job(any_service)
    claim = any_service.claim(job_id)
    any_service.finish(claim, "succeeded", result=RESULT)

    def options(seq: int) -> Document:
        return {"headers": {"Last-Event-ID": str(seq)}} if how == "header" else {"params": {"after": seq}}

    with any_service.client.stream("GET", f"/jobs/{job_id}/events", **options(2)) as answer:
        assert [event["type"] for event in sse(answer)] == ["succeeded"]
    assert any_service.client.get(f"/jobs/{job_id}/events", **options(3)).status_code == 204


def test_events_as_json_are_the_same_rows(any_service: RunningService) -> None:
    """Polling with `Accept: application/json` reads the same rows as the stream."""
    job_id = new_job(any_service)
    any_service.progress(any_service.claim(job_id), fraction=0.5)
    accept = {"headers": {"Accept": "application/json"}}
    page = get(any_service, f"/jobs/{job_id}/events", **accept)
    assert [(event["seq"], event["type"]) for event in page["events"]] == [
        (1, "queued"),
        (2, "started"),
        (3, "progress"),
    ]
    assert (page["last_seq"], page["finished"]) == (3, False)
    rest = get(any_service, f"/jobs/{job_id}/events", params={"after": 2}, **accept)
    assert rest["events"] == page["events"][2:]


def test_stream_ends_when_the_job_is_deleted(service: RunningService) -> None:
    """A client that follows a deleted job is not left waiting."""
    job_id = new_job(service)
    following = threading.Event()

    def delete_soon() -> None:
        assert following.wait(20.0)
        with service.database.write() as session:
            store.request_cancel(session, "local", job_id)
        service.client.delete(f"/jobs/{job_id}")

    helper = threading.Thread(target=delete_soon)
    helper.start()
    with service.client.stream("GET", f"/jobs/{job_id}/events") as answer:
        following.set()
        types = kinds(sse(answer))
    helper.join()
    assert types in (["queued"], ["queued", "cancelled"])


def test_waiting_ends_with_the_job(service: RunningService) -> None:
    """`Prefer: wait` answers soon after the end, not after the whole wait."""
    job_id = new_job(service)
    claim = service.claim(job_id)
    worker = threading.Timer(0.3, service.finish, (claim, "succeeded"), {"result": RESULT})
    worker.start()
    start = time.perf_counter()
    job = get(service, f"/jobs/{job_id}", headers={"Prefer": "wait=20"})
    worker.join()
    assert job["status"] == "succeeded"
    assert time.perf_counter() - start < 3.0


def test_many_watchers_cost_one_query(service: RunningService) -> None:
    """A hundred clients of one job all get its events; a hundred idle streams do not block other requests."""
    job_id = new_job(service)
    claim = service.claim(job_id)
    limits = httpx.Limits(max_connections=120)
    reported: list[list[str]] = []
    begun: list[str] = []
    with httpx.Client(base_url=service.url, timeout=30.0, limits=limits) as client:

        def follow() -> None:
            with client.stream("GET", f"/jobs/{job_id}/events", params={"after": 2}) as answer:
                begun.append(job_id)
                reported.append(kinds(sse(answer)))

        followers = [threading.Thread(target=follow) for _ in range(100)]
        for follower in followers:
            follower.start()
        until(lambda: len(begun) == len(followers))
        start = time.perf_counter()
        assert service.client.get("/jobs").status_code == 200
        assert time.perf_counter() - start < 1.0
        service.finish(claim, "succeeded", result=RESULT)
        for follower in followers:
            follower.join(20.0)
    assert reported == [["succeeded"]] * 100


def test_artifact_names_cannot_leave(service: RunningService) -> None:
    """Names with folders find nothing, whatever they point to."""
    job_id = new_job(service)
    for name in ("..%2f..%2fetc%2fpasswd", "%2e%2e", "a%00.svg", "nothing.svg"):
        assert service.client.get(f"/jobs/{job_id}/artifacts/{name}").status_code == 404


def test_listing_is_small(service: RunningService) -> None:
    """The list holds no rows of samples: a page of 50 jobs is well below what one request weighs."""
    for _ in range(3):
        new_job(service)
    answer = service.client.get("/jobs")
    assert len(answer.content) < 2_000 * len(answer.json()["jobs"])
