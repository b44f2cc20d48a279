"""Watches the keys of open requests: a waiting request is ended when its key is no longer valid.

A request is admitted by its key once, and may then wait for a minute or stream for hours. One query a second
checks the keys of all open requests, however many there are.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager, suppress

from sqlalchemy.exc import SQLAlchemyError

from app.database import Database
from app.errors import Unauthorized
from app.keys.records import ApiKey
from app.keys.repository import keys_by_id

LOOK_S = 1.0  # s between checks: a waiting request outlives its key by little more

logger = logging.getLogger(__name__)


class KeyInUse:
    """The key of one request, as long as the request lasts; used from the event loop's thread.

    Parameters
    ----------
    key : ApiKey or None
        As it was when the request was admitted; None if no keys are required.
    """

    def __init__(self, key: ApiKey | None = None) -> None:
        self.key = key
        self.lost = False
        self._waits: set[asyncio.Timeout] = set()

    def require_valid(self) -> None:
        """Raise `Unauthorized` when the key was revoked, has expired, or may do less than before."""
        if self.lost:
            raise Unauthorized

    @asynccontextmanager
    async def while_valid(self) -> AsyncIterator[None]:
        """Run the waiting block; as soon as the key is not valid, raise as `require_valid` does."""
        self.require_valid()
        try:
            async with asyncio.timeout(None) as wait:
                self._waits.add(wait)
                try:
                    yield
                finally:
                    self._waits.discard(wait)
        except TimeoutError:
            self.require_valid()
            raise

    def is_valid_as(self, now: ApiKey | None) -> bool:
        """Whether the key as it is `now` still lets its request do all that it did."""
        began = self.key
        if began is None:
            return True
        if now is None or now.state != "active" or now.owner != began.owner:
            return False
        return began.scopes <= now.scopes

    def lose(self) -> None:
        """End the request's wait."""
        self.lost = True
        now = asyncio.get_running_loop().time()
        for wait in self._waits:
            wait.reschedule(now)


class KeyWatch:
    """Checks the keys of all open requests.

    Parameters
    ----------
    database : Database
    on_lost : callable
        Called with a key that is no longer valid, before its requests are ended.
    """

    def __init__(self, database: Database, on_lost: Callable[[ApiKey], None]) -> None:
        self._database = database
        self._on_lost = on_lost
        self._in_use: dict[str, set[KeyInUse]] = {}
        self._task: asyncio.Task[None] | None = None

    def start(self) -> None:
        """Start watching."""
        self._task = asyncio.create_task(self._run(), name="key-watch")

    async def stop(self) -> None:
        """Stop watching."""
        if self._task is not None:
            self._task.cancel()
            with suppress(asyncio.CancelledError):
                await self._task

    @contextmanager
    def use(self, key: ApiKey) -> Iterator[KeyInUse]:
        """Watch the key of a request while the block lasts."""
        in_use = KeyInUse(key)
        requests = self._in_use.setdefault(key.id, set())
        requests.add(in_use)
        try:
            yield in_use
        finally:
            requests.discard(in_use)
            if not requests:
                del self._in_use[key.id]

    async def look(self) -> None:
        """End the requests whose keys are no longer valid."""
        ids = list(self._in_use)
        try:
            found = await asyncio.to_thread(self._read, ids)
        except SQLAlchemyError as error:
            logger.warning("cannot check the keys of waiting requests: %s", error)
            return
        for key_id in ids:
            for in_use in tuple(self._in_use.get(key_id, ())):
                if not in_use.lost and not in_use.is_valid_as(found.get(key_id)):
                    if in_use.key is not None:
                        self._on_lost(in_use.key)
                    in_use.lose()

    async def _run(self) -> None:
        while True:
            await asyncio.sleep(LOOK_S)
            if self._in_use:
                await self.look()

    def _read(self, ids: list[str]) -> dict[str, ApiKey]:
        with self._database.read() as session:
            return {key.id: key for key in keys_by_id(session, ids)}
