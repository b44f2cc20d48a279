"""SIGKILL of each process at random moments of 50 jobs, and a worker that sleeps past its lease."""

from __future__ import annotations

import contextlib
import os
import random
import signal
import time

import psutil
import pytest

from app.jobs.records import JobStatus
from tests.faults.posting import Client, Posting
from tests.faults.rig import LEASE_S, Rig

JOBS = 50
MANY_ATTEMPTS = {"MORPHID_JOB_MAX_ATTEMPTS": "50"}  # the test kills more often than a poison job would

pytestmark = [pytest.mark.faults, pytest.mark.timeout(300)]


def kill_one(rig: Rig, victim: str, rng: random.Random) -> None:
    """SIGKILL a process of a kind."""
    if victim != "pool child":
        rig.kill(victim)
        return
    children = rig.pool_children()
    if children:
        with contextlib.suppress(ProcessLookupError):
            os.kill(rng.choice(children), signal.SIGKILL)


@pytest.mark.parametrize(
    ("victim", "kills"), [("pool child", 8), ("worker", 4), ("api", 4), ("broker", 4), ("beat", 4)]
)
def test_fifty_jobs_outlive_kills(rig: Rig, victim: str, kills: int) -> None:
    """Whatever dies, at whatever moment: 50 accepted jobs end once each, with the undisturbed result."""
    seed = int(os.environ.get("MORPHID_TEST_SEED", random.SystemRandom().randrange(10**6)))
    print(f"MORPHID_TEST_SEED={seed}")
    rng = random.Random(seed)
    rig.start_worker(slots=2)
    rig.start_api(environment=MANY_ATTEMPTS)
    posting = Posting(Client(rig), [2.5 + 0.1 * rng.randrange(20) for _ in range(JOBS)], pause_s=0.02)
    began = time.monotonic()
    posting.start()
    for _ in range(kills):
        pause_until = time.monotonic() + rng.uniform(0.2, 1.8)
        rig.until(lambda until=pause_until: time.monotonic() > until, 10.0)
        kill_one(rig, victim, rng)
    with rig.tended():
        posting.finish()
    rig.settle()
    posting.client.assert_honest(may_break=victim == "api")
    assert len(rig.ledger.promises) == JOBS
    print(f"{kills} kills of {victim}: {JOBS} jobs in {time.monotonic() - began:.1f} s")


def test_a_worker_asleep_past_its_lease_writes_in_vain(rig: Rig) -> None:
    """SIGSTOP beyond the lease, SIGCONT: another has the job by then, and the sleeper changes nothing."""
    rig.start_worker("first")
    job_id = rig.add(steps=60, pause_s=0.1)
    rig.until(lambda: rig.generation(job_id) >= 5, 30.0)
    sleeper = rig.runner_of(job_id)
    rig.start_worker("second")
    os.kill(sleeper, signal.SIGSTOP)
    try:
        rig.until(lambda: rig.job(job_id).attempt == 2, LEASE_S + 30.0)
        rig.until(lambda: rig.job(job_id).status is JobStatus.RUNNING, 5.0)
        assert rig.runner_of(job_id) != sleeper
    finally:
        os.kill(sleeper, signal.SIGCONT)
    rig.settle()
    assert rig.job(job_id).attempt == 2
    # the sleeper itself lives and takes part again
    jobs = [rig.add(steps=10, pause_s=0.1) for _ in range(6)]
    rig.settle()
    assert {rig.job(each).attempt for each in jobs} == {1}


def test_a_worker_asleep_with_its_parent(rig: Rig) -> None:
    """A whole worker stopped (a suspended machine), its job done by another: woken, it ends nothing twice."""
    worker = rig.start_worker("first")
    job_id = rig.add(steps=30, pause_s=0.1)
    rig.until(lambda: rig.generation(job_id) >= 5, 30.0)
    asleep = [worker.pid, *rig.pool_children("first")]
    for pid in asleep:
        os.kill(pid, signal.SIGSTOP)
    rig.start_worker("second")
    try:
        rig.until(lambda: rig.job(job_id).finished, 60.0)
    finally:
        for pid in asleep:
            os.kill(pid, signal.SIGCONT)
    late = [rig.add(steps=10, pause_s=0.05) for _ in range(4)]
    rig.until(lambda: all(rig.job(each).finished for each in late), 60.0)


def test_a_killed_parent_leaves_no_orphans(rig: Rig) -> None:
    """The worker's parent killed where nobody tidies up: its children die too; the next one goes on."""
    rig.start_worker()
    job_id = rig.add(steps=40, pause_s=0.1)
    rig.until(lambda: rig.generation(job_id) >= 5, 30.0)
    orphans = [psutil.Process(pid) for pid in rig.pool_children()]
    rig.leave_orphans("worker")
    _, left = psutil.wait_procs(orphans, timeout=10.0)
    assert left == []
    rig.bring_back("worker")
    rig.settle()
    assert rig.job(job_id).attempt == 2
