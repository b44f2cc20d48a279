"""Ten thousand queued jobs while workers work: jobs are shown fast, nobody waits for another's queue."""

from __future__ import annotations

import random
from collections.abc import Callable

import httpx
import pytest

from app.jobs.queue import publish
from app.jobs.store import Terms, create_job, get_job
from tests.faults.rig import OWNER, Rig
from tests.load.conftest import Tell
from tests.load.figures import Times, timed
from tests.load.filling import fill

pytestmark = [pytest.mark.slow, pytest.mark.timed]

QUEUED = 10_000
STATUS_P95_MS, LIST_P95_MS = 50.0, 100.0
ROUNDS = 3  # the machine has other things to do at times: the best of so many is judged
JOB_S = 1.0


def best(limit_ms: float, measure: Callable[[], Times]) -> Times:
    """The least disturbed of some measurements; the first one that keeps the limit ends them."""
    found = measure()
    for _ in range(ROUNDS - 1):
        if found.p95_ms < limit_ms:
            break
        found = min(found, measure(), key=lambda times: times.p95_ms)
    return found


def test_looking_at_jobs(rig: Rig, tell: Tell) -> None:
    """10,000 jobs queued, two at work: a job is shown within 50 ms, a page within 100 ms (p95)."""
    ids = fill(rig.database, OWNER, QUEUED, steps=10, pause_s=0.05)
    rig.start_api()
    rig.start_worker(slots=2)
    for job_id in ids[:4]:
        publish(job_id, rig.broker.url)
    rig.until(lambda: rig.job(ids[0]).finished, 60.0)
    chosen = random.Random(1)
    with httpx.Client(base_url=rig.url, timeout=10.0) as client, rig.tended():

        def status() -> Times:
            paths = [f"/jobs/{chosen.choice(ids)}" for _ in range(200)]
            return Times.of(timed(lambda at=path: client.get(at).raise_for_status()) for path in paths)

        def page(**filters: object) -> Times:
            call = lambda: client.get("/jobs", params=filters).raise_for_status()  # noqa: E731
            return Times.of(timed(call) for _ in range(60))

        shown = best(STATUS_P95_MS, status)
        tell(f"GET /jobs/{{id}}, {QUEUED} queued: {shown}")
        lists = {
            "GET /jobs": best(LIST_P95_MS, page),
            "GET /jobs?limit=200": best(LIST_P95_MS, lambda: page(limit=200)),
            "GET /jobs?status=failed": best(LIST_P95_MS, lambda: page(status="failed")),
            "GET /jobs?label=none": best(LIST_P95_MS, lambda: page(label="none")),
            "GET /jobs?created_before=": best(
                LIST_P95_MS, lambda: page(created_before="2000-01-01T00:00:00Z")
            ),
        }
        for name, times in lists.items():
            tell(f"{name}, {QUEUED} jobs: {times}")
        assert rig.job(ids[QUEUED // 2]).status == "queued", "the queue was as long as it should be"
    assert shown.p95_ms < STATUS_P95_MS
    assert max(times.p95_ms for times in lists.values()) < LIST_P95_MS


def test_a_short_queue_next_to_a_long_one(rig: Rig, tell: Tell) -> None:
    """Of two tenants one has 5,000 jobs queued: each job of the other starts within two job lengths."""
    many = fill(rig.database, "many", 5_000, steps=10, pause_s=JOB_S / 10)
    for job_id in many:
        assert publish(job_id, rig.broker.url)
    rig.start_worker()
    rig.until(lambda: _finished(rig, "many", many[0]), 60.0)
    waits = []
    for _ in range(5):
        with rig.database.write() as session:
            request = {"seed": 1, "steps": 10, "pause_s": JOB_S / 10}
            job = create_job(session, owner="few", operation="walk", request=request, terms=Terms())
        publish(job.id, rig.broker.url)
        rig.until(lambda at=job.id: _finished(rig, "few", at), 30.0)
        with rig.database.read() as session:
            done = get_job(session, "few", job.id)
            other = get_job(session, "many", many[0])
        assert done.started_at is not None
        waits.append((done.started_at - done.created_at).total_seconds())
        assert other.started_at is not None
        assert other.finished_at is not None
        length_s = (other.finished_at - other.started_at).total_seconds()
    tell(
        f"5,000 jobs of another's before it: starts after {', '.join(f'{wait:.2f}' for wait in waits)} s; "
        f"a job takes {length_s:.2f} s"
    )
    assert max(waits) < 2.0 * length_s


def _finished(rig: Rig, owner: str, job_id: str) -> bool:
    with rig.database.read() as session:
        return get_job(session, owner, job_id).finished
