"""Laws of the endpoints for machines."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from prometheus_client.parser import text_string_to_metric_families
from sqlalchemy import update

from app.database import downgrade
from app.health import metrics
from app.health import service as health
from app.health.broker import broker_state
from app.health.presence import Sign, note_started, note_stopped, process_identity
from app.jobs import store
from app.jobs.reaper import reap
from app.settings import Settings
from app.tables import workers
from morphid.broker import prepare_broker
from morphid.supervisor import Supervisor
from tests.app.request_documents import identify_document
from tests.app.running_service import RunningService, running_service
from tests.waiting import until

Samples = dict[tuple[str, tuple[tuple[str, str], ...]], float]


def scraped(service: RunningService) -> Samples:
    """Read the metrics as Prometheus does."""
    answer = service.client.get("/metrics")
    assert answer.headers["content-type"].startswith("text/plain; version=0.0.4")
    return {
        (sample.name, tuple(sorted(sample.labels.items()))): sample.value
        for family in text_string_to_metric_families(answer.text)
        for sample in family.samples
    }


@pytest.fixture(autouse=True)
def _always_looks_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    """Answers are not remembered: the service runs in a thread of this process."""
    monkeypatch.setattr(metrics, "FRESH_S", 0.0)
    monkeypatch.setattr(health, "FRESH_S", 0.0)


def submitted(service: RunningService) -> str:
    """Post a job."""
    job: str = service.client.post("/identify", json=identify_document()).raise_for_status().json()["id"]
    return job


def test_without_broker_and_workers_the_service_is_degraded(any_service: RunningService) -> None:
    """Jobs are taken and kept while broker and workers are away: 200, and the truth about each part.

    A strict check returns 503.
    """
    assert any_service.client.get("/livez").json()["status"] == "alive"
    answer = any_service.client.get("/readyz")
    assert answer.status_code == 200
    assert answer.json() == {
        "status": "degraded",
        "database": "ok",
        "broker": "unreachable",
        "workers": {"status": "none", "alive": 0, "stalled": 0, "slots": 0, "busy": 0},
    }
    assert any_service.client.get("/readyz", params={"strict": True}).status_code == 503


def test_metrics_count_jobs(any_service: RunningService) -> None:
    """Rows and metrics agree: depth of the queue, attempts, ends, lost leases, waits, run times."""
    first, second = submitted(any_service), submitted(any_service)
    submitted(any_service)
    claim = any_service.claim(first)
    any_service.progress(claim, fraction=0.5, flights_per_s=120.0)
    lost = any_service.claim(second)
    with any_service.database.write() as session:
        store.renew_lease(session, lost, -1.0)
        reap(session)
    during = scraped(any_service)
    assert during["morphid_queue_depth", ()] == during["morphid_jobs", (("status", "queued"),)] == 2
    assert during["morphid_oldest_queued_seconds", ()] > 0.0
    assert during["morphid_flights_per_second", ()] == 120.0
    assert during["morphid_leases_lost_total", ()] == 1
    assert during["morphid_job_attempts_total", (("operation", "identify"),)] == 2
    assert during["morphid_job_wait_seconds_count", (("operation", "identify"),)] == 2
    any_service.finish(claim, "failed", error={"code": "diverged", "detail": "", "hint": ""})
    after = scraped(any_service)
    ended = (("operation", "identify"), ("status", "failed"))
    assert after["morphid_jobs_finished_total", ended] == after["morphid_jobs", (("status", "failed"),)] == 1
    assert after["morphid_job_run_seconds_count", (("operation", "identify"),)] == 1
    assert after["morphid_flights_per_second", ()] == 0.0
    for (name, labels), value in during.items():
        if name.endswith(("_total", "_bucket", "_count")):
            assert after[name, labels] >= value, f"{name} fell: it is no counter"


def test_requests_are_measured_by_route(service: RunningService) -> None:
    """The route label does not depend on the number of jobs; waiting requests do not distort the latency."""
    job = submitted(service)
    route = (("method", "GET"), ("route", "/jobs/{job_id}"))

    def seen(status: str, waited: str = "no") -> float:
        labels = (*route, ("status", status), ("waited", waited))
        return scraped(service).get(("morphid_http_request_seconds_count", tuple(sorted(labels))), 0.0)

    before = seen("2xx"), seen("4xx"), seen("2xx", "yes")
    for name in (job, job, "job_none"):
        service.client.get(f"/jobs/{name}")
    service.client.get(f"/jobs/{job}", headers={"Prefer": "wait=1"})
    assert (seen("2xx"), seen("4xx"), seen("2xx", "yes")) == (before[0] + 2, before[1] + 1, before[2] + 1)
    routes = {dict(labels).get("route") for name, labels in scraped(service) if "http_request" in name}
    assert not any(job in (each or "") for each in routes)
    service.client.get("/nothing/here")
    service.client.get("/static/app.js")
    routes = {dict(labels).get("route") for name, labels in scraped(service) if "http_request" in name}
    assert {"unrouted", "/static"} <= routes, routes


@pytest.fixture(scope="module")
def equipped(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[RunningService, Supervisor]]:
    """A service with a real broker behind a password."""
    folder = tmp_path_factory.mktemp("equipped")
    supervisor = Supervisor(folder / "logs", report=lambda _sentence: None)
    broker = prepare_broker(folder)
    child = supervisor.start(broker.spec)
    assert supervisor.wait_until(child, broker.answers, 10.0)
    settings = Settings(
        database_url=f"sqlite:///{folder / 'service.sqlite3'}",
        broker_url=broker.url,
    )
    with running_service(settings) as service:
        yield service, supervisor
    supervisor.stop()


def parts(service: RunningService) -> tuple[str, str, str]:
    """Request readiness again: overall, broker, workers."""
    reported = service.client.get("/readyz").json()
    return reported["status"], reported["broker"], reported["workers"]["status"]


def test_workers_that_fall_silent_are_stalled(equipped: tuple[RunningService, Supervisor]) -> None:
    """A worker is ok while it signs, stalled when it ceases to or has no slots, none after its goodbye."""
    service, _ = equipped
    with service.database.write() as session:
        note_started(session, Sign("host:1", "1", slots=2, busy=1))
    assert service.client.get("/readyz").json()["workers"]["slots"] == 2
    with service.database.write() as session:
        note_started(session, Sign("host:1", "1", slots=2, busy=1))
    assert parts(service) == ("ready", "ok", "ok")
    silent_s = 4 * service.settings.worker_seen_every_s  # three signs of life and some
    with service.database.write() as session:
        session.execute(update(workers).values(seen_at=workers.c.seen_at - silent_s))
    assert parts(service) == ("degraded", "ok", "stalled")
    with service.database.write() as session:
        note_started(session, Sign("host:1", "1", slots=0, busy=0))
    assert parts(service) == ("degraded", "ok", "stalled")
    with service.database.write() as session:
        note_stopped(session, "host:1")
    assert parts(service) == ("degraded", "ok", "none")
    counts = scraped(service)
    assert counts["morphid_workers", (("status", "alive"),)] == 0


def started_worker(service: RunningService, process: str | None) -> None:
    """Sign for a worker of some process."""
    with service.database.write() as session:
        note_started(session, Sign("host:2", "1", slots=1, busy=0, process=process))


def age_sign(service: RunningService, by_s: float) -> None:
    """Let time pass since the last sign of every worker."""
    with service.database.write() as session:
        session.execute(update(workers).values(seen_at=workers.c.seen_at - by_s))


def test_a_worker_whose_process_has_ended_is_gone(equipped: tuple[RunningService, Supervisor]) -> None:
    """Killed, it leaves the list at once, not after its silence has been noticed; also as a zombie."""
    service, _ = equipped
    process = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    identity = process_identity(process.pid)
    assert identity is not None
    started_worker(service, identity)
    assert parts(service) == ("ready", "ok", "ok")
    process.kill()
    until(lambda: parts(service) == ("degraded", "ok", "none"))  # nobody has waited for it yet
    process.wait()
    assert process.stdin is not None
    process.stdin.close()
    assert parts(service) == ("degraded", "ok", "none")


def test_another_process_of_the_same_number_is_another(
    equipped: tuple[RunningService, Supervisor],
) -> None:
    """Numbers are given out again: a process that has ours and began at another moment is not the worker."""
    service, _ = equipped
    identity = process_identity(os.getpid())
    assert identity is not None
    started_worker(service, identity)
    assert parts(service) == ("ready", "ok", "ok")
    started_worker(service, f"{identity.rpartition('/')[0]}/1")
    assert parts(service) == ("degraded", "ok", "none")


@pytest.mark.parametrize("elsewhere", ["another-boot/pid:[1]/7/9", None])
def test_a_silent_worker_elsewhere_is_gone_within_a_minute(
    equipped: tuple[RunningService, Supervisor], elsewhere: str | None
) -> None:
    """Whose process cannot be looked for is stalled when silent, and gone after 60 s; ours stay stalled."""
    service, _ = equipped
    started_worker(service, elsewhere)
    age_sign(service, 55.0)
    assert parts(service) == ("degraded", "ok", "stalled")
    age_sign(service, 6.0)
    assert parts(service) == ("degraded", "ok", "none")
    started_worker(service, process_identity(os.getpid()))
    age_sign(service, 600.0)
    assert parts(service) == ("degraded", "ok", "stalled"), "it is there, and hangs"


def test_the_broker_is_asked_with_its_password(equipped: tuple[RunningService, Supervisor]) -> None:
    """A broker whose password is another one is not ok, nor is one that hangs, though its port is open."""
    service, supervisor = equipped
    url = service.settings.broker_url
    address = url.rpartition("@")[2]
    assert broker_state(url) == "ok"
    assert broker_state(f"redis://:wrong@{address}") == "refuses our password"
    assert broker_state(f"redis://{address}") == "refuses our password"
    assert broker_state("amqp://elsewhere") == "not checked (no Redis)"
    pid = supervisor.children["broker"].pid
    assert pid is not None
    os.kill(pid, signal.SIGSTOP)
    try:
        assert broker_state(url) == "unreachable"
    finally:
        os.kill(pid, signal.SIGCONT)


def test_an_unmigrated_database_is_not_ready(
    tmp_path: Path, equipped: tuple[RunningService, Supervisor]
) -> None:
    """Without its tables the service cannot serve: 503."""
    settings = Settings(
        database_url=f"sqlite:///{tmp_path / 'empty.sqlite3'}", broker_url=equipped[0].settings.broker_url
    )
    with running_service(settings) as service:
        downgrade(settings.database_url, "base")
        answer = service.client.get("/readyz")
        assert answer.status_code == 503
        assert (answer.json()["status"], answer.json()["database"]) == ("not_ready", "not migrated")
        assert answer.json()["workers"]["status"] == "unknown"
