"""Traces from the request to the worker (OpenTelemetry), if the operator configures them.

Set ``MORPHID_TRACES=http://collector:4318`` or OpenTelemetry's own ``OTEL_EXPORTER_OTLP_ENDPOINT``. Otherwise
OpenTelemetry's SDK is not imported, and its API's tracer records nothing.
"""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any, Literal
from urllib.parse import urlsplit

from opentelemetry.context import Context
from opentelemetry.trace import NoOpTracer, Span, SpanKind, Tracer, get_current_span
from opentelemetry.trace.propagation.tracecontext import TraceContextTextMapPropagator

from app.loopback import is_loopback

ENDPOINT_VARIABLES = ("OTEL_EXPORTER_OTLP_TRACES_ENDPOINT", "OTEL_EXPORTER_OTLP_ENDPOINT")
TRACES_PATH = "/v1/traces"
FLUSH_MS = 3_000  # ms at the end of a process; an unreachable collector must not delay it

Kind = Literal["server", "consumer", "internal"]
Attributes = Mapping[str, str | int | float | bool]

log = logging.getLogger(__name__)


@dataclass
class _Tracing:
    """The tracer of this process; one that records nothing as long as there is no provider."""

    provider: Any = None
    tracer: Tracer = NoOpTracer()  # noqa: RUF009 - it has no state


_tracing = _Tracing()


def collector_address(traces: str) -> str:
    """Address from the settings (`traces`: that of MORPHID_TRACES) or the environment; empty: no traces."""
    return traces or next(filter(None, map(os.environ.get, ENDPOINT_VARIABLES)), "")


def start_tracing(service: str, traces: str, *, exporter: Any = None) -> bool:
    """Start tracing in this process, if configured; in a forked child, after the fork.

    Parameters
    ----------
    service : str
        Name of this kind of process, "morphid-api".
    traces : str
        Address of an OTLP collector that takes HTTP; empty: as OpenTelemetry's own variables say.
    exporter : SpanExporter, optional
        Takes the place of the collector, in tests.

    Returns
    -------
    bool
        Whether this process traces now.
    """
    address = collector_address(traces)
    if exporter is None and not address:
        return False
    try:
        from opentelemetry.exporter.otlp.proto.http.trace_exporter import OTLPSpanExporter
        from opentelemetry.sdk.resources import Resource
        from opentelemetry.sdk.trace import TracerProvider
        from opentelemetry.sdk.trace.export import BatchSpanProcessor, SimpleSpanProcessor
    except ImportError:
        log.warning("traces are configured but OpenTelemetry is missing: pip install 'morphid[telemetry]'")
        return False
    from morphdata.version import VERSION

    stop_tracing()
    resource = Resource.create(
        {"service.name": os.environ.get("OTEL_SERVICE_NAME", service), "service.version": VERSION}
    )
    provider = TracerProvider(resource=resource, shutdown_on_exit=False)
    if exporter is None:
        endpoint = traces.rstrip("/") + TRACES_PATH if traces and TRACES_PATH not in traces else traces
        own = OTLPSpanExporter(endpoint=endpoint or None, session=_session_for(address))
        provider.add_span_processor(BatchSpanProcessor(own))
    else:
        provider.add_span_processor(SimpleSpanProcessor(exporter))
    _tracing.provider, _tracing.tracer = provider, provider.get_tracer("morphid", VERSION)
    return True


def _session_for(address: str) -> Any:
    """An HTTP session that uses no proxy, for a collector on this machine; None: the exporter's own."""
    from requests import Session  # which the exporter brings

    if not is_loopback(urlsplit(address).hostname or ""):
        return None
    session = Session()
    session.trust_env = False
    return session


def stop_tracing() -> None:
    """Send what is waiting, for `FLUSH_MS` at most, and stop tracing."""
    provider = _tracing.provider
    forget_tracing()
    if provider is not None:
        provider.force_flush(FLUSH_MS)
        provider.shutdown()


def forget_tracing() -> None:
    """Discard the parent's tracing in a forked child, where its threads do not exist."""
    _tracing.provider, _tracing.tracer = None, NoOpTracer()


def span(
    name: str,
    *,
    kind: Kind = "internal",
    traceparent: str | None = None,
    attributes: Attributes | None = None,
) -> AbstractContextManager[Span]:
    """Trace a block of work, as part of another process's span (`traceparent`) or of the current one."""
    return _tracing.tracer.start_as_current_span(
        name, context=_context_of(traceparent), kind=SpanKind[kind.upper()], attributes=dict(attributes or {})
    )


def past_span(name: str, *, seconds: float, ago_s: float = 0.0, traceparent: str | None = None) -> None:
    """Trace something that lasted `seconds` and ended `ago_s` ago."""
    ended = time.time_ns() - int(ago_s * 1e9)
    began = ended - int(max(seconds, 0.0) * 1e9)
    _tracing.tracer.start_span(name, context=_context_of(traceparent), start_time=began).end(ended)


def current_traceparent() -> str | None:
    """W3C trace context of the current span, to be passed to another process."""
    carrier: dict[str, str] = {}
    TraceContextTextMapPropagator().inject(carrier)
    return carrier.get("traceparent")


def current_trace_id() -> str | None:
    """Id of the trace that is current here."""
    context = get_current_span().get_span_context()
    return f"{context.trace_id:032x}" if context.is_valid else None


def _context_of(traceparent: str | None) -> Context | None:
    # even a tracer that records nothing would pass on a caller's trace
    if not traceparent or _tracing.provider is None:
        return None
    return TraceContextTextMapPropagator().extract({"traceparent": traceparent})
