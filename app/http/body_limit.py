"""Limits on request bodies: bytes are counted as they arrive, whatever was announced, and so is time."""

from __future__ import annotations

import asyncio
import time
from collections import Counter
from dataclasses import dataclass

from starlette.requests import ClientDisconnect
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.errors import BodyTooLarge, ServiceBusy, ServiceError, SlowBody
from app.http.context import caller_of
from app.http.early_answer import answer_early
from app.keys.watch import KeyInUse


@dataclass(frozen=True, slots=True)
class BodyLimits:
    """What a body may take.

    Attributes
    ----------
    max_bytes : int
        Largest body that is let through.
    grace_s : float
        Time to send a body of any size.
    min_rate : float
        Bytes per second that a larger one must arrive with on top.
    max_total_bytes : int
        All bodies together that are being received or read; beyond it requests are told to come again.
    max_owner_bytes : int
        The same of one owner, which leaves room for the others.
    """

    max_bytes: int
    grace_s: float = 20.0
    min_rate: float = 16_384.0
    max_total_bytes: int = 2**30
    max_owner_bytes: int = 2**30


class BodyLimit:
    """ASGI middleware: a problem document as soon as a body is too large, too slow, or one too many.

    Parameters
    ----------
    app : ASGI application
    limits : BodyLimits
    """

    def __init__(self, app: ASGIApp, limits: BodyLimits) -> None:
        self.app = app
        self.limits = limits
        self.total = 0  # bytes of all bodies whose requests are not yet answered
        self.of_owners: Counter[str] = Counter()  # the same of each owner's

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        if _announced(scope) > self.limits.max_bytes:
            await answer_early(_too_large(self.limits), scope, receive, send)
            return
        body = _Body(self, scope, receive, send)
        try:
            await self.app(scope, body.receive, body.send)
        except ClientDisconnect:
            return  # nobody to tell
        except Exception:
            if not body.refused:
                raise
        finally:
            body.forget()


class _Body:
    """One body on its way: the application receives it and answers through this."""

    def __init__(self, limit: BodyLimit, scope: Scope, receive: Receive, send: Send) -> None:
        self.limit = limit
        self.scope = scope
        self.from_client = receive
        self.to_client = send
        caller = caller_of(scope)
        self.owner = "" if caller is None else caller.owner
        self.key = KeyInUse() if caller is None else caller.key
        self.counted = 0
        self.waited_s = 0.0  # for the client; the application's own pauses are not the client's fault
        self.complete = False
        self.refused = False
        self.answering = False

    async def receive(self) -> Message:
        """The next piece, or the end of the request when the body is refused."""
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
            return {"type": "http.disconnect"}  # the application gives up; nobody hears its answer
        return message

    async def send(self, message: Message) -> None:
        """Pass the application's answer on, unless the body has been refused before."""
        if not self.refused or self.answering:
            self.answering = True
            await self.to_client(message)

    async def _in_time(self) -> Message:
        """Wait for the next piece as long as the pieces until now have earned."""
        limits = self.limit.limits
        start = time.monotonic()
        try:
            async with (
                asyncio.timeout(limits.grace_s + self.counted / limits.min_rate - self.waited_s),
                self.key.while_it_opens(),
            ):
                message = await self.from_client()
        except TimeoutError:
            raise SlowBody from None
        self.waited_s += time.monotonic() - start
        return message

    def _count(self, message: Message) -> None:
        size = len(message.get("body", b""))
        self.counted += size
        self.limit.total += size
        self.limit.of_owners[self.owner] += size
        self.complete = not message.get("more_body", False)
        if self.counted > self.limit.limits.max_bytes:
            raise _too_large(self.limit.limits)
        if self.limit.total > self.limit.limits.max_total_bytes:
            raise ServiceBusy("Too many large bodies are being received at the moment.")
        if self.limit.of_owners[self.owner] > self.limit.limits.max_owner_bytes:
            raise ServiceBusy("Too many large bodies of yours are being received at the moment.")

    def forget(self) -> None:
        """Give back what the body took of the limits."""
        self.limit.total -= self.counted
        self.limit.of_owners[self.owner] -= self.counted
        if not self.limit.of_owners[self.owner]:
            del self.limit.of_owners[self.owner]


def _announced(scope: Scope) -> int:
    for name, value in scope["headers"]:
        if name == b"content-length":
            return int(value) if value.isdigit() else 0
    return 0


def _too_large(limits: BodyLimits) -> BodyTooLarge:
    return BodyTooLarge(
        f"The body has more than {limits.max_bytes} bytes.",
        hint="Send fewer rows (10 ms steps are enough), or upload each flight with POST /trajectories.",
    )
