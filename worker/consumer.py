"""Celery's consumer, extended to keep its pool and timers running while there is no broker.

Celery sleeps while it waits for a broker: no results of pool children are read and no timers run. This
consumer runs the event loop while it waits, so that jobs start (`worker.row_watch`) and signs of life are
written (`worker.presence`) even if the broker is away, full or faulty, right from the start of the worker.
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
# messages between Celery's workers: unused, and a hung broker would block the sender
SILENT = {"without_gossip": True, "without_heartbeat": True, "without_mingle": True}


class IndependentConsumer(Consumer):  # type: ignore[misc]  # celery carries no types
    """The consumer of a worker that can run without a broker."""

    def __init__(
        self, *arguments: Any, worker_options: Mapping[str, Any] | None = None, **options: Any
    ) -> None:
        super().__init__(*arguments, worker_options={**(worker_options or {}), **SILENT}, **options)
        self._tried_at = float("-inf")
        self._alone = False
        self._ticks: set[Any] = set()  # callbacks of the transport in each turn of the loop

    def connect(self) -> Any:
        """Connect to the broker, retrying for as long as it takes."""
        if self.hub is None:
            return super().connect()
        self.hub.on_tick -= self._ticks  # callbacks of a lost connection would try to use it
        if time.monotonic() < self._tried_at + RETRY_EVERY_S:
            self._go_on()  # a broker that accepts connections but does not work
        while True:
            connection = self.app.connection_for_read(heartbeat=self.amqheartbeat)
            try:
                connection.ensure_connection(max_retries=0)
            except (OperationalError, *self.connection_errors, *self.channel_errors) as error:
                if not self._alone:
                    log.warning("no broker at %s (%s); jobs continue without it", connection.as_uri(), error)
                self._go_on()
            else:
                break
        self._alone, self._tried_at = False, time.monotonic()
        before = set(self.hub.on_tick)
        connection.transport.register_with_event_loop(connection.connection, self.hub)
        self._ticks = self.hub.on_tick - before
        return connection

    def _go_on(self) -> None:
        """Do everything except take messages, until it is time to try again."""
        if not self._alone:
            self.controller.register_with_event_loop(self.hub)  # it was reset when the connection ended
            self._alone = True
        loop, over = self.hub.create_loop(), time.monotonic() + RETRY_EVERY_S
        while time.monotonic() < over:
            state.maybe_shutdown()
            try:
                next(loop)
            except StopIteration:
                loop = self.hub.create_loop()

    def on_close(self) -> None:
        """Discard messages that were taken but not started, but only at shutdown.

        When a connection is lost, Celery discards them too, and with them the knowledge which children are
        busy: it would hand the next hint to one that runs a job for hours. Our hints need no acknowledgement,
        so they are kept.
        """
        if state.should_stop is not None or state.should_terminate is not None:
            super().on_close()
