"""Answer a wake-up: claim the job that should run next and make one attempt at it."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass

from app.database import Database
from app.jobs.records import Claim
from app.jobs.store import claim_job
from app.jobs.turns import next_unit
from worker.attempt import Attempt, Ending
from worker.lease import Vigil
from worker.numerics import Kernels
from worker.operations import Begin, find_operation
from worker.telling import told

log = logging.getLogger(__name__)

CLAIM_TRIES = 5  # each lost race means that another worker took a job


def never() -> bool:
    """Tell that nobody asked this worker to end."""
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
    """

    database: Database
    kernels: Kernels
    worker_name: str
    lease_s: float
    heartbeat_s: float
    find_operation: Callable[[str], Begin] = find_operation
    shutting_down: Callable[[], bool] = never
    clock: Callable[[], float] = time.monotonic

    def run_next(self) -> tuple[Ending, str | None]:
        """Run the job that should run next: a message only says that there is one, the rows say which.

        Returns
        -------
        The ending and the job's id.
        """
        claim = None if self.shutting_down() else self._claim()
        if claim is None:
            return Ending.NOTHING_QUEUED, None
        with told(claim):
            return self._attempt(claim), claim.job_id

    def _attempt(self, claim: Claim) -> Ending:
        log.info("job %s: attempt %d of %d", claim.job_id, claim.attempt, claim.max_attempts)
        vigil = Vigil(
            self.database,
            claim,
            lease_s=self.lease_s,
            heartbeat_s=self.heartbeat_s,
            shutting_down=self.shutting_down,
        )
        with vigil:
            attempt = Attempt(self.database, claim, vigil, self.kernels, clock=self.clock)
            ending = attempt.run(self.find_operation)
        log.info("job %s: %s", claim.job_id, ending.value)
        return ending

    def _claim(self) -> Claim | None:
        for _ in range(CLAIM_TRIES):
            with self.database.write() as connection:
                unit = next_unit(connection)
                if unit is None:
                    return None
                claim = claim_job(connection, unit.job_id, self.worker_name, self.lease_s)
            if claim is not None:
                return claim
        return None
