"""Answer a wake-up: claim the work that should be done next, a job or a chunk of one, and do it."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import app.on_end  # noqa: F401 - workers end jobs
from app.database import Database, Session
from app.jobs.chunk_rows import Unit, UnitKind
from app.jobs.chunks import claim_chunk, must_be_taken_over, take_over
from app.jobs.records import ChunkClaim, Claim
from app.jobs.store import claim_job
from app.jobs.turns import next_unit
from worker.attempt import Attempt, Ending
from worker.chunk import ChunkFlight
from worker.job_cache import JobCache
from worker.lease import LeaseKeeper
from worker.numerics import Kernels
from worker.operations import Begin, Document, find_operation
from worker.spans import attempt_span

log = logging.getLogger(__name__)

CLAIM_TRIES = 5  # each lost race means that another worker took a job
CHUNK_LEASE_S = 10.0  # a chunk that is lost holds up its generation for so long and a round of the reaper
HEARTBEATS_PER_LEASE = 5  # a chunk of a second needs none


def tell_nobody(_job_id: str, _count: int) -> None:
    """Send no wake-up messages: the reaper does."""


def never() -> bool:
    """Return False: no shutdown requested."""
    return False


@dataclass(frozen=True)
class Runner:
    """Everything that running jobs needs, handed in.

    Parameters
    ----------
    database : the job store.
    kernels : the compiled kernels of this process.
    worker_name : shown in the job's events.
    lease_s, heartbeat_s : life and renewal of a claim, s.
    find_operation : name -> function that begins the work.
    shutting_down : tells that this worker is asked to end.
    clock : seconds that only rise.
    publish : sends a number of wake-up messages for a job.
    chunk_lease_s : life of a claim on a chunk, s: shorter, for a lost one holds up its whole generation.
    cache : the work of the jobs that this process saw last.
    """

    database: Database
    kernels: Kernels
    worker_name: str
    lease_s: float
    heartbeat_s: float
    find_operation: Callable[[str], Begin] = find_operation
    shutting_down: Callable[[], bool] = never
    clock: Callable[[], float] = time.monotonic
    publish: Callable[[str, int], None] = tell_nobody
    chunk_lease_s: float = CHUNK_LEASE_S
    cache: JobCache = field(default_factory=JobCache)

    def run_next(self) -> tuple[Ending, str | None]:
        """Do what should be done next: a message only says that there is work, the rows say which.

        Returns
        -------
        The ending and the job's id.
        """
        claim = None if self.shutting_down() else self._claim()
        if claim is None:
            return Ending.NOTHING_QUEUED, None
        with attempt_span(claim):
            if isinstance(claim, ChunkClaim):
                ending, error = self._fly(claim)
            else:
                return self._attempt(claim), claim.job_id
        taken = None if ending is Ending.RELEASED else self._taken_over(claim.job_id, error)
        if taken is not None:
            with attempt_span(taken):
                ending = self._attempt(taken, error)
        return ending, claim.job_id

    def _fly(self, chunk: ChunkClaim) -> tuple[Ending, Document | None]:
        keeper = LeaseKeeper(
            self.database,
            chunk,
            lease_s=self.chunk_lease_s,
            heartbeat_s=self.chunk_lease_s / HEARTBEATS_PER_LEASE,
            shutting_down=self.shutting_down,
        )
        with keeper:
            flight = ChunkFlight(self.database, chunk, keeper, self.kernels, self.cache, clock=self.clock)
            ending = flight.run(self.find_operation)
        log.debug("job %s: chunk %d.%d %s", chunk.job_id, chunk.generation, chunk.number, ending.value)
        return ending, flight.error

    def _taken_over(self, job_id: str, error: Document | None) -> Claim | None:
        """Claim a spread job that must go on, now that its chunks are stored or its end has come."""
        if error is None:
            with self.database.read() as connection:
                if not must_be_taken_over(connection, job_id):
                    return None
        with self.database.write() as connection:
            return take_over(connection, job_id, self.worker_name, self.lease_s, whatever=error is not None)

    def _attempt(self, claim: Claim, error: Document | None = None) -> Ending:
        log.info("job %s: attempt %d of %d", claim.job_id, claim.attempt, claim.max_attempts)
        keeper = LeaseKeeper(
            self.database,
            claim,
            lease_s=self.lease_s,
            heartbeat_s=self.heartbeat_s,
            shutting_down=self.shutting_down,
        )
        with keeper:
            attempt = Attempt(self.database, claim, keeper, self.kernels, self.cache, clock=self.clock)
            if error is None:
                ending = attempt.run(self.find_operation)
            else:
                ending = attempt.give_up(self.find_operation, error)
        if attempt.handed_out:
            self.publish(claim.job_id, attempt.handed_out)
        log.info("job %s: %s", claim.job_id, ending.value)
        return ending

    def _claim(self) -> Claim | ChunkClaim | None:
        for _ in range(CLAIM_TRIES):
            with self.database.write() as connection:
                unit = next_unit(connection)
                if unit is None:
                    return None
                claim = self._take(connection, unit)
            if claim is not None:
                return claim
        return None

    def _take(self, session: Session, unit: Unit) -> Claim | ChunkClaim | None:
        if unit.kind is UnitKind.CHUNK:
            return claim_chunk(session, unit, self.worker_name, self.chunk_lease_s)
        if unit.kind is UnitKind.SPREAD:
            return take_over(session, unit.job_id, self.worker_name, self.lease_s)
        return claim_job(session, unit.job_id, self.worker_name, self.lease_s)
