"""Small ASGI middleware: request ids, security headers, and HEAD wherever there is GET."""

from __future__ import annotations

import asyncio
import re
from abc import ABC, abstractmethod

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.http.context import caller_of
from app.identifiers import new_identifier
from app.observability.context import bound

MAX_ID_CHARACTERS = 64  # of a request id: the width of its columns
# an id that is safe in logs, headers and shells
SANE_ID = re.compile(rf"[A-Za-z0-9][A-Za-z0-9._:-]{{0,{MAX_ID_CHARACTERS - 1}}}")
# API responses are not pages: nothing in them may run, and no page may frame them
CLOSED_POLICY = "default-src 'none'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
HSTS = "max-age=31536000"  # s: one year; without subdomains, which are not ours
CAREFUL_HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "X-Frame-Options": "DENY",  # for browsers that do not know frame-ancestors
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Content-Security-Policy": CLOSED_POLICY,
}


class HttpMiddleware(ABC):
    """ASGI middleware that serves HTTP requests and passes everything else on."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve an HTTP request, or pass on anything else."""
        if scope["type"] == "http":
            await self.serve(scope, receive, send)
        else:
            await self.app(scope, receive, send)

    @abstractmethod
    async def serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""


class RequestId(HttpMiddleware):
    """An id for every request: the caller's `X-Request-ID` if it is acceptable, else our own.

    It appears in the response, in every line logged while the request is served, on the job that the request
    posts, and so in the log of the worker that runs it.
    """

    async def serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request under its id."""
        given = Headers(scope=scope).get("x-request-id", "")
        request_id = given if SANE_ID.fullmatch(given) else new_identifier("req")

        async def send_with_id(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message)["X-Request-ID"] = request_id
            await send(message)

        with bound(request_id=request_id):
            await self.app(scope, receive, send_with_id)


class SecurityHeaders(HttpMiddleware):
    """Security headers for browsers, unless a response sets them itself."""

    async def serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                _add_careful_headers(MutableHeaders(scope=message), scope, message["status"])
            await send(message)

        await self.app(scope, receive, send_with_headers)


def _add_careful_headers(headers: MutableHeaders, scope: Scope, status: int) -> None:
    for name, value in CAREFUL_HEADERS.items():
        headers.setdefault(name, value)
    if scope.get("scheme") == "https":
        headers.setdefault("Strict-Transport-Security", HSTS)
    caller = caller_of(scope)
    if status == 401 or (caller is not None and caller.key_id is not None):
        # responses must not stay in a cache that another user of the machine can read
        headers["Cache-Control"] = "no-store"


class HeadAsGet(HttpMiddleware):
    """HEAD as GET without the body; innermost, because routes only define GET.

    A stream ends after its headers: to the application the client seems to have disconnected.
    """

    async def serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        if scope["method"] != "HEAD":
            await self.app(scope, receive, send)
            return
        get: Scope = {**scope, "method": "GET"}
        messages: list[Message] = [{"type": "http.request", "body": b"", "more_body": False}]
        answered = asyncio.Event()

        async def receive_nothing() -> Message:
            if messages:
                return messages.pop()
            await answered.wait()
            return {"type": "http.disconnect"}

        async def send_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                scope["route"] = get.get("route")  # logs and metrics go by routes
                await send(message)
            elif not answered.is_set():
                answered.set()
                await send({"type": "http.response.body", "body": b"", "more_body": False})

        await self.app(get, receive_nothing, send_headers)
