"""Fairness between owners: limits per owner, and slots that owners take in turn."""

from __future__ import annotations

import asyncio
from collections import Counter, deque
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager

from app.errors import ServiceError


class OwnerLimit:
    """Counts the use of each owner; called from one thread only (the event loop's).

    Parameters
    ----------
    limit : int
        Maximum for one owner.
    refusal
        Makes the error raised at the limit.
    """

    def __init__(self, limit: int, refusal: Callable[[int], ServiceError]) -> None:
        self._limit = limit
        self._refusal = refusal
        self._held: Counter[str] = Counter()

    def has_room(self, owner: str) -> bool:
        """Whether the owner may have one more."""
        return self._held[owner] < self._limit

    @contextmanager
    def place(self, owner: str) -> Iterator[None]:
        """Use one while the block lasts, or raise the refusal."""
        if not self.has_room(owner):
            raise self._refusal(self._limit)
        self._held[owner] += 1
        try:
            yield
        finally:
            _drop_one(self._held, owner)


class OwnerTurns:
    """A semaphore that is fair to owners; used from one thread (the event loop's).

    When a slot becomes free, the owner with the fewest slots is next, then the one that was served least
    recently; for each owner it is first come, first served.

    Parameters
    ----------
    at_once : int
        Slots.
    per_owner : int
        Maximum number of slots per owner. If below `at_once`, some are always free for others.
    """

    def __init__(self, at_once: int, per_owner: int) -> None:
        self._free = at_once
        self._per_owner = per_owner
        self._held: Counter[str] = Counter()
        # in the order of turns: an owner that was served moves to the end
        self._waiting: dict[str, deque[asyncio.Future[None]]] = {}

    @asynccontextmanager
    async def turn(self, owner: str) -> AsyncIterator[None]:
        """Wait for a slot and hold it while the block lasts."""
        await self.take(owner)
        try:
            yield
        finally:
            self.give_back(owner)

    async def take(self, owner: str) -> None:
        """Wait for a slot; the caller must give it back."""
        waiter = asyncio.get_running_loop().create_future()
        self._waiting.setdefault(owner, deque()).append(waiter)
        self._serve()
        try:
            await waiter
        except asyncio.CancelledError:
            if waiter.cancelled():
                self._forget(owner, waiter)
            else:  # served at this very moment
                self.give_back(owner)
            raise

    def give_back(self, owner: str) -> None:
        """Let the next one have the slot."""
        self._free += 1
        _drop_one(self._held, owner)
        self._serve()

    def _serve(self) -> None:
        while self._free:
            owner = min(self._waiting, key=self._held.__getitem__, default=None)
            if owner is None or self._held[owner] >= self._per_owner:
                return
            queue = self._waiting.pop(owner)
            waiter = queue.popleft()
            if queue:
                self._waiting[owner] = queue
            if waiter.done():  # its request has gone
                continue
            self._free -= 1
            self._held[owner] += 1
            waiter.set_result(None)

    def _forget(self, owner: str, waiter: asyncio.Future[None]) -> None:
        queue = self._waiting.get(owner)
        if queue is not None and waiter in queue:
            queue.remove(waiter)
            if not queue:
                del self._waiting[owner]


def _drop_one(held: Counter[str], owner: str) -> None:
    held[owner] -= 1
    if not held[owner]:
        del held[owner]
