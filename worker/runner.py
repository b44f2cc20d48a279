"""Handle a wake-up: claim the next work, a job or a chunk of one, and do it."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass

import app.on_end  # noqa: F401 - workers end jobs
from app.database import Database, Session
from app.jobs.chunks import claim_chunk, must_be_taken_over, take_over
from app.jobs.records import ChunkClaim, Claim
from app.jobs.rows import Unit, UnitKind
from app.jobs.store import claim_job
from app.jobs.turns import next_unit
from worker.attempt import Attempt, Ending, fly_chunk
from worker.job_cache import JobCache
from worker.lease import LeaseKeeper
from worker.numerics import Kernels
from worker.operations import Begin, Document, find_operation
from worker.spans import attempt_span

log = logging.getLogger(__name__)

CLAIM_TRIES = 5  # each race lost means that another worker took a job
CHUNK_LEASE_S = 10.0  # a lost chunk delays its generation by this time plus one round of the reaper
HEARTBEATS_PER_LEASE = 5  # a chunk of about a second needs none


def publish_nothing(_job_id: str, _count: int) -> None:
    """Send no wake-up messages; the reaper will."""


def never() -> bool:
    """Return False: no shutdown requested."""
    return False


@dataclass
class Runner:
    """Runs jobs with the given dependencies.

    Parameters
    ----------
    database : the job store.
    kernels : the compiled kernels of this process.
    worker_name : shown in the job's events.
    lease_s, heartbeat_s : life and renewal of a claim, s.
    find_operation : name -> function that starts the work.
    shutting_down : returns whether a shutdown of this worker was requested.
    publish : sends a number of wake-up messages for a job.
    chunk_lease_s : life of a claim on a chunk, s; short, because a lost one holds up its whole generation.
    """

    database: Database
    kernels: Kernels
    worker_name: str
    lease_s: float
    heartbeat_s: float
    find_operation: Callable[[str], Begin] = find_operation
    shutting_down: Callable[[], bool] = never
    publish: Callable[[str, int], None] = publish_nothing
    chunk_lease_s: float = CHUNK_LEASE_S

    def __post_init__(self) -> None:
        self._cache = JobCache(self.find_operation, self.kernels.threads)

    def run_next(self) -> tuple[Ending, str | None]:
        """Do the next work according to the rows; return the ending and the job's id."""
        claim = None if self.shutting_down() else self._claim()
        if claim is None:
            return Ending.NOTHING_QUEUED, None
        with attempt_span(claim):
            if not isinstance(claim, ChunkClaim):
                return self._attempt(claim), claim.job_id
            ending, error = self._fly(claim)
        taken = None if ending is Ending.RELEASED else self._taken_over(claim.job_id, error)
        if taken is not None:
            with attempt_span(taken):
                ending = self._attempt(taken, error)
        return ending, claim.job_id

    def _fly(self, chunk: ChunkClaim) -> tuple[Ending, Document | None]:
        with self._keeper(chunk, self.chunk_lease_s, self.chunk_lease_s / HEARTBEATS_PER_LEASE) as keeper:
            ending, error = fly_chunk(chunk, keeper, self.kernels, self._cache)
        log.debug("job %s: chunk %d.%d %s", chunk.job_id, chunk.generation, chunk.number, ending.value)
        return ending, error

    def _taken_over(self, job_id: str, error: Document | None) -> Claim | None:
        """Claim a spread job that must continue because its chunks are stored or it must end."""
        if error is None:
            with self.database.read() as session:
                if not must_be_taken_over(session, job_id):
                    return None
        with self.database.write() as session:
            return take_over(session, job_id, self.worker_name, self.lease_s, whatever=error is not None)

    def _attempt(self, claim: Claim, error: Document | None = None) -> Ending:
        log.info("job %s: attempt %d of %d", claim.job_id, claim.attempt, claim.max_attempts)
        with self._keeper(claim, self.lease_s, self.heartbeat_s) as keeper:
            attempt = Attempt(claim, keeper, self.kernels, self._cache)
            ending = attempt.run() if error is None else attempt.give_up(error)
        if attempt.handed_out:
            self.publish(claim.job_id, attempt.handed_out)
        log.info("job %s: %s", claim.job_id, ending.value)
        return ending

    def _keeper(self, claim: Claim, lease_s: float, heartbeat_s: float) -> LeaseKeeper:
        return LeaseKeeper(
            self.database,
            claim,
            lease_s=lease_s,
            heartbeat_s=heartbeat_s,
            shutting_down=self.shutting_down,
        )

    def _claim(self) -> Claim | None:
        for _ in range(CLAIM_TRIES):
            with self.database.write() as session:
                unit = next_unit(session)
                if unit is None:
                    return None
                claim = self._take(session, unit)
            if claim is not None:
                return claim
        return None

    def _take(self, session: Session, unit: Unit) -> Claim | None:
        if unit.kind is UnitKind.CHUNK:
            return claim_chunk(session, unit, self.worker_name, self.chunk_lease_s)
        if unit.kind is UnitKind.SPREAD:
            return take_over(session, unit.job_id, self.worker_name, self.lease_s)
        return claim_job(session, unit.job_id, self.worker_name, self.lease_s)
