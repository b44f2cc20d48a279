"""Limits on request bodies: bytes and time are counted as they arrive, whatever was announced."""

from __future__ import annotations

import asyncio
import time
from collections import Counter

from starlette.datastructures import Headers
from starlette.requests import ClientDisconnect
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.errors import BodyTooLarge, ServiceBusy, ServiceError, SlowBody
from app.http.context import caller_of
from app.http.middleware import HttpMiddleware
from app.http.problems import answer_early
from app.keys.watch import KeyInUse
from app.settings import Settings

MIN_RATE = 16_384.0  # bytes per second at which a body must arrive after its grace time
BODIES_AT_ONCE = 16  # multiple of the largest size: all bodies together that are being received or read


class BodyLimit(HttpMiddleware):
    """ASGI middleware that refuses a body as soon as it is too large, too slow, or one too many."""

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        super().__init__(app)
        self.max_bytes = settings.max_body_bytes
        self.grace_s = settings.body_grace_s
        self.max_total_bytes = BODIES_AT_ONCE * self.max_bytes
        # with several owners, one leaves room for the others
        self.max_owner_bytes = self.max_total_bytes // (2 if settings.demands_keys else 1)
        self.total = 0  # bytes of all bodies whose requests are not yet answered
        self.of_owners: Counter[str] = Counter()  # the same of each owner's

    async def serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        announced = Headers(scope=scope).get("content-length", "")
        if announced.isdigit() and int(announced) > self.max_bytes:
            await answer_early(self.too_large(), scope, receive, send)
            return
        body = _Body(self, scope, receive, send)
        try:
            await self.app(scope, body.receive, body.send)
        except ClientDisconnect:
            return  # the client has gone
        except Exception:
            if not body.refused:
                raise
        finally:
            body.release()

    def too_large(self) -> BodyTooLarge:
        """Make the error of a body that is too large."""
        return BodyTooLarge(f"The body has more than {self.max_bytes} bytes.")


class _Body:
    """One body in transit; the application receives it and answers through this object."""

    def __init__(self, limit: BodyLimit, scope: Scope, receive: Receive, send: Send) -> None:
        self.limit = limit
        self.scope = scope
        self.from_client = receive
        self.to_client = send
        caller = caller_of(scope)
        self.owner = "" if caller is None else caller.owner
        self.key = KeyInUse() if caller is None else caller.key
        self.counted = 0
        self.waited_s = (
            0.0  # waiting for the client only; pauses of the application are not the client's fault
        )
        self.complete = False
        self.refused = False
        self.answering = False

    async def receive(self) -> Message:
        """Return the next piece, or the end of the request if the body is refused."""
        if self.complete or self.refused:
            return await self.from_client()
        try:
            message = await self._in_time()
            if message["type"] == "http.request":
                self._count(message)
        except ServiceError as error:
            self.refused = True
            if not self.answering:
                await answer_early(error, self.scope, self.from_client, self.to_client)
            return {"type": "http.disconnect"}  # the application gives up; its answer is not sent
        return message

    async def send(self, message: Message) -> None:
        """Pass on the application's answer, unless the body has been refused already."""
        if not self.refused or self.answering:
            self.answering = True
            await self.to_client(message)

    async def _in_time(self) -> Message:
        """Wait for the next piece, for as long as the pieces received so far allow."""
        start = time.monotonic()
        patience_s = self.limit.grace_s + self.counted / MIN_RATE - self.waited_s
        try:
            async with asyncio.timeout(patience_s), self.key.while_valid():
                message = await self.from_client()
        except TimeoutError:
            raise SlowBody from None
        self.waited_s += time.monotonic() - start
        return message

    def _count(self, message: Message) -> None:
        limit, size = self.limit, len(message.get("body", b""))
        self.counted += size
        limit.total += size
        limit.of_owners[self.owner] += size
        self.complete = not message.get("more_body", False)
        if self.counted > limit.max_bytes:
            raise limit.too_large()
        if limit.total > limit.max_total_bytes:
            raise ServiceBusy("Too many large bodies are being received at the moment.")
        if limit.of_owners[self.owner] > limit.max_owner_bytes:
            raise ServiceBusy("Too many large bodies of yours are being received at the moment.")

    def release(self) -> None:
        """Release the body's share of the limits."""
        self.limit.total -= self.counted
        self.limit.of_owners[self.owner] -= self.counted
        if not self.limit.of_owners[self.owner]:
            del self.limit.of_owners[self.owner]
