"""Records every request in the log, in the latency histogram and, if configured, as a span."""

from __future__ import annotations

import logging
import time
from dataclasses import dataclass, field

from opentelemetry.trace import StatusCode
from starlette.datastructures import Headers
from starlette.types import Message, Receive, Scope, Send

from app.http.context import caller_of
from app.http.middleware import HttpMiddleware
from app.observability.request_metrics import IN_FLIGHT, LATENCY
from app.observability.tracing import span

METHODS = frozenset({"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})
UNROUTED = "unrouted"  # refused before routing, or no route
STATIC = "/static"
QUIET_ROUTES = frozenset({"/livez", "/readyz", "/metrics", STATIC})  # requested by machines all day
MAX_PATH = 300  # characters in a line of the log
CLIENT_WENT = 499  # nginx's status for a client that closed the connection

access = logging.getLogger("morphid.access")


class Observed(HttpMiddleware):
    """ASGI middleware around everything but the request id."""

    async def serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request and record it."""
        exchange = _Exchange(scope)
        traceparent = Headers(scope=scope).get("traceparent", "")

        async def watched_send(message: Message) -> None:
            if message["type"] == "http.response.start":
                exchange.answer(message["status"])
            await send(message)

        with (
            IN_FLIGHT.track_inprogress(),
            span(scope["method"], kind="server", traceparent=traceparent) as traced,
        ):
            try:
                await self.app(scope, receive, watched_send)
            except Exception:
                if exchange.status != 500:
                    raise
                # answered and logged by the handler of unexpected errors, which re-raises it for the server
            finally:
                if exchange.status == 0:
                    exchange.answer(CLIENT_WENT)
                route = exchange.route
                traced.update_name(f"{scope['method']} {route}")
                traced.set_attributes({"http.route": route, "http.response.status_code": exchange.status})
                if exchange.status >= 500:
                    traced.set_status(StatusCode.ERROR, str(exchange.status))
                exchange.log()


@dataclass
class _Exchange:
    """The course of one request."""

    scope: Scope
    began: float = field(default_factory=time.perf_counter)
    status: int = 0
    answered_s: float = 0.0

    @property
    def route(self) -> str:
        """The path's template, so that a label does not have as many values as there are jobs."""
        template = getattr(self.scope.get("route"), "path", None)
        if isinstance(template, str) and template:
            return template
        return STATIC if self.scope["path"].startswith(STATIC + "/") else UNROUTED

    def answer(self, status: int) -> None:
        """Record the start of the response; streams may last arbitrarily long."""
        self.status = status
        self.answered_s = time.perf_counter() - self.began
        method = self.scope["method"]
        LATENCY.labels(
            method=method if method in METHODS else "other",
            route=self.route,
            status=f"{status // 100}xx",
            waited="yes" if "wait" in Headers(scope=self.scope).get("prefer", "") else "no",
        ).observe(self.answered_s)

    def log(self) -> None:
        """Write the line of the access log."""
        level = logging.WARNING if self.status >= 500 else logging.INFO
        if self.route in QUIET_ROUTES and self.status < 400:
            level = logging.DEBUG
        if not access.isEnabledFor(level):
            return
        scope, caller = self.scope, caller_of(self.scope)
        facts = {
            "method": scope["method"],
            "route": self.route,
            "path": scope["path"][:MAX_PATH],  # without the query, which may contain private data
            "status": self.status,
            "answered_s": round(self.answered_s, 4),
            "duration_s": round(time.perf_counter() - self.began, 4),
            "client": scope["client"][0] if scope.get("client") else None,
            "owner": None if caller is None else caller.owner,
            "key_id": None if caller is None else caller.key_id,
        }
        facts = {name: fact for name, fact in facts.items() if fact is not None}
        access.log(level, "%s %s %d", scope["method"], facts["path"], self.status, extra={"facts": facts})
