"""Every request leaves a line in the log, a place in the latency histogram and, where asked for, a span."""

from __future__ import annotations

import logging
import time
from dataclasses import dataclass

from opentelemetry.trace import StatusCode
from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.http.context import caller_of
from app.observability.request_metrics import IN_FLIGHT, LATENCY
from app.observability.tracing import span

METHODS = frozenset({"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})
UNROUTED = "unrouted"  # refused before a route was found, or there is none
STATIC = "/static"
QUIET_ROUTES = frozenset({"/livez", "/readyz", "/metrics", STATIC})  # asked by machines all day
MAX_PATH = 300  # characters in a line of the log
CLIENT_WENT = 499  # nginx' number for a client that did not wait for its answer

access = logging.getLogger("morphid.access")


@dataclass
class _Exchange:
    """What becomes of one request."""

    began: float
    status: int = 0
    answered_s: float = 0.0

    def answer(self, scope: Scope, status: int) -> None:
        """Note that the answer begins; streams go on for as long as their clients like."""
        self.status = status
        self.answered_s = time.perf_counter() - self.began
        LATENCY.labels(
            method=scope["method"] if scope["method"] in METHODS else "other",
            route=_route(scope),
            status=f"{status // 100}xx",
            waited="yes" if "wait" in Headers(scope=scope).get("prefer", "") else "no",
        ).observe(self.answered_s)


class Observed:
    """ASGI middleware around everything but the request id.

    Parameters
    ----------
    app : ASGI application
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request and tell of it."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        exchange = _Exchange(began=time.perf_counter())
        traceparent = Headers(scope=scope).get("traceparent", "")

        async def watched_send(message: Message) -> None:
            if message["type"] == "http.response.start":
                exchange.answer(scope, message["status"])
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
                # answered and logged by the handler of unforeseen errors, which raises it again for servers
                # that would not know of it otherwise
            finally:
                route = _route(scope)
                if exchange.status == 0:
                    exchange.answer(scope, CLIENT_WENT)
                traced.update_name(f"{scope['method']} {route}")
                traced.set_attributes({"http.route": route, "http.response.status_code": exchange.status})
                if exchange.status >= 500:
                    traced.set_status(StatusCode.ERROR, str(exchange.status))
                _tell(scope, exchange, route)


def _tell(scope: Scope, exchange: _Exchange, route: str) -> None:
    level = logging.WARNING if exchange.status >= 500 else logging.INFO
    if route in QUIET_ROUTES and exchange.status < 400:
        level = logging.DEBUG
    if not access.isEnabledFor(level):
        return
    caller = caller_of(scope)
    facts = {
        "method": scope["method"],
        "route": route,
        "path": scope["path"][:MAX_PATH],  # without its query: what callers put there is theirs
        "status": exchange.status,
        "answered_s": round(exchange.answered_s, 4),
        "duration_s": round(time.perf_counter() - exchange.began, 4),
        "client": scope["client"][0] if scope.get("client") else None,
        "owner": None if caller is None else caller.owner,
        "key_id": None if caller is None else caller.key_id,
    }
    access.log(
        level,
        "%s %s %d",
        scope["method"],
        facts["path"],
        exchange.status,
        extra={"facts": {name: fact for name, fact in facts.items() if fact is not None}},
    )


def _route(scope: Scope) -> str:
    """The path's template: a label must not have as many values as there are jobs."""
    template = getattr(scope.get("route"), "path", None)
    if isinstance(template, str) and template:
        return template
    return STATIC if scope["path"].startswith(STATIC + "/") else UNROUTED
