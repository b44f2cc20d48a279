"""Messages five times or never, several reapers, a death between commit and message, wrong clocks."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from sqlalchemy import func, select

from app.jobs.records import JobStatus
from app.tables import job_events, jobs
from tests.faults.posting import Client, Posting
from tests.faults.rig import LEASE_S, REAP_EVERY_S, Rig

FIVE_TIMES = {"MORPHID_TEST_DELIVERIES": "5"}
HOUR_S = 3600

pytestmark = [pytest.mark.faults, pytest.mark.timeout(300)]


def count_events(rig: Rig, job_id: str, kind: str) -> int:
    """How often an event of a kind stands in a job's history."""
    query = select(func.count()).where(job_events.c.job_id == job_id, job_events.c.type == kind)
    with rig.database.read() as session:
        return int(session.scalar(query) or 0)


def test_every_message_comes_five_times(rig: Rig) -> None:
    """Five wake-ups for every job, from API, reaper and workers: each job is begun once."""
    rig.start_worker(slots=2, environment=FIVE_TIMES)
    rig.start_api(environment=FIVE_TIMES)
    client = Client(rig)
    posted = [client.post() for _ in range(12)]
    posted += [rig.add(steps=10, pause_s=0.02, deliveries=5) for _ in range(6)]
    rig.settle()
    assert {rig.job(job_id).attempt for job_id in posted} == {1}
    assert {count_events(rig, job_id, "started") for job_id in posted} == {1}


def test_three_reapers_give_a_lost_job_back_once(rig: Rig) -> None:
    """Three beats and two workers reap at the same time: what a dead worker held comes back once."""
    rig.start_worker("first", slots=2)
    rig.start_worker("second", slots=2)
    for number in (2, 3):
        rig.start_beat(f"beat-{number}")
    lost = [rig.add(steps=80, pause_s=0.1) for _ in range(4)]
    rig.until(lambda: all(rig.generation(job_id) >= 3 for job_id in lost), 60.0)
    for job_id in lost:
        rig.kill_runner_of(job_id)
    rig.until(lambda: all(rig.job(job_id).attempt == 2 for job_id in lost), 60.0)
    rig.settle()
    assert {rig.job(job_id).attempt for job_id in lost} == {2}
    assert {count_events(rig, job_id, "requeued") for job_id in lost} == {1}


def test_death_between_commit_and_message(rig: Rig, tmp_path: Path) -> None:
    """The API dies after a job's commit, before its message: the job runs; a repetition finds it."""
    crash = tmp_path / "crash"
    rig.start_worker()
    rig.start_api(environment={"MORPHID_TEST_CRASH_FILE": str(crash)})
    client = Client(rig)
    client.post()
    crash.touch()
    posting = Posting(client, [3.0], pause_s=0.0)
    posting.start()
    with rig.tended():
        posting.finish()
    committed = crash.with_suffix(".done").read_text()
    assert committed in rig.ledger.promises, "the repetition was given the job that was committed"
    assert client.took_s(None), "the connection broke before an answer"
    rig.settle()
    with rig.database.read() as session:
        assert session.scalar(select(func.count()).select_from(jobs)) == 2


@pytest.mark.parametrize("error_s", [HOUR_S, -HOUR_S])
def test_a_worker_whose_clock_is_an_hour_wrong(rig: Rig, error_s: int) -> None:
    """An hour fast or slow: no lease, no deadline, no lost message is judged by a worker's clock."""
    rig.start_worker(environment={"MORPHID_TEST_CLOCK_S": str(error_s)})
    lost_message = rig.add(steps=5, published=False)
    rig.until(lambda: rig.job(lost_message).finished, 60.0)
    # longer than its lease, with a deadline that is an hour from being over or long over by the wrong clock
    healthy = rig.add(steps=40, pause_s=1.5 * LEASE_S / 40, max_seconds=60.0)
    rig.until(lambda: rig.job(healthy).finished, 60.0)
    assert rig.job(healthy).attempt == 1
    overdue = rig.add(steps=1000, pause_s=0.1, max_seconds=1.0, ends=frozenset({"expired"}))
    rig.until(lambda: rig.job(overdue).status is JobStatus.RUNNING, 30.0)
    began = time.monotonic()
    rig.until(lambda: rig.job(overdue).finished, 60.0)
    assert 0.5 < time.monotonic() - began < 10.0
    killed = rig.add(steps=40, pause_s=0.1)
    rig.until(lambda: rig.generation(killed) >= 3, 30.0)
    rig.kill_runner_of(killed)
    died_at = time.monotonic()
    rig.until(lambda: rig.job(killed).attempt == 2, 60.0)
    # the last heartbeat's lease, a round of the reaper, and the noise of a busy machine
    assert time.monotonic() - died_at < LEASE_S + 2 * REAP_EVERY_S + 15.0
