"""Wake-up messages to workers: hints that a row is waiting. A lost one delays a job but never loses it."""

from __future__ import annotations

import logging
from functools import lru_cache
from queue import Empty, SimpleQueue
from threading import Thread
from typing import Any

from app.settings import load_settings

RUN_JOB = "morphid.run_job"
QUEUE = "morphid"
WARM_UP_AFTER_S = 1.0  # s; the start of the process takes precedence

logger = logging.getLogger(__name__)


@lru_cache(maxsize=4)
def _client(broker_url: str) -> Any:
    """A Celery client that fails fast; it opens no connection before the first message."""
    from celery import Celery

    from app.jobs.transport import celery_broker

    settings = celery_broker(broker_url)
    client = Celery("morphid", set_as_current=False)
    client.conf.update(settings, broker_connection_retry=False)
    return client


def publish(job_id: str, broker_url: str | None = None) -> bool:
    """Send the workers a wake-up message for a job; call it after the commit.

    Returns False when the broker cannot be reached: the reaper repeats the message later.
    """
    url = broker_url or load_settings().broker_url
    try:
        _client(url).send_task(RUN_JOB, args=[job_id], queue=QUEUE, retry=False)
    except Exception as error:  # noqa: BLE001 - whatever a broker does, the row is safe and the caller continues
        logger.warning("wake-up message for %s not sent (%s); the reaper will repeat it", job_id, error)
        return False
    return True


def messages_waiting(broker_url: str) -> int | None:
    """Count the wake-up messages that no worker has taken yet; None if the broker is unreachable."""
    try:
        with _client(broker_url).connection_for_write() as connection:
            return int(connection.default_channel.queue_declare(queue=QUEUE).message_count)
    except Exception as error:  # noqa: BLE001 - as in `publish`
        logger.warning("the broker did not report the number of waiting messages (%s)", error)
        return None


class Publisher:
    """Sends wake-up messages from its own thread, so that no request waits for a broker.

    The broker is never contacted before the first message.
    """

    def __init__(self, broker_url: str) -> None:
        self._broker_url = broker_url
        self._waiting: SimpleQueue[str | None] = SimpleQueue()
        self._thread: Thread | None = None

    def start(self) -> None:
        """Start the thread."""
        self._thread = Thread(target=self._run, name="wake-up-messages", daemon=True)
        self._thread.start()

    def publish(self, job_id: str) -> None:
        """Queue one job id and return at once."""
        self._waiting.put(job_id)

    def stop(self, timeout_s: float = 5.0) -> None:
        """Send what is waiting, then end the thread; the reaper repeats what is left after `timeout_s`."""
        if self._thread is not None:
            self._waiting.put(None)
            self._thread.join(timeout_s)
            self._thread = None

    def _run(self) -> None:
        try:
            job_id = self._waiting.get(timeout=WARM_UP_AFTER_S)
        except Empty:
            # importing Celery takes most of a second: better before the first job than together with it
            _client(self._broker_url).connection_for_write().transport  # noqa: B018 - imports, connects to nothing
            job_id = self._waiting.get()
        while job_id is not None:
            publish(job_id, self._broker_url)
            job_id = self._waiting.get()
