"""One request seen in the logs, the metrics and the traces of real processes."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any

import httpx
import pytest
from prometheus_client.parser import text_string_to_metric_families

from tests.app.request_documents import simulate_document
from tests.live import LiveService
from tests.waiting import until

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]  # may have to compile the kernels first

TRACE = "0123456789abcdef0123456789abcdef"
CALLER = {"traceparent": f"00-{TRACE}-0123456789abcdef-01", "X-Request-ID": "seen-everywhere"}


@dataclass
class Collector:
    """An OpenTelemetry collector: takes what real exporters send, as protobuf over HTTP."""

    spans: list[tuple[str, Any]] = field(default_factory=list)  # service and span

    def start(self) -> str:
        """Listen; give the address."""
        from opentelemetry.proto.collector.trace.v1.trace_service_pb2 import ExportTraceServiceRequest

        collector = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                """Take a batch."""
                import gzip

                body = self.rfile.read(int(self.headers["Content-Length"]))
                if self.headers.get("Content-Encoding") == "gzip":
                    body = gzip.decompress(body)
                assert self.path == "/v1/traces"
                for resource in ExportTraceServiceRequest.FromString(body).resource_spans:
                    names = {each.key: each.value.string_value for each in resource.resource.attributes}
                    for scope in resource.scope_spans:
                        collector.spans.extend((names["service.name"], span) for span in scope.spans)
                self.send_response(200)
                self.end_headers()

            def log_message(self, *_: Any) -> None:
                """Say nothing."""

        self.server = HTTPServer(("127.0.0.1", 0), Handler)
        threading.Thread(target=self.server.serve_forever, daemon=True).start()
        return f"http://127.0.0.1:{self.server.server_port}"

    def of_trace(self) -> dict[str, tuple[str, Any]]:
        """Spans of the caller's trace by name."""
        return {span.name: (name, span) for name, span in self.spans if span.trace_id.hex() == TRACE}

    def stop(self) -> None:
        """Listen no more."""
        self.server.shutdown()
        self.server.server_close()


@pytest.fixture(scope="module")
def collector() -> Iterator[Collector]:
    """A collector that listens."""
    pytest.importorskip("opentelemetry.proto")
    collector = Collector()
    collector.address = collector.start()  # type: ignore[attr-defined]
    yield collector
    collector.stop()


@pytest.fixture(scope="module")
def live(collector: Collector, tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveService]:
    """A service that logs everything."""
    environment = {
        "MORPHID_LOG_FORMAT": "json",
        "MORPHID_TRACES": collector.address,  # type: ignore[attr-defined]
        "OTEL_BSP_SCHEDULE_DELAY": "200",
    }
    service = LiveService(tmp_path_factory.mktemp("observed"), environment=environment).start()
    yield service
    service.stop()


@pytest.fixture(scope="module")
def job(live: LiveService) -> dict[str, Any]:
    """A flight that ran."""
    posted = httpx.post(f"{live.url}/simulate", json=simulate_document(), headers=CALLER)
    assert posted.headers["x-request-id"] == CALLER["X-Request-ID"]
    location = f"{live.url}{posted.headers['location']}"
    job: dict[str, Any] = {"status": "queued"}
    while job["status"] in {"queued", "running"}:
        job = httpx.get(location, headers={"Prefer": "wait=30"}, timeout=60.0).json()
    return job


def lines(path: Path) -> list[dict[str, Any]]:
    """Each line of a log as JSON; what is written before logging begins is not JSON, and little."""
    found, other = [], []
    for line in path.read_text().splitlines():
        try:
            found.append(json.loads(line))
        except ValueError:
            other.append(line)
    assert len([line for line in other if line.strip()]) <= 8, other
    return found


def test_one_request_id_in_all_logs(live: LiveService, job: dict[str, Any]) -> None:
    """API and worker write JSON; the request's id leads from its access line to all lines of the attempt."""
    access = [
        each for each in lines(live.data_dir / "logs" / "api.log") if each["logger"] == "morphid.access"
    ]
    posted = [each for each in access if each.get("request_id") == CALLER["X-Request-ID"]]
    assert [(each["route"], each["status"], each["trace_id"]) for each in posted] == [
        ("/simulate", 202, TRACE)
    ]
    worker = lines(live.data_dir / "logs" / "worker.log")
    mine = [each for each in worker if each.get("job_id") == job["id"]]
    assert len(mine) >= 2, worker
    for each in mine:
        assert (each["request_id"], each["attempt"]) == (CALLER["X-Request-ID"], 1)
        assert each["trace_id"] == TRACE
        assert each["worker"]
    assert all({"time", "level", "logger", "message"} <= set(each) for each in access + worker)


def test_one_trace_through_all_processes(
    live: LiveService, collector: Collector, job: dict[str, Any]
) -> None:
    """The spans that reach the collector hang together: caller, request, wait and attempt, phases."""
    assert job["status"] == "succeeded", live.logs()
    wanted = {"POST /simulate", "wait in the queue", "attempt simulate"}
    until(lambda: wanted <= collector.of_trace().keys(), seen=collector.of_trace)
    found = collector.of_trace()
    service, request = found["POST /simulate"]
    assert service == "morphid-api"
    assert request.parent_span_id.hex() == "0123456789abcdef"
    service, attempt = found["attempt simulate"]
    assert service == "morphid-worker"
    assert attempt.parent_span_id == found["wait in the queue"][1].parent_span_id == request.span_id
    phases = [span for _, span in found.values() if span.parent_span_id == attempt.span_id]
    assert phases


def test_metrics_of_real_work(live: LiveService, job: dict[str, Any]) -> None:
    """What the processes did is in the numbers, in the format that Prometheus reads."""
    text = httpx.get(f"{live.url}/metrics").text
    samples = {
        (sample.name, sample.labels.get("status", "")): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }
    assert samples["morphid_jobs_finished_total", job["status"]] == 1
    assert samples["morphid_workers", "alive"] == 1
    assert samples["morphid_worker_slots", ""] == 1
