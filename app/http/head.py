"""HEAD wherever there is GET: the same answer without its body, and nothing left behind."""

from __future__ import annotations

import asyncio

from starlette.types import ASGIApp, Message, Receive, Scope, Send


class HeadAsGet:
    """ASGI middleware, the innermost: the routes know of GET alone.

    An answer that is a stream ends with its headers: the application is told that the client has gone.

    Parameters
    ----------
    app : ASGI application
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        if scope["type"] != "http" or scope["method"] != "HEAD":
            await self.app(scope, receive, send)
            return
        asked: Scope = {**scope, "method": "GET"}
        messages: list[Message] = [{"type": "http.request", "body": b"", "more_body": False}]
        answered = asyncio.Event()

        async def receive_nothing() -> Message:
            if messages:
                return messages.pop()
            await answered.wait()
            return {"type": "http.disconnect"}

        async def send_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                scope["route"] = asked.get("route")  # what is logged and measured goes by routes
                await send(message)
            elif not answered.is_set():
                answered.set()
                await send({"type": "http.response.body", "body": b"", "more_body": False})

        await self.app(asked, receive_nothing, send_headers)
