"""Retry transactions while the job store is away, for as long as the claim is ours."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from typing import TypeVar

from sqlalchemy.exc import SQLAlchemyError

from app.database import Database, Session
from app.database_errors import DatabaseTrouble, trouble_of
from worker.lease import LeaseKeeper, StopReason

log = logging.getLogger(__name__)
Answer = TypeVar("Answer")

FIRST_PAUSE_S = 0.5  # before the job store is asked again; doubles
LONGEST_PAUSE_S = 4.0
FULL_TRIES = 4  # somebody may be making room; then the job says that there is none
SHUTDOWN_PATIENCE_S = 5.0  # a worker that ends waits so long for the job store; then the reaper does the rest


class StaleClaim(Exception):
    """The store refused a write: the job is someone else's now."""


class StorageFull(Exception):
    """The job store has no room for what should be written; what was there before still is."""


class Retry:
    """Transactions of the holder of a claim, repeated until the job store is back.

    Nobody else can take the job meanwhile; if only this worker is cut off, the fence keeps its writes out.

    Parameters
    ----------
    database : Database
        The job store.
    keeper : LeaseKeeper
        Keeps the claim alive and knows when to stop.
    clock : callable
        Seconds that only rise.
    sleep : callable
        Waits a number of seconds.
    """

    def __init__(
        self,
        database: Database,
        keeper: LeaseKeeper,
        *,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._database = database
        self._keeper = keeper
        self._clock = clock
        self._sleep = sleep

    def read(self, load: Callable[[Session], Answer]) -> Answer:
        """Read in a transaction of its own."""

        def once() -> Answer:
            with self._database.read() as session:
                return load(session)

        return self._call(once)

    def write(self, write: Callable[[Session], bool], *, even_if_full: bool = False) -> None:
        """Write in a transaction of its own.

        Parameters
        ----------
        write : callable
            Returns False when the claim is stale.
        even_if_full : bool
            Use the job store's reserve of disk space: for a few rows that must be written.

        Raises
        ------
        StaleClaim
            The store refused the write, or this worker ends before the store is back.
        StorageFull
            There is no room.
        """

        def once() -> bool:
            if even_if_full:
                return self._database.write_even_if_full(write)
            with self._database.write() as session:
                return write(session)

        if not self._call(once):
            raise StaleClaim

    def _call(self, action: Callable[[], Answer]) -> Answer:
        pause_s, tries, shutdown_at = FIRST_PAUSE_S, 0, None
        while True:
            try:
                return action()
            except SQLAlchemyError as error:
                trouble, tries = trouble_of(error), tries + 1
                if trouble is None:
                    raise
                if trouble is DatabaseTrouble.FULL and tries == FULL_TRIES:
                    raise StorageFull from error
                log.warning("the job store is %s, trying again", trouble.value)
            if self._keeper.reason is StopReason.LOST:
                raise StaleClaim
            if self._keeper.reason is StopReason.SHUTDOWN:
                shutdown_at = self._clock() if shutdown_at is None else shutdown_at
                if self._clock() - shutdown_at > SHUTDOWN_PATIENCE_S:
                    raise StaleClaim
            self._sleep(min(pause_s, 1.0) if shutdown_at is not None else pause_s)
            pause_s = min(2.0 * pause_s, LONGEST_PAUSE_S)
