"""One of the processes that hammer a job store: ``python -m tests.faults.hammer URL SECONDS``."""

from __future__ import annotations

import json
import sys
import threading
import time

from sqlalchemy import func, select

from app import on_end  # noqa: F401 - jobs end here
from app.database import Database
from app.jobs.repository import JobFilter, list_jobs
from app.jobs.store import claim_job, create_job, finish_job, save_progress
from app.tables import jobs

WRITERS, READERS = 3, 2
CHECKPOINT = bytes(50_000)


class Hammer:
    """Threads that live through whole jobs and others that look at them.

    Parameters
    ----------
    database : the job store.
    seconds : how long.
    """

    def __init__(self, database: Database, seconds: float) -> None:
        self._database = database
        self._until = time.monotonic() + seconds
        self.errors: list[str] = []
        self.jobs = self.writes = 0
        self.longest_s = 0.0

    def write(self) -> None:
        """Make a job, claim it, report progress, end it; and again."""
        while time.monotonic() < self._until:
            job_id = self._timed(
                lambda session: create_job(session, owner="local", operation="walk", request={}).id
            )
            claim = self._timed(lambda session, job_id=job_id: claim_job(session, job_id, "hammer"))
            assert claim is not None
            for number in range(3):
                progress = {"fraction": number / 3.0}
                self._timed(lambda s, c=claim, p=progress: save_progress(s, c, p, CHECKPOINT))
            assert self._timed(lambda s, c=claim: finish_job(s, c, "succeeded", result={"a": 1}))
            self.jobs += 1

    def read(self) -> None:
        """List jobs and count them."""
        while time.monotonic() < self._until:
            with self._database.read() as session:
                list_jobs(session, "local", JobFilter(), cursor=None, limit=50)
                session.scalar(select(func.count()).select_from(jobs))

    def _timed(self, action):  # type: ignore[no-untyped-def]  # any transaction
        began = time.monotonic()
        with self._database.write() as session:
            answer = action(session)
        self.writes += 1
        self.longest_s = max(self.longest_s, time.monotonic() - began)
        return answer

    def guarded(self, action) -> None:  # type: ignore[no-untyped-def]
        """Run a thread's work and keep what it meets."""
        try:
            action()
        except Exception as error:  # noqa: BLE001 - every error is a finding
            self.errors.append(repr(error))


def main(url: str, seconds: float) -> None:
    """Hammer and report."""
    hammer = Hammer(Database(url), seconds)
    work = [hammer.write] * WRITERS + [hammer.read] * READERS
    threads = [threading.Thread(target=hammer.guarded, args=(action,)) for action in work]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    report = {name: getattr(hammer, name) for name in ("jobs", "writes", "longest_s", "errors")}
    sys.stdout.write(json.dumps(report))


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]))
