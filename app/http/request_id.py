"""An id for every request: the caller's `X-Request-ID` when it is a sane one, else our own.

It stands in every answer, in every line that is logged while the request is served, on the job that the
request posts, and so in the lines of the worker that runs it.
"""

from __future__ import annotations

import re

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.identifiers import new_identifier
from app.observability.context import bound, current_facts

HEADER = b"x-request-id"
MAX_CHARACTERS = 64  # the width of its columns
# what no log, header or shell reads as anything but a word
SANE = re.compile(rb"[A-Za-z0-9][A-Za-z0-9._:-]{0,%d}" % (MAX_CHARACTERS - 1))


def current_request_id() -> str:
    """Id of the request that is being served here; empty outside of requests."""
    return str(current_facts().get("request_id", ""))


class RequestId:
    """ASGI middleware, the outermost: errors of all that lies within carry the id too.

    Parameters
    ----------
    app : ASGI application
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request under its id."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        request_id = _of_caller(scope) or new_identifier("req")
        header = (HEADER, request_id.encode())

        async def send_with_id(message: Message) -> None:
            if message["type"] == "http.response.start":
                message = {**message, "headers": [*message.get("headers", ()), header]}
            await send(message)

        with bound(request_id=request_id):
            await self.app(scope, receive, send_with_id)


def _of_caller(scope: Scope) -> str | None:
    for name, value in scope["headers"]:
        if name == HEADER:
            return value.decode() if SANE.fullmatch(value) else None
    return None
