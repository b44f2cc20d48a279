"""Traces from the request to the worker (OpenTelemetry), where the operator asks for them.

Asked for by ``MORPHID_TRACES=http://collector:4318`` or by OpenTelemetry's ``OTEL_EXPORTER_OTLP_ENDPOINT``.
Otherwise nothing of OpenTelemetry is imported and every function here does nothing.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Literal
from urllib.parse import urlsplit

from app.loopback import is_loopback

ENDPOINT_VARIABLES = ("OTEL_EXPORTER_OTLP_TRACES_ENDPOINT", "OTEL_EXPORTER_OTLP_ENDPOINT")
TRACES_PATH = "/v1/traces"
FLUSH_MS = 3_000  # at the end of a process; a collector that is away must not hold it up

Kind = Literal["server", "consumer", "internal"]
Attributes = Mapping[str, str | int | float | bool]

log = logging.getLogger(__name__)


@dataclass
class _Tracing:
    """What is there once tracing has begun in this process."""

    provider: Any = None
    tracer: Any = None


_tracing = _Tracing()


def asked_for(traces: str) -> bool:
    """Whether the settings (`traces`: the one of MORPHID_TRACES) or the environment ask for traces."""
    return bool(traces) or any(os.environ.get(name) for name in ENDPOINT_VARIABLES)


def start_tracing(service: str, traces: str, *, exporter: Any = None) -> bool:
    """Begin to trace in this process, if asked to; in a forked child, after the fork.

    Parameters
    ----------
    service : name of this kind of process, "morphid-api".
    traces : address of an OTLP collector that takes HTTP; empty: as OpenTelemetry's own variables say.
    exporter : takes the place of the collector, in tests.

    Returns
    -------
    bool
        Whether this process traces now.
    """
    if exporter is None and not asked_for(traces):
        return False
    try:
        from opentelemetry.exporter.otlp.proto.http.trace_exporter import OTLPSpanExporter
        from opentelemetry.sdk.resources import Resource
        from opentelemetry.sdk.trace import TracerProvider
        from opentelemetry.sdk.trace.export import BatchSpanProcessor, SimpleSpanProcessor
    except ImportError:
        log.warning("traces are asked for but OpenTelemetry is missing: pip install 'morphid[telemetry]'")
        return False
    from app.version import VERSION

    stop_tracing()
    resource = Resource.create(
        {"service.name": os.environ.get("OTEL_SERVICE_NAME", service), "service.version": VERSION}
    )
    provider = TracerProvider(resource=resource, shutdown_on_exit=False)
    if exporter is None:
        endpoint = traces.rstrip("/") + TRACES_PATH if traces and TRACES_PATH not in traces else traces
        sent_by = OTLPSpanExporter(endpoint=endpoint or None, session=_session_for(traces))
        provider.add_span_processor(BatchSpanProcessor(sent_by))
    else:
        provider.add_span_processor(SimpleSpanProcessor(exporter))
    _tracing.provider, _tracing.tracer = provider, provider.get_tracer("morphid", VERSION)
    return True


def _session_for(traces: str) -> Any:
    """An HTTP session that asks for no proxy, for a collector on this machine; None: the exporter's own."""
    from requests import Session  # which the exporter brings

    address = traces or next(filter(None, map(os.environ.get, ENDPOINT_VARIABLES)), "")
    if not is_loopback(urlsplit(address).hostname or ""):
        return None
    session = Session()
    session.trust_env = False
    return session


def stop_tracing() -> None:
    """Send what waits, for `FLUSH_MS` at most, and trace no more."""
    provider, _tracing.provider, _tracing.tracer = _tracing.provider, None, None
    if provider is not None:
        provider.force_flush(FLUSH_MS)
        provider.shutdown()


def forget_tracing() -> None:
    """Leave a parent's tracing alone in its forked child: its threads do not live here."""
    _tracing.provider = _tracing.tracer = None


class Span:
    """The part of a span that the service uses; this one is not recorded anywhere."""

    def rename(self, name: str) -> None:
        """Give the span its final name."""

    def note(self, attributes: Attributes) -> None:
        """Add attributes."""

    def fail(self, reason: str) -> None:
        """Mark it as failed."""


NO_SPAN = Span()


class _RecordedSpan(Span):
    def __init__(self, span: Any) -> None:
        self._span = span

    def rename(self, name: str) -> None:
        self._span.update_name(name)

    def note(self, attributes: Attributes) -> None:
        self._span.set_attributes(dict(attributes))

    def fail(self, reason: str) -> None:
        from opentelemetry.trace import Status, StatusCode

        self._span.set_status(Status(StatusCode.ERROR, reason))


@contextmanager
def span(
    name: str,
    *,
    kind: Kind = "internal",
    traceparent: str | None = None,
    attributes: Attributes | None = None,
) -> Iterator[Span]:
    """Trace a block of work.

    Parameters
    ----------
    traceparent : W3C context of another process's span that this one belongs to; else it belongs to the span
        that is current here.
    """
    if _tracing.tracer is None:
        yield NO_SPAN
        return
    from opentelemetry.trace import SpanKind

    with _tracing.tracer.start_as_current_span(
        name,
        context=_context_of(traceparent),
        kind=SpanKind[kind.upper()],
        attributes=dict(attributes or {}),
        record_exception=True,
    ) as current:
        yield _RecordedSpan(current)


def past_span(name: str, *, seconds: float, ago_s: float = 0.0, traceparent: str | None = None) -> None:
    """Trace something that lasted `seconds` and ended `ago_s` ago."""
    if _tracing.tracer is None:
        return
    from time import time_ns

    ended = time_ns() - int(ago_s * 1e9)
    began = ended - int(max(seconds, 0.0) * 1e9)
    _tracing.tracer.start_span(name, context=_context_of(traceparent), start_time=began).end(ended)


def current_traceparent() -> str | None:
    """W3C trace context of the span that is current here, to be handed to another process."""
    context = _current_context()
    if context is None:
        return None
    return f"00-{context.trace_id:032x}-{context.span_id:016x}-{int(context.trace_flags):02x}"


def current_trace_id() -> str | None:
    """Id of the trace that is current here."""
    context = _current_context()
    return None if context is None else f"{context.trace_id:032x}"


def _current_context() -> Any:
    if _tracing.tracer is None:
        return None
    from opentelemetry.trace import get_current_span

    context = get_current_span().get_span_context()
    return context if context.is_valid else None


def _context_of(traceparent: str | None) -> Any:
    if not traceparent:
        return None
    from opentelemetry.trace.propagation.tracecontext import TraceContextTextMapPropagator

    return TraceContextTextMapPropagator().extract({"traceparent": traceparent})
