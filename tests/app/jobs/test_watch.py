"""Laws of waiting for news of jobs."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Coroutine
from typing import Any, cast

import pytest

from app.database import Database
from app.jobs.watch import JobWatcher

POLL_S = 0.01
IDLE = 4000
LOOKS = 5
LOOK_CPU_S = 0.05  # of the event loop's thread; 0.15 s when every client was looked for in a list of jobs


@pytest.fixture
def numbers(monkeypatch: pytest.MonkeyPatch) -> dict[str, int]:
    """The last event of each job, in place of the database; the test changes it."""
    found: dict[str, int] = {}

    def reported(_watcher: JobWatcher, ids: list[str]) -> dict[str, int]:
        return {job_id: found[job_id] for job_id in ids if job_id in found}

    monkeypatch.setattr(JobWatcher, "_event_numbers", reported)
    return found


def played(play: Callable[[JobWatcher], Coroutine[Any, Any, None]]) -> None:
    """Run a test with a watcher whose database is the test's `numbers`."""

    async def run() -> None:
        watcher = JobWatcher(cast(Database, None), POLL_S)
        watcher.start()
        try:
            async with asyncio.timeout(30.0):
                await play(watcher)
        finally:
            await watcher.stop()

    asyncio.run(run())


def test_news_wake_those_who_have_not_seen_them(numbers: dict[str, int]) -> None:
    """Clients that wait for a later event or another job are not woken; those of a deleted job are."""
    numbers.update(one=3, two=1)

    async def play(watcher: JobWatcher) -> None:
        with watcher.watch("one") as early, watcher.watch("one") as late, watcher.watch("two") as other:
            waits = [asyncio.create_task(early.wait(3, 20.0)), asyncio.create_task(late.wait(4, 20.0))]
            waits.append(asyncio.create_task(other.wait(1, 20.0)))
            await asyncio.sleep(10 * POLL_S)
            assert not any(wait.done() for wait in waits)
            numbers["one"] = 4
            assert await waits[0]
            await asyncio.sleep(10 * POLL_S)
            assert [wait.done() for wait in waits] == [True, False, False]
            del numbers["one"]
            assert await waits[1]
            assert not waits[2].done()
            watcher.close()
            assert await waits[2]

    played(play)


def test_news_that_came_before_the_wait_are_reported(numbers: dict[str, int]) -> None:
    """A client that begins to wait when the watcher has long seen the news hears of them all the same."""
    numbers["one"] = 3

    async def play(watcher: JobWatcher) -> None:
        with watcher.watch("one") as first:
            assert await first.wait(2, 20.0)
            with watcher.watch("one") as second:
                assert await second.wait(2, 20.0)
                assert not await second.wait(3, 10 * POLL_S)

    played(play)


def test_a_look_costs_nothing_for_those_who_wait(numbers: dict[str, int]) -> None:
    """Thousands of clients of as many jobs wait: a look takes milliseconds of the event loop."""
    numbers.update({f"job_{number:026d}": 1 for number in range(IDLE)})

    async def play(watcher: JobWatcher) -> None:
        begun = asyncio.Semaphore(0)
        loop = asyncio.get_running_loop()

        def counted(ids: list[str]) -> dict[str, int]:
            loop.call_soon_threadsafe(begun.release)
            return dict.fromkeys(ids, 1)

        watcher._event_numbers = counted  # type: ignore[method-assign]

        async def follow(job_id: str) -> None:
            with watcher.watch(job_id) as subscription:
                await subscription.wait(1, 60.0)

        tasks = [asyncio.create_task(follow(job_id)) for job_id in numbers]
        for _ in range(2):
            await begun.acquire()
        began = time.thread_time()
        for _ in range(LOOKS):
            await begun.acquire()
        cpu_s = (time.thread_time() - began) / LOOKS
        print(f"{1e3 * cpu_s:.1f} ms of the event loop for each look at {IDLE} jobs")
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        assert cpu_s < LOOK_CPU_S

    played(play)
