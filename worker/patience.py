"""Writing into a job store that may be away: as often as it takes, while the claim is ours."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from typing import TypeVar

from sqlalchemy import Connection
from sqlalchemy.exc import SQLAlchemyError

from app.database import Database
from app.database_errors import DatabaseTrouble, trouble_of
from app.jobs.store import load_request
from worker.lease import StopReason, Vigil
from worker.operations import Document

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


class Patient:
    """Who holds a claim and waits for the job store.

    Parameters
    ----------
    database : the job store.
    vigil : keeps the claim alive and knows when to stop.
    job_id : for the log.
    clock : seconds that only rise.
    sleep : waits a number of seconds.
    """

    def __init__(
        self,
        database: Database,
        vigil: Vigil,
        job_id: str,
        *,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._database = database
        self._vigil = vigil
        self._job_id = job_id
        self._clock = clock
        self._sleep = sleep

    def _request(self) -> Document:
        """The job's request."""

        def load() -> Document:
            with self._database.read() as connection:
                return load_request(connection, self._job_id)

        return self._patiently(load)

    def _persist(self, write: Callable[[Connection], bool], *, even_if_full: bool = False) -> None:
        """Write in a transaction of its own; wait out a job store that is away.

        Parameters
        ----------
        even_if_full : use the job store's reserve of disk space: for a few rows that must be written.

        Raises
        ------
        StaleClaim : the store refused the write, or this worker ends before the store is back.
        StorageFull : there is no room.
        """

        def once() -> bool:
            if even_if_full:
                return self._database.write_even_if_full(write)
            with self._database.write() as connection:
                return write(connection)

        if not self._patiently(once):
            raise StaleClaim

    def _patiently(self, action: Callable[[], Answer]) -> Answer:
        """Do something with the job store as often as it takes; nobody else can have the job meanwhile."""
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
                log.warning("job %s: the job store is %s, trying again", self._job_id, trouble.value)
            if self._vigil.reason is StopReason.LOST:
                raise StaleClaim
            if self._vigil.reason is StopReason.SHUTDOWN:
                shutdown_at = self._clock() if shutdown_at is None else shutdown_at
                if self._clock() - shutdown_at > SHUTDOWN_PATIENCE_S:
                    raise StaleClaim
            self._sleep(min(pause_s, 1.0) if shutdown_at is not None else pause_s)
            pause_s = min(2.0 * pause_s, LONGEST_PAUSE_S)
