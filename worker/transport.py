"""The worker's side of the broker: every message is parsed strictly before kombu and Celery see it."""

from __future__ import annotations

import logging
from typing import Any

from redis import Redis

from app.jobs.transport import Channel as PlainChannel
from app.jobs.transport import Transport as PlainTransport
from worker.hints import read_hint

log = logging.getLogger(__name__)


class Dropped:
    """Malformed messages received by this process and not yet recorded."""

    def __init__(self) -> None:
        self.number = 0

    def note(self, reason: str) -> None:
        """Count one; only the first since the last record is logged."""
        if self.number == 0:
            log.warning("a malformed wake-up message was dropped: %s", reason)
        self.number += 1


dropped = Dropped()  # kombu creates the channels, so nothing can be passed to them


class HintClient(Redis):
    """A client whose BRPOP returns only well-formed messages; others count as none."""

    def parse_response(self, connection: Any, command_name: str, **options: Any) -> Any:
        """Read the server's answer."""
        answer = super().parse_response(connection, command_name, **options)  # type: ignore[no-untyped-call]
        if command_name != "BRPOP" or not answer:
            return answer
        queue, message = answer
        try:
            hint = read_hint(message)
        except ValueError as error:
            dropped.note(f"{len(message)} bytes, {str(error).splitlines()[0]}")
            return None
        return None if hint is None else (queue, hint.packed())


class Channel(PlainChannel):
    """A channel for wake-up messages."""

    def _get_client(self) -> type[Redis]:
        return HintClient


class Transport(PlainTransport):
    """The worker's transport."""

    Channel = Channel
