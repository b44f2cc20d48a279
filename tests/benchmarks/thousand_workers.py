"""A thousand workers in virtual time: the job store's own code, and leases that are lost.

Run ``python -m tests.benchmarks.thousand_workers``. The database is a real one (SQLite) whose clock is the
simulation's; every claim, outcome, advance and round of the reaper is the service's own transaction. Only
three things are made up: how long a chunk flies, how long a transaction keeps the database (one after the
other), and which workers stall past their lease. All come from one seed: a run repeats to the digit.
"""

from __future__ import annotations

import heapq
import itertools
import random
import tempfile
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from sqlalchemy import event, select

from app.database import Database, Session, upgrade
from app.documents import unpacked
from app.jobs.chunks import (
    claim_chunk,
    finish_chunk,
    flown,
    hand_out,
    must_be_taken_over,
    take_over,
)
from app.jobs.reaper import reap
from app.jobs.records import ChunkClaim, Claim, JobStatus
from app.jobs.rows import Unit, UnitKind
from app.jobs.store import Terms, claim_job, create_job, finish_job, load_checkpoint, load_request
from app.jobs.turns import next_unit
from app.tables import job_results
from tests.worker.spread.flocks import Flock, alone
from worker.runner import CHUNK_LEASE_S, HEARTBEATS_PER_LEASE

DAY_S = 86_400.0
EPOCH_DAY = 2_440_587.5  # Julian day of 1970-01-01
BEGIN_S = 1_800_000_000.0
MESSAGE_S = 0.005  # from publishing to a worker's claim
JOB_LEASE_S = 60.0


@dataclass(frozen=True)
class Plan:
    """What is simulated.

    workers, jobs, owners, chunks, generations : how many. flight_s : a chunk's flights on a worker of usual
    speed, s; within a lease. advance_s : moving the swarm and packing it, s. write_s : how long a transaction
    keeps the database, s. lost : share of claims whose worker stalls past its lease. stall_s : how long, s.
    """

    workers: int = 1000
    jobs: int = 8
    owners: int = 4
    chunks: int = 256
    generations: int = 3
    flight_s: float = 8.0
    advance_s: float = 0.5
    write_s: float = 0.5e-3
    lost: float = 0.0
    stall_s: float = 40.0
    reap_every_s: float = 10.0
    max_attempts: int = 3
    seed: int = 1


@dataclass(frozen=True)
class Figures:
    """What came of it.

    efficiency : time of flights that counted over time of all workers. wasted : share of all flights that
    counted nothing. writes_per_s : transactions that write, mean and in the busiest ten seconds. busy : share
    of its time that the database was busy in those. same : every result is that of one worker.
    """

    makespan_s: float
    generation_s: float
    efficiency: float
    wasted: float
    claims: int
    lost: int
    refused: int
    writes_per_s: float
    peak_writes_per_s: float
    busy: float
    failed: int
    same: bool

    def line(self) -> str:
        """The figures on one line."""
        return (
            f"{self.makespan_s:7.1f} s in all, {self.generation_s:5.1f} s a generation, "
            f"efficiency {100 * self.efficiency:3.0f} %, wasted {100 * self.wasted:4.1f} %, "
            f"{self.writes_per_s:5.0f} writes/s (peak {self.peak_writes_per_s:5.0f}), "
            f"{self.claims} claims, {self.lost} lost, {self.refused} late, {self.failed} jobs failed, "
            f"results {'the same' if self.same else 'DIFFER'}"
        )


