"""Laws of the endpoints for machines."""

from __future__ import annotations

from tests.app.request_documents import identify_document
from tests.app.running_service import RunningService


def test_alive_and_ready_without_a_broker(any_service: RunningService) -> None:
    """Without a broker the service is ready, for it accepts jobs, and tells that the broker is away."""
    assert any_service.client.get("/livez").json()["status"] == "alive"
    answer = any_service.client.get("/readyz")
    assert answer.status_code == 200
    assert answer.json() == {"status": "ready", "database": "ok", "broker": "unreachable"}


def test_metrics_count_jobs(any_service: RunningService) -> None:
    """The queue's depth is the number of jobs that wait."""
    for _ in range(2):
        any_service.client.post("/identify", json=identify_document()).raise_for_status()
    answer = any_service.client.get("/metrics")
    assert answer.headers["content-type"].startswith("text/plain; version=0.0.4")
    values = dict(line.rsplit(" ", 1) for line in answer.text.splitlines() if not line.startswith("#"))
    assert values["morphid_queue_depth"] == values['morphid_jobs{status="queued"}'] == "2"
    assert float(values["morphid_oldest_queued_seconds"]) > 0.0
