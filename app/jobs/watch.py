"""Watches jobs for waiting clients: one query per tick for all watched jobs, for any number of clients."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from sqlalchemy import select
from sqlalchemy.exc import SQLAlchemyError

from app.database import Database
from app.tables import jobs

CHUNK = 500  # ids per query
GONE = 2**62  # number of the last event of a missing job: greater than any number seen

PAUSE_FACTOR = 4.0  # share of the time for queries over thousands of jobs: requests come first

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
        self._watcher.expect(self)
        try:
            async with asyncio.timeout(timeout_s):
                await self._news.wait()
        except TimeoutError:
            return False
        return True

    def wake(self) -> None:
        """Wake the waiting client."""
        self._news.set()


class JobWatcher:
    """Checks the watched jobs every `poll_s` seconds and wakes the clients that wait for them.

    The cost of a check grows with the number of watched jobs and woken clients, not with that of waiting
    clients. A check that takes a quarter of `poll_s` or more delays the next one.
    """

    def __init__(self, database: Database, poll_s: float) -> None:
        self._database = database
        self._poll_s = poll_s
        self._subscriptions: dict[str, set[Subscription]] = {}
        self._numbers: dict[str, int] = {}  # number of the last event of each watched job, at the last check
        self._late: set[Subscription] = set()  # these already had news when they began to wait
        self._someone = asyncio.Event()
        self._task: asyncio.Task[None] | None = None
        self.closed = False

    def start(self) -> None:
        """Start watching."""
        self._task = asyncio.create_task(self._run(), name="job-watcher")

    def close(self) -> None:
        """Wake all clients permanently: the process ends."""
        self.closed = True
        for subscriptions in self._subscriptions.values():
            for subscription in subscriptions:
                subscription.wake()

    async def stop(self) -> None:
        """Stop watching."""
        self.close()
        if self._task is not None:
            self._task.cancel()
            with suppress(asyncio.CancelledError):
                await self._task

    @contextmanager
    def watch(self, job_id: str) -> Iterator[Subscription]:
        """Watch one job while the block lasts."""
        subscription = Subscription(self, job_id)
        self._subscriptions.setdefault(job_id, set()).add(subscription)
        self._someone.set()
        try:
            yield subscription
        finally:
            self._late.discard(subscription)
            watching = self._subscriptions[job_id]
            watching.discard(subscription)
            if not watching:
                del self._subscriptions[job_id]
                self._numbers.pop(job_id, None)

    def expect(self, subscription: Subscription) -> None:
        """Note that a client starts to wait; the next check wakes it if an earlier one has seen its news."""
        if self._numbers.get(subscription.job_id, -1) > subscription.seen:
            self._late.add(subscription)

    async def _run(self) -> None:
        took_s = 0.0
        while not self.closed:
            if not self._subscriptions:
                self._someone.clear()
                await self._someone.wait()
            await asyncio.sleep(max(self._poll_s, PAUSE_FACTOR * took_s))
            ids = list(self._subscriptions)
            began = time.monotonic()
            try:
                numbers = await asyncio.to_thread(self._event_numbers, ids)
            except SQLAlchemyError as error:
                logger.warning("cannot check the watched jobs: %s", error)
                continue
            finally:
                took_s = time.monotonic() - began
            self._wake(ids, numbers)

    def _wake(self, ids: list[str], numbers: dict[str, int]) -> None:
        """Wake clients that have not seen the last event of a job, or follow a deleted one."""
        woken, self._late = self._late, set()
        for job_id in ids:
            number = numbers.get(job_id, GONE)
            if job_id in self._subscriptions and self._numbers.get(job_id) != number:
                self._numbers[job_id] = number
                woken |= self._subscriptions[job_id]
        for subscription in woken:
            if self._numbers.get(subscription.job_id, -1) > subscription.seen:
                subscription.wake()

    def _event_numbers(self, ids: list[str]) -> dict[str, int]:
        numbers: dict[str, int] = {}
        with self._database.read() as session:
            for start in range(0, len(ids), CHUNK):
                chosen = jobs.c.id.in_(ids[start : start + CHUNK])
                rows = session.execute(select(jobs.c.id, jobs.c.event_seq).where(chosen))
                numbers |= dict(iter(rows))
        return numbers
