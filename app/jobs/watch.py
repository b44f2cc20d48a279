"""Waiting for news of jobs: one query per tick for all watched jobs, however many clients wait."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from sqlalchemy import select
from sqlalchemy.exc import SQLAlchemyError

from app.database import Database
from app.tables import jobs

CHUNK = 500  # ids per query

logger = logging.getLogger(__name__)


class Subscription:
    """One client's interest in one job."""

    def __init__(self, watcher: JobWatcher, job_id: str) -> None:
        self.job_id = job_id
        self._watcher = watcher
        self._news = asyncio.Event()
        self.seen = -1

    async def wait(self, seen: int, timeout_s: float) -> bool:
        """Wait until the job has an event after number `seen`, or is gone; False after `timeout_s`."""
        self.seen = seen
        self._news.clear()
        if self._watcher.closed:
            return True
        try:
            async with asyncio.timeout(timeout_s):
                await self._news.wait()
        except TimeoutError:
            return False
        return True

    def tell(self) -> None:
        """Wake the waiting client."""
        self._news.set()


class JobWatcher:
    """Looks at the watched jobs every `poll_s` seconds and wakes those who wait for them.

    Parameters
    ----------
    database : Database
    poll_s : float
        The longest that news of a job lies about, s.
    """

    def __init__(self, database: Database, poll_s: float) -> None:
        self._database = database
        self._poll_s = poll_s
        self._subscriptions: set[Subscription] = set()
        self._someone = asyncio.Event()
        self._task: asyncio.Task[None] | None = None
        self.closed = False

    def start(self) -> None:
        """Begin to look."""
        self._task = asyncio.create_task(self._run(), name="job-watcher")

    def close(self) -> None:
        """Wake everyone for good: the process ends."""
        self.closed = True
        for subscription in self._subscriptions:
            subscription.tell()

    async def stop(self) -> None:
        """Stop looking."""
        self.close()
        if self._task is not None:
            self._task.cancel()
            with suppress(asyncio.CancelledError):
                await self._task

    @contextmanager
    def watch(self, job_id: str) -> Iterator[Subscription]:
        """Watch one job while the block lasts."""
        subscription = Subscription(self, job_id)
        self._subscriptions.add(subscription)
        self._someone.set()
        try:
            yield subscription
        finally:
            self._subscriptions.discard(subscription)

    async def _run(self) -> None:
        while not self.closed:
            if not self._subscriptions:
                self._someone.clear()
                await self._someone.wait()
            await asyncio.sleep(self._poll_s)
            ids = sorted({subscription.job_id for subscription in self._subscriptions})
            try:
                numbers = await asyncio.to_thread(self._event_numbers, ids)
            except SQLAlchemyError as error:
                logger.warning("cannot look at the watched jobs: %s", error)
                continue
            for subscription in tuple(self._subscriptions):
                if subscription.job_id in ids and numbers.get(subscription.job_id, 2**62) > subscription.seen:
                    subscription.tell()

    def _event_numbers(self, ids: list[str]) -> dict[str, int]:
        numbers: dict[str, int] = {}
        with self._database.read() as session:
            for start in range(0, len(ids), CHUNK):
                chosen = jobs.c.id.in_(ids[start : start + CHUNK])
                for row in session.execute(select(jobs.c.id, jobs.c.event_seq).where(chosen)):
                    numbers[row.id] = row.event_seq
        return numbers
