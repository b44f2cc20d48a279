"""Laws of quotas as a client meets them, on both databases."""

from __future__ import annotations

import threading

from app.keys.records import Quota, Scope
from tests.app.key_holders import holder, make_key
from tests.app.request_documents import RESULT, identify_document, sample_document, simulate_document
from tests.app.running_service import RunningService


def test_jobs_in_flight_are_limited(keyed_service: RunningService) -> None:
    """One job too many is 429 with limit and use; an end makes room; a repeated post is no new job."""
    key = make_key(keyed_service.database, "busy", quota=Quota(max_jobs_in_flight=1))
    with holder(keyed_service, key.text) as client:
        once = {"Idempotency-Key": "once"}
        job = client.post("/simulate", json=simulate_document(), headers=once).raise_for_status().json()
        again = client.post("/simulate", json=simulate_document(), headers=once)
        assert (again.status_code, again.json()["id"]) == (202, job["id"])
        refused = client.post("/simulate", json=simulate_document())
        assert refused.status_code == 429
        assert int(refused.headers["retry-after"]) > 0
        problem = refused.json()
        assert problem["code"] == "quota_exceeded"
        assert problem["quota"] == {"name": "jobs_in_flight", "limit": 1, "used": 1, "asked": 1}
        assert client.post("/validate/simulate", json=simulate_document()).status_code == 200
        client.post(f"/jobs/{job['id']}/cancel").raise_for_status()
        client.post("/simulate", json=simulate_document()).raise_for_status()


def test_flights_are_charged_when_posted_and_corrected_at_the_end(keyed_service: RunningService) -> None:
    """The estimate counts while the job runs, what was flown when it has ended."""
    key = make_key(keyed_service.database, "flyer")
    with holder(keyed_service, key.text) as client:

        def flights() -> int:
            used: int = client.get("/me").json()["quotas"]["flights_per_day"]["used"]
            return used

        estimate = client.post("/validate/identify", json=identify_document()).json()["cost"]["flights"]
        job = client.post("/identify", json=identify_document()).raise_for_status().json()["id"]
        assert flights() == estimate > 0
        claim = keyed_service.claim(job)
        keyed_service.progress(claim, fraction=0.5, flights=123)
        assert flights() == estimate
        keyed_service.finish(claim, "succeeded", result=RESULT)
        assert flights() == 123
        cancelled = client.post("/identify", json=identify_document()).raise_for_status().json()["id"]
        client.post(f"/jobs/{cancelled}/cancel").raise_for_status()
        assert flights() == 123, "a job that was never flown costs nothing"


def test_more_flights_than_a_day_has_are_refused(keyed_service: RunningService) -> None:
    """A post beyond the day's flights is refused before a job is made."""
    key = make_key(keyed_service.database, "frugal", quota=Quota(max_flights_per_day=10))
    with holder(keyed_service, key.text) as client:
        refused = client.post("/identify", json=identify_document())
        assert refused.status_code == 429
        assert refused.json()["quota"]["name"] == "flights_per_day"
        assert client.get("/jobs").json()["jobs"] == []


def test_stored_bytes_are_limited(keyed_service: RunningService) -> None:
    """Uploads and jobs share the key's room; deleting a job gives it back."""
    key = make_key(keyed_service.database, "hoarder", quota=Quota(max_stored_bytes=20_000))
    flight = sample_document("train_rate_0.5")
    del flight["role"]
    with holder(keyed_service, key.text) as client:
        uploaded = 0
        while (answer := client.post("/trajectories", json=flight)).status_code == 201:
            uploaded += 1
            assert uploaded < 20, "a flight takes some room"
        assert answer.status_code == 429
        assert answer.json()["quota"]["name"] == "stored_bytes"
        used = client.get("/me").json()["quotas"]["stored_bytes"]["used"]
        assert 0 < used <= 20_000


def test_posts_that_race_do_not_share_the_last_place(keyed_service: RunningService) -> None:
    """Twelve posts at once for three places: three jobs."""
    key = make_key(keyed_service.database, "racer", quota=Quota(max_jobs_in_flight=3))
    statuses: list[int] = []
    together = threading.Barrier(12)

    def post() -> None:
        with holder(keyed_service, key.text) as client:
            together.wait()
            statuses.append(client.post("/simulate", json=simulate_document()).status_code)

    racers = [threading.Thread(target=post) for _ in range(12)]
    for racer in racers:
        racer.start()
    for racer in racers:
        racer.join()
    assert sorted(statuses) == [202] * 3 + [429] * 9


def test_a_reader_may_not_write(keyed_service: RunningService) -> None:
    """A key without the scope starts nothing, deletes nothing and learns what it lacks."""
    writer = make_key(keyed_service.database, "team")
    reader = make_key(keyed_service.database, "team", scopes=[Scope.JOBS_READ])
    with holder(keyed_service, writer.text) as writing, holder(keyed_service, reader.text) as reading:
        job = writing.post("/simulate", json=simulate_document()).raise_for_status().json()["id"]
        assert reading.get(f"/jobs/{job}").status_code == 200
        for refused in (
            reading.post("/simulate", json=simulate_document()),
            reading.post(f"/jobs/{job}/cancel"),
            reading.delete(f"/jobs/{job}"),
        ):
            assert refused.status_code == 403
            assert refused.json()["code"] == "missing_scope"
        assert reading.get(f"/jobs/{job}").json()["status"] == "queued"
