"""Laws of `execution`: how a job is run, found again, waits and is given up; on both databases."""

from __future__ import annotations

from datetime import datetime, timedelta
from typing import Any

import pytest
from sqlalchemy import select, update

from app.database import database_time
from app.documents import unpacked
from app.jobs import store
from app.jobs.reaper import reap
from app.tables import job_requests, jobs
from tests.app.calls import fault, post
from tests.app.jobs.test_submission import OPERATIONS, Operation
from tests.app.request_documents import Document, simulate_document
from tests.app.running_service import RunningService


@pytest.fixture(params=OPERATIONS, ids=[operation.name for operation in OPERATIONS])
def operation(request: pytest.FixtureRequest) -> Operation:
    """Each operation in turn."""
    found: Operation = request.param
    return found


def posted(service: RunningService, **execution: Any) -> Document:
    """Post a simulation to be run in this way; give its job."""
    answer = post(service, "/simulate", {**simulate_document(), "execution": execution})
    assert answer.status_code == 202, answer.text
    document: Document = answer.json()
    return document


def cancel_all(service: RunningService) -> None:
    """Empty the queue."""
    for job in service.client.get("/jobs", params={"status": "queued", "limit": 200}).json()["jobs"]:
        service.client.post(f"/jobs/{job['id']}/cancel").raise_for_status()


def ids(service: RunningService, **filters: Any) -> list[str]:
    """Ids of the jobs that a list shows."""
    answer = service.client.get("/jobs", params=filters)
    assert answer.status_code == 200, answer.text
    return [job["id"] for job in answer.json()["jobs"]]


def test_every_operation_takes_execution_settings(any_service: RunningService, operation: Operation) -> None:
    """Priority, label and attempts stand in the job; the worker's document says how it is to be run."""
    execution = {"priority": 7, "label": "wing 3, again", "max_attempts": 5}
    document = {**operation.request(), "execution": execution}
    job = post(any_service, f"/{operation.name}", document).json()
    assert {name: job[name] for name in execution} == execution
    with any_service.database.read() as session:
        stored = store.load_request(session, job["id"])["execution"]
        row = session.execute(
            select(jobs.c.flights_estimated, jobs.c.size_bytes, jobs.c.request_id, job_requests.c.document)
            .join(job_requests)
            .where(jobs.c.id == job["id"])
        ).one()
    assert stored["priority"] == 7
    assert ("mode" in stored) is (operation.name == "identify")
    assert row.flights_estimated > 0
    assert row.size_bytes == len(row.document)
    assert row.request_id
    assert unpacked(row.document)["execution"] == stored
    cancel_all(any_service)


@pytest.mark.parametrize(
    ("execution", "pointer", "words"),
    [
        ({"priority": 101}, "/execution/priority", "100"),
        ({"label": ""}, "/execution/label", "1"),
        ({"label": "two\nlines"}, "/execution/label", ""),
        ({"max_attempts": 0}, "/execution/max_attempts", "1"),
        ({"expires_in_s": -1.0}, "/execution/expires_in_s", "1"),
        ({"mode": "distributed"}, "/execution/mode", ""),
    ],
)
def test_bad_wishes_are_named(service: RunningService, execution: Document, pointer: str, words: str) -> None:
    """What cannot be is refused by name; only identifications are spread over workers."""
    document = {**simulate_document(), "execution": execution}
    problem = fault(post(service, "/simulate", document))
    assert problem["errors"][0]["pointer"] == pointer
    assert words in problem["errors"][0]["hint"] + problem["errors"][0]["detail"]


def test_queue_is_shown_while_it_lasts(any_service: RunningService) -> None:
    """The response to POST, the job and a validation contain the place; a claimed job has none."""
    cancel_all(any_service)
    first, second = posted(any_service), posted(any_service)
    urgent = posted(any_service, priority=1)
    places = [
        any_service.client.get(f"/jobs/{job['id']}").json()["queue"]["position"]
        for job in (first, second, urgent)
    ]
    assert [job["queue"]["position"] for job in (first, second, urgent)] == [1, 2, 1]
    assert places == [2, 3, 1]
    verdict = post(any_service, "/validate/simulate", simulate_document()).json()
    assert verdict["queue"]["position"] == 4
    assert verdict["quotas"] is None
    any_service.claim(urgent["id"])
    assert any_service.client.get(f"/jobs/{urgent['id']}").json()["queue"] is None
    cancel_all(any_service)


def test_lists_find_jobs_again(any_service: RunningService) -> None:
    """By label, by time, by several states at once; a moment without its offset is refused."""
    cancel_all(any_service)
    one, two = posted(any_service, label="sweep 1"), posted(any_service, label="sweep 2")
    assert ids(any_service, label="sweep 1") == [one["id"]]
    assert ids(any_service, label="sweep") == []
    born = datetime.fromisoformat(two["created_at"])
    later = (born + timedelta(milliseconds=1)).isoformat()
    assert two["id"] in ids(any_service, created_before=later)
    assert ids(any_service, created_after=later) == []
    assert two["id"] not in ids(any_service, created_before=born.isoformat())
    any_service.client.post(f"/jobs/{one['id']}/cancel")
    both = ids(any_service, status=["cancelled", "queued"], label="sweep 1")
    assert both == [one["id"]]
    problem = fault(any_service.client.get("/jobs", params={"created_after": "2026-01-01T00:00:00"}))
    assert problem["pointer"] == "#query/created_after"
    cancel_all(any_service)


def test_a_start_can_be_missed(any_service: RunningService) -> None:
    """A job that has not begun by its latest start ends as expired and says why; one that began does not."""
    late, begun = posted(any_service, expires_in_s=60.0), posted(any_service, expires_in_s=60.0)
    assert late["deadline_at"] is not None
    any_service.claim(begun["id"])
    with any_service.database.write() as session:
        session.execute(
            update(jobs)
            .where(jobs.c.id == late["id"], jobs.c.started_at.is_(None))
            .values(deadline_at=database_time() - 1.0)
        )
        assert late["id"] in reap(session).expired
    job = any_service.client.get(f"/jobs/{late['id']}").json()
    assert (job["status"], job["error"]["code"]) == ("expired", "not_started_in_time")
    running = any_service.client.get(f"/jobs/{begun['id']}").json()
    left = datetime.fromisoformat(running["deadline_at"]) - datetime.fromisoformat(running["started_at"])
    assert left > timedelta(minutes=2)  # the deadline counts from the claim now


def test_other_terms_are_another_request(service: RunningService) -> None:
    """An idempotency key holds for the terms too: with another priority it is a conflict."""
    document = simulate_document()
    first = post(service, "/simulate", document, **{"Idempotency-Key": "terms"})
    assert first.status_code == 202
    changed = {**document, "execution": {"priority": 1}}
    assert fault(post(service, "/simulate", changed, **{"Idempotency-Key": "terms"}), 409)
