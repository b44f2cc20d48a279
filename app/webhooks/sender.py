"""The sender: claims due deliveries and posts them, in a thread of the API process.

It has its own event loop: a slow receiver, a handshake or a busy database never delays the API.
"""

from __future__ import annotations

import asyncio
import logging
import ssl
import threading
from collections import Counter
from dataclasses import dataclass, field
from datetime import UTC, datetime
from random import Random, SystemRandom

from sqlalchemy.exc import SQLAlchemyError
from standardwebhooks import Webhook

from app.database import Database, database_time
from app.documents import json_bytes
from app.webhooks import deliveries
from app.webhooks.addresses import AddressPolicy
from app.webhooks.deliveries import Clock, Dispatch
from app.webhooks.posting import Answer, Poster, Timeouts

STOP_S = 1.0  # s for tries in progress to end; the rest is released and sent again by the next process

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class SenderSettings:
    """Settings of a sender."""

    policy: AddressPolicy = field(default_factory=AddressPolicy)
    trust: ssl.SSLContext | None = None
    timeouts: Timeouts = field(default_factory=Timeouts)
    poll_s: float = 1.0  # s between two checks of the table
    max_at_once: int = 16  # concurrent deliveries
    max_per_owner: int = 4  # of these, per owner
    lease_s: float = deliveries.LEASE_S
    clock: Clock = database_time
    rng: Random = field(default_factory=SystemRandom)


def signed_headers(secret: str, message_id: str, timestamp: float, body: bytes) -> dict[str, str]:
    """Headers that let the receiver verify sender, message and time (https://www.standardwebhooks.com).

    The message's id is the same in every try, so that the receiver can skip what it has seen; the timestamp
    (s since 1970 UTC) is that of the try.
    """
    signature = Webhook(secret).sign(message_id, datetime.fromtimestamp(int(timestamp), UTC), body.decode())
    return {
        "webhook-id": message_id,
        "webhook-timestamp": str(int(timestamp)),
        "webhook-signature": signature,
    }


class WebhookSender:
    """Sends the waiting deliveries of the outbox."""

    def __init__(self, database: Database, settings: SenderSettings) -> None:
        self._database = database
        self._settings = settings
        self._poster = Poster(settings.policy, settings.trust, settings.timeouts)
        self._under_way: dict[asyncio.Task[None], Dispatch] = {}
        self._stopping = threading.Event()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._thread: threading.Thread | None = None
        self._wake: asyncio.Event | None = None

    def start(self) -> None:
        """Start sending, in a separate thread."""
        self._thread = threading.Thread(
            target=asyncio.run, args=(self.run(),), name="webhook-sender", daemon=True
        )
        self._thread.start()

    def stop(self, patience_s: float = 2 * STOP_S + 1.0) -> None:
        """Stop within a second or two; unfinished deliveries stay in the table."""
        self._stopping.set()
        loop, wake = self._loop, self._wake
        if loop is not None and wake is not None and not loop.is_closed():
            loop.call_soon_threadsafe(wake.set)
        if self._thread is not None:
            self._thread.join(patience_s)

    async def run(self) -> None:
        """Send until `stop` is called."""
        self._loop, self._wake = asyncio.get_running_loop(), asyncio.Event()
        waiting = asyncio.create_task(self._wake.wait())
        try:
            while not self._stopping.is_set():
                await self._begin()
                await asyncio.wait(
                    {waiting, *self._under_way},
                    timeout=self._settings.poll_s,
                    return_when=asyncio.FIRST_COMPLETED,
                )
        finally:
            waiting.cancel()
            await self._wind_down()

    async def send_due(self) -> int:
        """Send the deliveries that are due now, once each, and return the number of tries."""
        tries = 0
        while begun := await self._begin():
            tries += begun
            await asyncio.wait(set(self._under_way))
        return tries

    async def _begin(self) -> int:
        """Claim as many deliveries as there are free slots, and start sending them."""
        room = self._settings.max_at_once - len(self._under_way)
        if room <= 0:
            return 0
        owners = Counter(dispatch.owner for dispatch in self._under_way.values())
        try:
            taken = await asyncio.to_thread(self._take, room, owners)
        except SQLAlchemyError as error:
            logger.warning("cannot look for webhook deliveries: %s", error)
            return 0
        for dispatch in taken:
            task = asyncio.create_task(self._deliver(dispatch))
            self._under_way[task] = dispatch
            task.add_done_callback(self._ended)
        return len(taken)

    def _ended(self, task: asyncio.Task[None]) -> None:
        dispatch = self._under_way.pop(task)
        if not task.cancelled() and (error := task.exception()) is not None:
            logger.error("webhook delivery %s broke the sender", dispatch.id, exc_info=error)

    def _take(self, room: int, under_way: Counter[str]) -> list[Dispatch]:
        """Read, and write only if there is something to send."""
        chosen = self._settings
        with self._database.read() as session:
            found = deliveries.due(session, room, chosen.max_per_owner, under_way, chosen.clock)
        if not found:
            return []
        with self._database.write() as session:
            return deliveries.claim(session, found, chosen.lease_s, chosen.clock)

    async def _deliver(self, dispatch: Dispatch) -> None:
        body = json_bytes(dispatch.payload)
        headers = signed_headers(dispatch.secret, dispatch.id, dispatch.at, body)
        try:
            answer = await self._poster.post(dispatch.url, headers, body, challenge=dispatch.challenge)
            status = await asyncio.to_thread(self._settle, dispatch, answer)
        except SQLAlchemyError as error:
            # when the lease ends, the delivery is sent again under the same id
            logger.warning("cannot record the outcome of delivery %s: %s", dispatch.id, error)
            return
        logger.info("webhook delivery %s, try %d: %s", dispatch.id, dispatch.tries, answer.error or status)

    def _settle(self, dispatch: Dispatch, answer: Answer) -> str | None:
        with self._database.write() as session:
            chosen = self._settings
            return deliveries.settle(session, dispatch, answer, rng=chosen.rng, clock=chosen.clock)

    async def _wind_down(self) -> None:
        """Let tries in progress end, for a moment; release the rest."""
        if not self._under_way:
            return
        await asyncio.wait(set(self._under_way), timeout=STOP_S)
        left = dict(self._under_way)
        for task in left:
            task.cancel()
        await asyncio.gather(*left, return_exceptions=True)
        if left:
            await asyncio.to_thread(self._release, list(left.values()))

    def _release(self, left: list[Dispatch]) -> None:
        try:
            with self._database.write() as session:
                for dispatch in left:
                    deliveries.release(session, dispatch, self._settings.clock)
        except SQLAlchemyError as error:
            logger.warning("webhook deliveries stay claimed until their lease ends: %s", error)
