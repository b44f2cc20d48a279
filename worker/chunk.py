"""One chunk of a spread job: flown, and its outcome stored exactly once."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable

from app.database import Database
from app.jobs.chunks import ChunkClaim, finish_chunk, give_back_chunk
from worker.attempt import Ending, told_error
from worker.lease import StopReason, Vigil
from worker.numerics import Kernels
from worker.operations import Begin, Document, SpreadWork, WorkInterrupted
from worker.patience import Patient, StaleClaim
from worker.works import Works

log = logging.getLogger(__name__)


class ChunkFlight(Patient):
    """The work on one claimed chunk.

    Parameters
    ----------
    database : the job store.
    chunk : the right to store its outcome.
    vigil : keeps the claim alive and knows when to stop.
    kernels : the compiled kernels of this process.
    works : the work of the jobs that this process saw last.
    clock : seconds that only rise.

    Attributes
    ----------
    error : why the whole job cannot be done, if the flight has shown that.
    """

    def __init__(
        self,
        database: Database,
        chunk: ChunkClaim,
        vigil: Vigil,
        kernels: Kernels,
        works: Works,
        *,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__(database, vigil, chunk.job_id, clock=clock)
        self._chunk = chunk
        self._kernels = kernels
        self._works = works
        self.error: Document | None = None

    def run(self, find_operation: Callable[[str], Begin]) -> Ending:
        """Fly the chunk and store what comes of it."""
        try:
            outcome = self._outcome(find_operation)
            self._vigil.heed()
            self._persist(lambda connection: finish_chunk(connection, self._chunk, outcome))
        except WorkInterrupted:
            self._vigil.heed()
            return self._stopped()
        except StaleClaim:
            return Ending.ABANDONED
        except Exception as error:  # noqa: BLE001 - whatever it is, the job says so
            self.error = told_error(error, self._job_id)
            return Ending.FAILED
        return Ending.CHUNK_STORED

    def _outcome(self, find_operation: Callable[[str], Begin]) -> bytes:
        if not self._kernels.wait(self._vigil.should_stop):
            raise WorkInterrupted
        prepared = self._works.prepared(
            self._job_id,
            lambda: find_operation(self._chunk.operation),
            self._request,
            self._kernels.threads,
        )
        if not isinstance(prepared.work, SpreadWork):
            raise TypeError(f"operation {self._chunk.operation!r} cannot be spread")
        return prepared.work.fly(self._chunk.task, self._vigil.should_stop)

    def _stopped(self) -> Ending:
        """Leave the chunk: to the next worker, or alone if its job is ending."""
        if self._vigil.reason is not StopReason.SHUTDOWN:
            return Ending.ABANDONED
        try:
            self._persist(lambda connection: give_back_chunk(connection, self._chunk))
        except StaleClaim:
            return Ending.ABANDONED
        return Ending.RELEASED
