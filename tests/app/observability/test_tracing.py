"""Laws of traces."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from app.observability import tracing
from tests.app.request_documents import identify_document
from tests.app.running_service import RunningService
from tests.waiting import until
from worker.spans import PhaseSpans, attempt_span

pytest.importorskip("opentelemetry.sdk")

CALLER = "00-0123456789abcdef0123456789abcdef-0123456789abcdef-01"


SPAN_END_S = 5.0  # a request's span ends a moment after its answer went out


@pytest.fixture
def spans() -> Iterator[Callable[[str], dict[str, Any]]]:
    """Trace in this process; gives the ended spans by name once the one named is among them."""
    from opentelemetry.sdk.trace.export.in_memory_span_exporter import InMemorySpanExporter

    exporter = InMemorySpanExporter()
    assert tracing.start_tracing("test", "", exporter=exporter)

    def ended(name: str) -> dict[str, Any]:
        def found() -> dict[str, Any]:
            return {span.name: span for span in exporter.get_finished_spans()}

        until(lambda: name in found(), SPAN_END_S, seen=found)
        return found()

    yield ended
    tracing.stop_tracing()


def test_one_trace_from_the_caller_to_the_attempt(
    service: RunningService, spans: Callable[[str], dict[str, Any]]
) -> None:
    """The caller's trace goes on in the request, on the job's row, and in the worker's attempt and phases."""
    answer = service.client.post("/identify", json=identify_document(), headers={"traceparent": CALLER})
    claim = service.claim(answer.json()["id"])
    assert claim.traceparent is not None
    assert claim.request_id == answer.headers["x-request-id"]
    with attempt_span(claim):
        phases = PhaseSpans()
        for phase in ("swarm", "swarm", "polish"):
            phases.note(phase)
        phases.close()
    found = spans("POST /identify")
    request = found["POST /identify"]
    assert f"{request.context.trace_id:032x}" == CALLER.split("-")[1]
    assert f"{request.parent.span_id:016x}" == CALLER.split("-")[2]
    assert request.attributes["http.response.status_code"] == 202
    attempt = found["attempt identify"]
    for name, parent in (
        ("wait in the queue", request),
        ("attempt identify", request),
        ("swarm", attempt),
        ("polish", attempt),
    ):
        assert found[name].context.trace_id == request.context.trace_id
        assert found[name].parent.span_id == parent.context.span_id
    assert attempt.attributes["morphid.job_id"] == claim.job_id
    assert found["wait in the queue"].start_time <= found["wait in the queue"].end_time
    assert found["swarm"].end_time <= found["polish"].start_time + 1_000_000  # ns; two readings of two clocks


def test_a_server_error_is_marked(service: RunningService, spans: Callable[[str], dict[str, Any]]) -> None:
    """Refusals are no errors of the service's; a span of its own begins a trace of its own."""
    service.client.get("/jobs/job_none")
    span = spans("GET /jobs/{job_id}")["GET /jobs/{job_id}"]
    assert span.attributes["http.response.status_code"] == 404
    assert span.status.is_ok
    assert span.parent is None


def test_requests_of_one_connection_share_no_trace(
    service: RunningService, spans: Callable[[str], dict[str, Any]]
) -> None:
    """A kept connection whose reading was held up within a traced request hands its trace to no later one."""
    padded = json.dumps(identify_document()).encode() + b" " * 400_000  # more than the server reads ahead
    headers = {"traceparent": CALLER, "content-type": "application/json"}
    assert service.client.post("/identify", content=padded, headers=headers).status_code == 202
    service.client.get("/jobs")
    assert spans("GET /jobs")["GET /jobs"].parent is None


@pytest.mark.parametrize("nonsense", ["", "00-0-0-00", "ff" * 40, "00-" + "0" * 32 + "-" + "0" * 16 + "-01"])
def test_nonsense_from_callers_begins_a_new_trace(
    service: RunningService, spans: Callable[[str], dict[str, Any]], nonsense: str
) -> None:
    """A trace context that is none is left alone."""
    service.client.get("/jobs", headers={"traceparent": nonsense})
    assert spans("GET /jobs")["GET /jobs"].parent is None


def test_off_means_off(service: RunningService) -> None:
    """Unless configured there is no trace on the row, whatever the caller sends."""
    answer = service.client.post("/identify", json=identify_document(), headers={"traceparent": CALLER})
    assert service.claim(answer.json()["id"]).traceparent is None
    assert tracing.current_traceparent() is None
    with tracing.span("nothing", traceparent=CALLER) as nothing:
        assert not nothing.is_recording()
        assert tracing.current_trace_id() is None


@pytest.mark.parametrize(
    ("process", "tracing"),
    [
        ("app.main", {"opentelemetry.sdk"}),
        # the client of the broker, which a worker loads, imports the measuring half of the SDK by itself
        ("worker.tasks", {"opentelemetry.sdk.trace", "opentelemetry.exporter"}),
    ],
)
def test_off_imports_nothing(root: Path, process: str, tracing: set[str]) -> None:
    """A process that does not trace does not import what traces; a library may know the API of it."""
    program = (
        f"import sys, {process}; from app.observability.tracing import start_tracing; "
        f"start_tracing('x', ''); sys.exit(not {tracing!r}.isdisjoint(sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", program], cwd=root, check=False).returncode == 0


def test_missing_packages_are_reported(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Configured but not installed: the service runs without traces and says what to install."""
    monkeypatch.setitem(sys.modules, "opentelemetry.exporter.otlp.proto.http.trace_exporter", None)
    assert not tracing.start_tracing("test", "http://127.0.0.1:4318")
    assert "morphid[telemetry]" in caplog.text
