"""Celery's consumer, going on with its pool and its timers while there is no broker.

Celery waits for a broker asleep: meanwhile no result of a pool child is read and no timer runs. Ours turns
the event loop while it waits, so that jobs begin (`worker.row_watch`) and signs of life are written
(`worker.presence`) with a broker that is away, full or out of order, from the start of the worker on.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Mapping
from typing import Any

from celery.worker import state
from celery.worker.consumer import Consumer
from kombu.exceptions import OperationalError

log = logging.getLogger(__name__)

RETRY_EVERY_S = 1.0
# what Celery's workers tell one another: nobody listens, and a hung broker would hold up the sender
SILENT = {"without_gossip": True, "without_heartbeat": True, "without_mingle": True}


class IndependentConsumer(Consumer):  # type: ignore[misc]  # celery carries no types
    """The consumer of a worker that can do without a broker."""

    def __init__(
        self, *arguments: Any, worker_options: Mapping[str, Any] | None = None, **options: Any
    ) -> None:
        super().__init__(*arguments, worker_options={**(worker_options or {}), **SILENT}, **options)
        self._tried_at = float("-inf")
        self._alone = False
        self._ticks: set[Any] = set()  # what the transport does in each turn of the loop

    def connect(self) -> Any:
        """Connect to the broker, however long it takes."""
        if self.hub is None:
            return super().connect()
        self.hub.on_tick -= self._ticks  # those of a lost connection would try to use it
        if time.monotonic() < self._tried_at + RETRY_EVERY_S:
            self._go_on()  # a broker that takes connections, and then is of no use
        while True:
            connection = self.app.connection_for_read(heartbeat=self.amqheartbeat)
            try:
                connection.ensure_connection(max_retries=0)
            except (OperationalError, *self.connection_errors, *self.channel_errors) as error:
                if not self._alone:
                    log.warning("no broker at %s (%s); jobs go on without", connection.as_uri(), error)
                self._go_on()
            else:
                break
        self._alone, self._tried_at = False, time.monotonic()
        before = set(self.hub.on_tick)
        connection.transport.register_with_event_loop(connection.connection, self.hub)
        self._ticks = self.hub.on_tick - before
        return connection

    def _go_on(self) -> None:
        """Do all but take messages, until it is time to try again."""
        if not self._alone:
            self.controller.register_with_event_loop(self.hub)  # it was reset with the connection's end
            self._alone = True
        loop, over = self.hub.create_loop(), time.monotonic() + RETRY_EVERY_S
        while time.monotonic() < over:
            state.maybe_shutdown()
            try:
                next(loop)
            except StopIteration:
                loop = self.hub.create_loop()

    def on_close(self) -> None:
        """Forget what was taken and not begun, but only at the end.

        When a connection is lost Celery forgets it too, and with it which children are busy: it would hand
        the next hint to one that runs a job for hours. Our hints need no acknowledgement, so they stay.
        """
        if state.should_stop is not None or state.should_terminate is not None:
            super().on_close()
