"""A limit on request bodies that counts bytes as they arrive, whatever Content-Length says."""

from __future__ import annotations

import asyncio
import json

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.errors import BodyTooLarge
from app.http.problems import problem_document

LINGER_S = 0.3  # a client that is still sending gets to read the answer before the connection closes


class BodyLimit:
    """ASGI middleware: 413 with a problem document as soon as a body is too large.

    Parameters
    ----------
    app : ASGI application
    max_bytes : int
        Largest body that is let through.
    """

    def __init__(self, app: ASGIApp, max_bytes: int) -> None:
        self.app = app
        self.max_bytes = max_bytes

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        if self._announced(scope) > self.max_bytes:
            await self._refuse(scope, receive, send)
            return
        counted = 0
        refused = False
        answering = False

        async def counted_receive() -> Message:
            nonlocal counted, refused
            message = await receive()
            if message["type"] != "http.request" or refused:
                return message
            counted += len(message.get("body", b""))
            if counted <= self.max_bytes:
                return message
            refused = True
            if not answering:
                await self._refuse(scope, receive, send)
            return {"type": "http.disconnect"}  # the application gives up; nobody hears its answer

        async def guarded_send(message: Message) -> None:
            nonlocal answering
            if not refused or answering:
                answering = True
                await send(message)

        try:
            await self.app(scope, counted_receive, guarded_send)
        except Exception:
            if not refused:
                raise

    @staticmethod
    def _announced(scope: Scope) -> int:
        for name, value in scope["headers"]:
            if name == b"content-length":
                return int(value) if value.isdigit() else 0
        return 0

    async def _refuse(self, scope: Scope, receive: Receive, send: Send) -> None:
        error = BodyTooLarge(
            f"The body has more than {self.max_bytes} bytes.",
            hint="Send fewer rows (10 ms steps are enough), or upload each flight with POST /trajectories.",
        )
        body = json.dumps(problem_document(error, scope["path"])).encode()
        await send(
            {
                "type": "http.response.start",
                "status": error.status,
                "headers": [
                    (b"content-type", b"application/problem+json"),
                    (b"content-length", str(len(body)).encode()),
                    (b"connection", b"close"),
                ],
            }
        )
        await send({"type": "http.response.body", "body": body, "more_body": True})
        try:
            async with asyncio.timeout(LINGER_S):
                while (message := await receive())["type"] == "http.request" and message.get("more_body"):
                    pass
        except TimeoutError:
            pass
        await send({"type": "http.response.body", "body": b"", "more_body": False})
