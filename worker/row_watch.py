"""Periodic checks of the job rows: hints start jobs promptly, checks guarantee that they start at all.

Every second, when a slot is free, a pool child checks whether work is waiting; if so, the worker wakes itself
as a message would have done. So a message that is lost, dropped or never sent costs only a second.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from functools import partial
from typing import Any

from celery import bootsteps
from celery.utils.functional import noop
from celery.worker import state
from kombu.message import Message

from app.jobs.queue import RUN_JOB
from worker.hints import Hint

log = logging.getLogger(__name__)

LOOK_EVERY_S = 1.0
ANSWER_WITHIN_S = 5.0  # then another child is tried; a check takes a millisecond
NOBODY_IN_PARTICULAR = "a look at the rows"


def work_waits() -> bool:
    """Check the rows (called in a pool child)."""
    from worker import tasks

    return tasks.work_waits()


class RowWatch(bootsteps.StartStopStep):  # type: ignore[misc]  # celery carries no types
    """Step of Celery's worker: checks rows in its event loop while the pool exists."""

    requires = ("celery.worker.components:Pool",)

    def __init__(self, worker: Any, clock: Callable[[], float] = time.monotonic, **options: Any) -> None:
        super().__init__(worker, **options)
        worker.row_watch = self
        self._clock = clock
        self._timer: Any = None
        self._requested_at: float | None = None
        self._unanswered_since: float | None = None

    def include_if(self, worker: Any) -> bool:
        """Whether there is an event loop; with a broker other than Redis there may be none."""
        return bool(worker.use_eventloop)

    def start(self, worker: Any) -> None:
        """Start the checks."""
        self._timer = worker.timer.call_repeatedly(LOOK_EVERY_S, self._look, (worker,))

    def stop(self, _worker: Any) -> None:
        """Stop the checks."""
        if self._timer is not None:
            self._timer.cancel()

    terminate = stop

    @property
    def unanswered_s(self) -> float:
        """Time for which free children have not answered, s."""
        return 0.0 if self._unanswered_since is None else self._clock() - self._unanswered_since

    def _look(self, worker: Any) -> None:
        if len(state.reserved_requests) >= worker.pool.num_processes:
            self._unanswered_since = None  # all are busy
            return
        now = self._clock()
        if self._requested_at is not None and now - self._requested_at < ANSWER_WITHIN_S:
            return
        self._requested_at = now
        if self._unanswered_since is None:
            self._unanswered_since = now

        def answered(waits: object) -> None:
            self._requested_at = self._unanswered_since = None
            if waits:
                wake(worker.consumer)

        def failed(error: object) -> None:
            self._requested_at = None
            log.warning("a check of the job rows failed: %s", error)

        # the pool returns the slot with the answer
        worker.semaphore.acquire(
            partial(worker.pool.apply_async, work_waits, callback=answered, error_callback=failed)
        )


def wake(consumer: Any) -> None:
    """Have the pool run the next job, as a message from the broker does."""
    if RUN_JOB not in consumer.strategies:
        consumer.update_strategies()  # no broker was there yet
    hint = Hint(RUN_JOB, [NOBODY_IN_PARTICULAR])
    message = Message(  # type: ignore[no-untyped-call]
        body=hint.body(),
        headers=hint.headers(),
        properties={"correlation_id": hint.id},
        content_type="application/json",
        content_encoding="utf-8",
    )
    consumer.strategies[RUN_JOB](message, None, noop, noop, [])
