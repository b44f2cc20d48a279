"""What the service promised in a test, and what the rows must say of it at the end."""

from __future__ import annotations

import json
import threading
from dataclasses import dataclass, field
from functools import cache

from sqlalchemy import func, select

from app.database import Database
from app.documents import unpacked
from app.jobs.records import FINISHED
from app.tables import job_events, job_results, jobs
from tests.worker.conftest import Walk

SEED = 7
SUCCEEDED = frozenset({"succeeded"})


@cache
def undisturbed(steps: int) -> dict[str, int]:
    """Walk so far without any service."""
    walk = Walk({"seed": SEED, "steps": steps})
    *_, last = walk.steps(None, lambda: False)
    document: dict[str, int] = json.loads(last.checkpoint)
    return document


@dataclass(frozen=True)
class Promise:
    """One accepted job: how long its walk is and how it may end."""

    steps: int
    ends: frozenset[str]


@dataclass
class Ledger:
    """Every job that was accepted: a 202 was given, or its row was committed."""

    promises: dict[str, Promise] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def accept(self, job_id: str, steps: int, ends: frozenset[str] = SUCCEEDED) -> None:
        """Note a job that must come to one of these ends."""
        with self._lock:
            self.promises[job_id] = Promise(steps, ends)

    def statuses(self, database: Database) -> dict[str, str]:
        """Read the status of every accepted job; one that is lost is missing."""
        with database.read() as session:
            rows = session.execute(select(jobs.c.id, jobs.c.status)).all()
        return {row.id: row.status for row in rows if row.id in self.promises}

    def open(self, database: Database) -> list[str]:
        """Name the accepted jobs that have not ended."""
        statuses = self.statuses(database)
        return [job_id for job_id in self.promises if statuses.get(job_id) not in FINISHED]

    def assert_kept(self, database: Database) -> None:
        """No accepted job is lost, each has ended once, in a state it may end in, with the right result."""
        statuses = self.statuses(database)
        lost = self.promises.keys() - statuses.keys()
        assert not lost, f"accepted and lost: {lost}"
        with database.read() as session:
            for job_id, promise in self.promises.items():
                job = session.execute(select(jobs).where(jobs.c.id == job_id)).one()
                assert job.status in promise.ends, f"{job_id} is {job.status}: {job.error}"
                assert job.lease_until is None, f"{job_id} has ended and is still leased"
                events = session.execute(
                    select(job_events.c.seq, job_events.c.type)
                    .where(job_events.c.job_id == job_id)
                    .order_by(job_events.c.seq)
                ).all()
                final = [event.seq for event in events if event.type in FINISHED]
                assert final == [job.event_seq], f"{job_id} ended {len(final)} times: {events}"
                assert events[-1].type == job.status
                assert events[0].type == "queued"
                stored = session.execute(select(job_results).where(job_results.c.job_id == job_id)).all()
                assert len(stored) <= 1
                if job.status == "succeeded":
                    assert unpacked(stored[0].document) == undisturbed(promise.steps)
                    assert not job.partial
                elif stored:
                    document = unpacked(stored[0].document)
                    assert document.pop("partial") is True
                    # the best so far lies on the path of the undisturbed walk
                    assert document == undisturbed(document["step"])
            known = session.scalar(select(func.count()).select_from(jobs))
        print(f"ledger: {len(self.promises)} accepted, all ended once ({known} rows)")
