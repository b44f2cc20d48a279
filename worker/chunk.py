"""One chunk of a spread job: flown, and its outcome stored exactly once."""

from __future__ import annotations

import time
from collections.abc import Callable

from app.database import Database
from app.jobs.chunks import finish_chunk, give_back_chunk
from app.jobs.records import ChunkClaim
from worker.attempt import Ending, error_document
from worker.job_cache import JobCache
from worker.lease import LeaseKeeper, StopReason
from worker.numerics import Kernels
from worker.operations import Begin, Document, SpreadWork, WorkInterrupted
from worker.retry import Retry, StaleClaim


class ChunkFlight:
    """The work on one claimed chunk.

    Parameters
    ----------
    database : Database
        The job store.
    chunk : ChunkClaim
        The right to store its outcome.
    keeper : LeaseKeeper
        Keeps the claim alive and knows when to stop.
    kernels : Kernels
        The compiled kernels of this process.
    cache : JobCache
        The work of the jobs that this process saw last.
    clock : callable
        Seconds that only rise.

    Attributes
    ----------
    error : dict or None
        Why the whole job cannot be done, if the flight has shown that.
    """

    def __init__(
        self,
        database: Database,
        chunk: ChunkClaim,
        keeper: LeaseKeeper,
        kernels: Kernels,
        cache: JobCache,
        *,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._chunk = chunk
        self._keeper = keeper
        self._kernels = kernels
        self._cache = cache
        self._store = Retry(database, keeper, clock=clock)
        self.error: Document | None = None

    def run(self, find_operation: Callable[[str], Begin]) -> Ending:
        """Fly the chunk and store what comes of it."""
        try:
            outcome = self._outcome(find_operation)
            self._keeper.note_work_ended()
            self._store.write(lambda session: finish_chunk(session, self._chunk, outcome))
        except WorkInterrupted:
            self._keeper.note_work_ended()
            return self._stopped()
        except StaleClaim:
            return Ending.ABANDONED
        except Exception as error:  # noqa: BLE001 - whatever it is, the job says so
            self.error = error_document(error, self._chunk.job_id)
            return Ending.FAILED
        return Ending.CHUNK_STORED

    def _outcome(self, find_operation: Callable[[str], Begin]) -> bytes:
        if not self._kernels.wait(self._keeper.should_stop):
            raise WorkInterrupted
        work, _ = self._cache.prepared(self._chunk, self._store, find_operation, self._kernels.threads)
        if not isinstance(work, SpreadWork):
            raise TypeError(f"operation {self._chunk.operation!r} cannot be distributed")
        return work.fly(self._chunk.task, self._keeper.should_stop)

    def _stopped(self) -> Ending:
        """Leave the chunk: to the next worker, or alone if its job is ending."""
        if self._keeper.reason is not StopReason.SHUTDOWN:
            return Ending.ABANDONED
        try:
            self._store.write(lambda session: give_back_chunk(session, self._chunk))
        except StaleClaim:
            return Ending.ABANDONED
        return Ending.RELEASED