class Simulation:
    """Workers, a queue of messages, a database with a clock of its own, a reaper."""

    def __init__(self, plan: Plan, folder: Path) -> None:
        self.plan = plan
        self.now = BEGIN_S
        self.free_at = BEGIN_S  # of the database
        self.random = random.Random(plan.seed)
        self.speed = [self.random.uniform(0.8, 1.2) for _ in range(plan.workers)]
        url = f"sqlite:///{folder / 'jobs.sqlite3'}"
        upgrade(url)
        self.database = Database(url)
        event.listen(self.database.engine, "connect", self._own_clock)
        self.agenda: list[tuple[float, int, Callable[[], None]]] = []
        self.order = itertools.count()
        self.idle = list(range(plan.workers))[::-1]
        self.messages = 0
        self.claims = self.lost = self.refused = 0
        self.useful_s = self.wasted_s = 0.0
        self.writes: Counter[int] = Counter()  # by tens of seconds
        self.ended: dict[str, JobStatus] = {}
        self.ended_at = BEGIN_S

    def _own_clock(self, connection: Any, _record: Any) -> None:
        connection.create_function("julianday", 1, lambda _when: self.now / DAY_S + EPOCH_DAY)
        connection.execute("PRAGMA synchronous = OFF")  # no power cuts in here

    # the machinery

    def at(self, when: float, action: Callable[[], None]) -> None:
        """Do something at a time."""
        heapq.heappush(self.agenda, (when, next(self.order), action))

    def write(self, transaction: Callable[[Session], Any]) -> Any:
        """A transaction: the database does one after the other."""
        self.now = self.free_at = max(self.now, self.free_at) + self.plan.write_s
        self.writes[int((self.now - BEGIN_S) / 10.0)] += 1
        with self.database.write() as session:
            return transaction(session)

    def read(self, question: Callable[[Session], Any]) -> Any:
        """A question; readers wait for nobody."""
        with self.database.read() as session:
            return question(session)

    def publish(self, count: int) -> None:
        """Send messages; idle workers take them."""
        self.messages += count
        while self.messages and self.idle:
            self.messages -= 1
            worker = self.idle.pop()
            self.at(self.now + MESSAGE_S, lambda worker=worker: self.wake(worker))

    def run(self) -> Figures:
        """Play until every job has ended."""
        plan = self.plan
        ids = [self.post(number) for number in range(plan.jobs)]
        self.publish(plan.jobs)
        self.at(self.now + self.plan.reap_every_s, self.reap)
        while len(self.ended) < plan.jobs:
            when, _, action = heapq.heappop(self.agenda)
            self.now = max(self.now, when)
            action()
        makespan_s = self.ended_at - BEGIN_S
        busiest = max(self.writes.values()) / min(10.0, makespan_s)
        spent_s = self.useful_s + self.wasted_s
        return Figures(
            makespan_s=makespan_s,
            generation_s=makespan_s / plan.generations,
            efficiency=self.useful_s / (plan.workers * makespan_s),
            wasted=self.wasted_s / spent_s,
            claims=self.claims,
            lost=self.lost,
            refused=self.refused,
            writes_per_s=sum(self.writes.values()) / makespan_s,
            peak_writes_per_s=busiest,
            busy=busiest * plan.write_s,
            failed=sum(status is not JobStatus.SUCCEEDED for status in self.ended.values()),
            same=all(self._same(number, job_id) for number, job_id in enumerate(ids) if self._well(job_id)),
        )

    def _request(self, number: int) -> dict[str, Any]:
        plan = self.plan
        return {"seed": number, "birds": 2 * plan.chunks, "generations": plan.generations}

    def post(self, number: int) -> str:
        """Queue a job."""
        owner, request = f"owner{number % self.plan.owners}", self._request(number)
        terms = Terms(max_attempts=self.plan.max_attempts)
        job = self.write(
            lambda session: create_job(session, owner=owner, operation="flock", request=request, terms=terms)
        )
        return str(job.id)

    def _well(self, job_id: str) -> bool:
        return self.ended[job_id] is JobStatus.SUCCEEDED

    def _same(self, number: int, job_id: str) -> bool:
        query = select(job_results.c.document).where(job_results.c.job_id == job_id)
        data = self.read(lambda session: session.execute(query).scalar_one())
        return bool(unpacked(data) == alone(self._request(number)))

    # a worker, as `worker.runner` has it

    def wake(self, worker: int) -> None:
        """Take the next unit of work."""
        found = self.write(lambda session: self._take(session, f"w{worker}"))
        if found is None:
            self.idle.append(worker)
        elif isinstance(found, ChunkClaim):
            self.fly(worker, found)
        else:
            self.at(self.now + self.plan.advance_s, lambda: self.go_on(worker, found))

    def _take(self, session: Session, name: str) -> Claim | ChunkClaim | None:
        unit: Unit | None = next_unit(session)
        if unit is None:
            return None
        if unit.kind is UnitKind.CHUNK:
            return claim_chunk(session, unit, name, CHUNK_LEASE_S)
        if unit.kind is UnitKind.SPREAD:
            return take_over(session, unit.job_id, name, JOB_LEASE_S)
        return claim_job(session, unit.job_id, name, JOB_LEASE_S)

    def next(self, worker: int) -> None:
        """Get more work: by a waiting message, or by its own if there is work."""
        if self.messages:
            self.messages -= 1
            self.wake(worker)
        elif self.read(next_unit) is not None:
            self.wake(worker)
        else:
            self.idle.append(worker)

    def fly(self, worker: int, chunk: ChunkClaim) -> None:
        """Fly a chunk, or stall in the middle of it for longer than its lease lasts."""
        self.claims += 1
        flight_s = self.plan.flight_s / self.speed[worker]
        stalls = self.random.random() < self.plan.lost
        stall_s = self.plan.stall_s if stalls else 0.0
        self.lost += stalls
        self.wasted_s += flight_s if stalls else 0.0
        renewals = int(
            flight_s / (CHUNK_LEASE_S / HEARTBEATS_PER_LEASE)
        )  # heartbeats of a flight of usual length
        self.writes[int((self.now - BEGIN_S) / 10.0)] += renewals
        self.at(self.now + flight_s + stall_s, lambda: self.store(worker, chunk, 0.0 if stalls else flight_s))

    def store(self, worker: int, chunk: ChunkClaim, flight_s: float) -> None:
        """Store the outcome, late if it took no time that counts; who stored the last one goes on."""
        outcome = Flock({}).fly(chunk.task, lambda: False)
        if not self.write(lambda session: finish_chunk(session, chunk, outcome)):
            assert flight_s == 0.0, "who kept its lease is heard"
            self.refused += 1
            self.next(worker)
            return
        self.useful_s += flight_s
        if self.read(lambda session: must_be_taken_over(session, chunk.job_id)):
            name = f"w{worker}"
            claim = self.write(lambda session: take_over(session, chunk.job_id, name, JOB_LEASE_S))
            if claim is not None:
                self.at(self.now + self.plan.advance_s, lambda: self.go_on(worker, claim))
                return
        self.next(worker)

    def go_on(self, worker: int, claim: Claim) -> None:
        """Advance a claimed job by what its chunks brought, and hand out the next generation or finish."""
        work = Flock(self.read(lambda session: load_request(session, claim.job_id)))
        checkpoint, brought = self.read(
            lambda session: (load_checkpoint(session, claim), flown(session, claim))
        )
        if checkpoint is None:
            step = next(iter(work.steps(None, lambda: False)))
        else:
            assert brought is not None
            step = work.combine(checkpoint, brought.outcomes, brought.elapsed_s)
        tasks = work.tasks(step.checkpoint, self.plan.chunks)
        if tasks is None:
            document = work.outcome(step.checkpoint).document
            assert self.write(
                lambda session: finish_job(session, claim, JobStatus.SUCCEEDED, result=document)
            )
            self._end(claim.job_id, JobStatus.SUCCEEDED)
        else:
            assert self.write(lambda session: hand_out(session, claim, tasks, step.checkpoint, step.progress))
            self.publish(len(tasks))
        self.next(worker)

    def _end(self, job_id: str, status: JobStatus) -> None:
        self.ended[job_id] = status
        self.ended_at = self.now

    def reap(self) -> None:
        """One round of the reaper."""
        report = self.write(reap)
        for job_id in report.failed:
            self._end(job_id, JobStatus.FAILED)
        self.publish(len(report.publish))
        self.at(self.now + self.plan.reap_every_s, self.reap)


def simulate(plan: Plan) -> Figures:
    """Play a plan in a database of its own."""
    with tempfile.TemporaryDirectory() as folder:
        simulation = Simulation(plan, Path(folder))
        try:
            return simulation.run()
        finally:
            simulation.database.dispose()


def main() -> None:
    """Print the figures of `docs/distributed.md`."""
    usual = Plan()
    for name, plan in (
        ("nothing lost", usual),
        ("1 % of all chunks lost", replace(usual, lost=0.01)),
        ("10 % of all chunks lost", replace(usual, lost=0.1)),
        ("10 % lost, reaper every 2 s", replace(usual, lost=0.1, reap_every_s=2.0)),
        ("10 % lost, three times the jobs", replace(usual, lost=0.1, jobs=24)),
        ("chunks of 1 s, nothing lost", replace(usual, flight_s=1.0, advance_s=0.1)),
        ("one job on 256 workers, none lost", replace(usual, workers=256, jobs=1, owners=1)),
        ("one job on 256 workers, 10 % lost", replace(usual, workers=256, jobs=1, owners=1, lost=0.1)),
    ):
        print(f"{name:34s} {simulate(plan).line()}", flush=True)


if __name__ == "__main__":
    main()
