"""Reaper, retention and disk space inside the API process: they run even if all workers are busy for hours.

Workers reap too, whenever one is free. Each change is a compare-and-set, so they do not interfere.
"""

from __future__ import annotations

import logging
import random
import threading

from sqlalchemy.exc import SQLAlchemyError

from app.database import Database
from app.disk_space import give_back
from app.jobs.queue import Publisher
from app.jobs.reaper import log_ends, reap
from app.jobs.records import ReapReport
from app.jobs.retention import Keep, forget
from app.settings import Settings

REAP_EVERY_S = 10.0
FORGET_EVERY_S = 300.0
STOP_S = 5.0
GIVE_BACK_SLICES = 20  # slices of free pages per round, with a pause for other writers after each
PAUSE_S = 0.05

log = logging.getLogger(__name__)


class Upkeep:
    """One thread that runs a round every `reap_every_s`."""

    def __init__(
        self,
        database: Database,
        publisher: Publisher,
        settings: Settings,
        *,
        reap_every_s: float = REAP_EVERY_S,
    ) -> None:
        self._database = database
        self._publisher = publisher
        self._republish_after_s = settings.republish_after_s
        self._keep = Keep.of(settings)
        self._reap_every_s = reap_every_s
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="upkeep", daemon=True)

    def start(self) -> None:
        """Begin."""
        if self._database.reserve is not None:
            self._database.reserve.fill()
        self._thread.start()

    @property
    def alive(self) -> bool:
        """Whether the thread is still running."""
        return self._thread.is_alive()

    def stop(self) -> None:
        """Stop after the current round."""
        self._stopping.set()
        self._thread.join(STOP_S)

    def _run(self) -> None:
        forget_in_s = 0.0
        # so that processes started together do not all run at once
        pause_s = self._reap_every_s * random.uniform(0.5, 1.0)  # noqa: S311 - not security-relevant
        while not self._stopping.wait(pause_s):
            forget_in_s -= pause_s
            pause_s = self._reap_every_s
            try:
                self.reap()
                if forget_in_s <= 0.0:
                    more = self.forget()
                    forget_in_s = 0.0 if more else FORGET_EVERY_S
                self.tidy_disk()
            except SQLAlchemyError as error:
                log.warning("maintenance skipped, the database does not answer: %s", error)

    def tidy_disk(self) -> None:
        """Refill the reserve, and release the space of deleted rows."""
        if self._database.reserve is not None:
            self._database.reserve.fill()
        for _ in range(GIVE_BACK_SLICES):
            if not give_back(self._database) or self._stopping.wait(PAUSE_S):
                return

    def reap(self) -> ReapReport:
        """Run one round of the reaper."""
        with self._database.write() as session:
            report = reap(session, republish_after_s=self._republish_after_s)
        log_ends(report)
        for job_id in report.publish:
            self._publisher.publish(job_id)
        return report

    def forget(self) -> bool:
        """Run one round of retention; return whether there is more to delete."""
        if self._keep == Keep():
            return False
        with self._database.write() as session:
            forgotten = forget(session, self._keep)
        if forgotten.jobs or forgotten.trajectories:
            log.info("deleted %d jobs and %d trajectories", forgotten.jobs, forgotten.trajectories)
        return forgotten.more
