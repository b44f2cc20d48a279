"""Jobs spread over workers: nothing is lost, nothing counts twice, every end is reached."""

from __future__ import annotations

import threading
import time
from typing import Any

import pytest
from sqlalchemy import update

from app.database import database_time
from app.jobs.reaper import LOSSES_PER_ATTEMPT, reap
from app.jobs.records import JobStatus
from app.jobs.store import Terms, request_cancel
from app.tables import job_chunks, jobs
from tests.worker.spread.conftest import FLOCK, OWNER, Killed, Spread
from tests.worker.spread.flocks import alone
from worker.attempt import Ending

BIRDS, GENERATIONS = FLOCK["birds"], FLOCK["generations"]
SECOND_LIFE = 3600.0  # s: far beyond every lease


def killed_once(spread: Spread, generation: int) -> None:
    """Let the worker that flies the first part of a generation end there without a word, once."""
    fresh = [True]

    def before(now: int, _places: list[int]) -> None:
        if now == generation and fresh:
            fresh.clear()
            raise Killed

    spread.flights.before = before


def rates_aside(payload: dict[str, Any]) -> dict[str, Any]:
    """What an event says apart from what a clock put into it."""
    return {key: value for key, value in payload.items() if key not in ("flights_per_s", "eta_s")}


def test_two_workers_give_the_result_of_one(spread: Spread) -> None:
    """A spread job ends with the result, files, progress and attempts of one that a single worker ran."""
    single = spread.add(mode="single")
    spread.work(spread.runner())
    together = spread.add(pause_s=0.001)
    spread.work_together([spread.runner("w1"), spread.runner("w2")], together)
    assert spread.job(together).status is JobStatus.SUCCEEDED
    assert spread.job(together).attempt == 1
    assert spread.result(together) == spread.result(single) == alone(FLOCK)
    last = [rates_aside(spread.events(job_id, "progress")[-1]) for job_id in (together, single)]
    assert last[0] == last[1]
    seen = [payload["generation"] for payload in spread.events(together, "progress")]
    assert seen == list(range(GENERATIONS + 1)), "every generation is reported once"
    assert spread.chunks(together) == []
    assert spread.flights.birds == 2 * BIRDS * GENERATIONS, "nothing is flown twice"


def test_one_message_for_each_chunk(spread: Spread) -> None:
    """Every generation that is handed out wakes as many workers as it has chunks."""
    job_id = spread.add(chunks=3)
    endings = spread.work(spread.runner())
    assert spread.messages[job_id] == 3 * GENERATIONS
    # the first claim, all chunks but the last of each generation, and those, which go on at once
    kinds = [Ending.HANDED_OUT] + GENERATIONS * [Ending.CHUNK_STORED, Ending.CHUNK_STORED, Ending.HANDED_OUT]
    assert endings == [*kinds[:-1], Ending.SUCCEEDED]


def test_progress_counts_all_workers(spread: Spread) -> None:
    """The displayed rate is that of the generation, whichever workers flew it."""
    job_id = spread.add(pause_s=0.01)
    spread.work_together([spread.runner("w1"), spread.runner("w2")], job_id)
    rates = [payload["flights_per_s"] for payload in spread.events(job_id, "progress")][1:]
    # 100 flights a second and worker at most; a busy machine is slower, never faster
    assert all(0.0 < rate <= 200.0 for rate in rates)
    assert max(rates) > 20.0


def test_a_killed_worker_costs_its_chunk(spread: Spread) -> None:
    """A worker that dies in mid-generation: its chunk alone is flown again, and the result is the same."""
    job_id = spread.add()
    killed_once(spread, generation=2)
    doomed, other = spread.runner("doomed"), spread.runner("other")
    with pytest.raises(Killed):
        spread.work(doomed)
    spread.work(other)
    (stuck,) = [chunk for chunk in spread.chunks(job_id) if chunk.status == "running"]
    assert stuck.worker == "doomed"
    with spread.database.write() as session:
        assert reap(session).publish == (), "its lease still runs"
        assert reap(session, now=time.time() + SECOND_LIFE).publish == (job_id,)
    spread.work(other)
    assert spread.job(job_id).status is JobStatus.SUCCEEDED
    assert spread.job(job_id).attempt == 1
    assert spread.result(job_id) == alone(FLOCK)
    assert spread.flights.birds == BIRDS * GENERATIONS + BIRDS // 4


def test_a_late_outcome_changes_nothing(spread: Spread) -> None:
    """A worker that slept past its lease stores nothing: not into the chunk, not into later generations."""
    job_id = spread.add()
    woken, asleep = threading.Event(), threading.Event()

    def before(generation: int, _places: list[int]) -> None:
        if generation == 1 and threading.current_thread().name == "sleeper":
            asleep.set()
            woken.wait(20.0)

    spread.flights.before = before
    endings: list[Ending] = []
    sleeper = threading.Thread(
        target=lambda: endings.extend(spread.work(spread.runner("sleeper"))), name="sleeper"
    )
    sleeper.start()
    assert asleep.wait(20.0)
    with spread.database.write() as session:
        reap(session, now=time.time() + SECOND_LIFE)
    spread.work(spread.runner("other"))
    assert spread.job(job_id).status is JobStatus.SUCCEEDED
    woken.set()
    sleeper.join(20.0)
    assert endings[-1] is Ending.ABANDONED
    assert spread.result(job_id) == alone(FLOCK)


def test_nobody_advances_a_generation_that_is_flown(spread: Spread) -> None:
    """A worker that dies between storing the last chunk and advancing: the reaper wakes another, who does."""
    job_id = spread.add()
    runner = spread.runner()
    spread.work(runner, maximum=1)
    with spread.database.write() as session:
        outcome = b"[1, 2, 3]"
        session.execute(update(job_chunks).values(status="done", outcome=outcome, at=database_time() - 10.0))
        assert reap(session).publish == (job_id,)
    assert runner.run_next()[0] is Ending.HANDED_OUT
    assert (spread.job(job_id).progress or {})["generation"] == 1


def test_a_generation_survives_whoever_advances_it(spread: Spread) -> None:
    """A worker that dies while it advances: the job is queued again with its outcomes; one attempt counts."""
    job_id = spread.add()
    runner = spread.runner()
    spread.work(runner, maximum=1 + 3)
    with spread.database.write() as session:  # the last chunk is stored and the job taken over, then nothing
        session.execute(
            update(job_chunks)
            .where(job_chunks.c.status == "open")
            .values(status="done", outcome=runner_outcome(spread, job_id))
        )
        session.execute(
            update(jobs).values(lease_until=database_time() - 1.0, worker="dead", fence=jobs.c.fence + 1)
        )
        assert reap(session).requeued == (job_id,)
    flown = spread.flights.birds
    spread.work(runner)
    assert spread.result(job_id) == alone(FLOCK)
    assert spread.job(job_id).attempt == 2
    assert spread.flights.birds == flown + BIRDS * (GENERATIONS - 1), "what was stored is not flown again"


def runner_outcome(spread: Spread, job_id: str) -> bytes:
    """What the open chunk of a job brings."""
    from tests.worker.spread.flocks import Flock

    (chunk,) = [chunk for chunk in spread.chunks(job_id) if chunk.status == "open"]
    return Flock(FLOCK).fly(chunk.task, lambda: False)


def test_a_chunk_that_kills_its_workers_gives_up(spread: Spread) -> None:
    """A chunk that is lost in every attempt ends its job as `worker_lost`; the queue goes on."""
    job_id = spread.add(terms=Terms(max_attempts=1))

    def always(generation: int, places: list[int]) -> None:
        if generation == 1 and len(places) < BIRDS:
            raise Killed

    spread.flights.before = always
    for lost in range(1, 100):
        with pytest.raises(Killed):
            spread.work(spread.runner(f"w{lost}"))
        with spread.database.write() as session:
            report = reap(session, now=time.time() + SECOND_LIFE)
        if report.failed:
            break
    assert lost == LOSSES_PER_ATTEMPT
    job = spread.job(job_id)
    assert job.status is JobStatus.FAILED
    assert (job.error or {})["code"] == "worker_lost"
    assert spread.chunks(job_id) == []
    other = spread.add(mode="single")
    spread.work(spread.runner())
    assert spread.job(other).status is JobStatus.SUCCEEDED


def test_a_chunk_that_is_refused_fails_the_job(spread: Spread) -> None:
    """What a chunk says of why it cannot be flown, the job says; the best so far stays."""
    job_id = spread.add(refuse_at=3)
    endings = spread.work(spread.runner())
    assert endings[-1] is Ending.FAILED
    job = spread.job(job_id)
    assert (job.error or {})["detail"] == "the flock fell from the sky"
    assert (spread.result(job_id) or {})["generation"] == 3
    assert job.partial
    assert spread.chunks(job_id) == []


def test_a_stopped_worker_gives_its_chunk_back(spread: Spread) -> None:
    """When a worker shuts down, another flies its chunk at once, and no attempt is counted."""
    job_id = spread.add(pause_s=0.5)
    spread.work(spread.runner(), maximum=1)
    requested_at = time.monotonic() + 0.2
    stopped = spread.runner(shutting_down=lambda: time.monotonic() > requested_at)
    assert stopped.run_next() == (Ending.RELEASED, job_id)
    assert time.monotonic() - requested_at < 2.0, "what is promised of every stop"
    assert {(chunk.status, chunk.attempt) for chunk in spread.chunks(job_id)} == {("open", 0)}


@pytest.mark.parametrize("why", ["cancel", "deadline"])
def test_a_spread_job_ends_with_its_best(spread: Spread, why: str) -> None:
    """Cancelled or out of time while chunks are flown: it ends within two seconds with the best so far."""
    job_id = spread.add(pause_s=0.02, generations=1000)
    threads = [
        threading.Thread(target=spread.work_together, args=([spread.runner(name)], job_id))
        for name in ("w1", "w2")
    ]
    for thread in threads:
        thread.start()
    while (spread.job(job_id).progress or {}).get("generation", 0) < 2:
        time.sleep(0.02)
    with spread.database.write() as session:
        if why == "cancel":
            request_cancel(session, OWNER, job_id)
        else:
            session.execute(update(jobs).values(deadline_at=database_time()))
    requested_at = time.monotonic()
    for thread in threads:
        thread.join(20.0)
    assert time.monotonic() - requested_at < 2.0
    assert spread.job(job_id).status is (JobStatus.CANCELLED if why == "cancel" else JobStatus.EXPIRED)
    assert (spread.result(job_id) or {})["generation"] >= 2
    assert spread.job(job_id).partial
    assert spread.chunks(job_id) == []


def test_a_spread_job_that_nobody_flies_is_cancelled_at_once(spread: Spread) -> None:
    """Without workers on it, it ends in the call itself like a queued job."""
    job_id = spread.add()
    spread.work(spread.runner(), maximum=1)
    with spread.database.write() as session:
        session.execute(update(job_chunks).values(at=database_time() - 5.0))
        assert request_cancel(session, OWNER, job_id).status is JobStatus.CANCELLED
    assert spread.chunks(job_id) == []
    assert spread.work(spread.runner()) == []


def test_a_cancelled_job_between_two_chunks(spread: Spread) -> None:
    """Cancelled while its chunks wait for a worker: the next worker that is woken winds it down."""
    job_id = spread.add()
    runner = spread.runner()
    spread.work(runner, maximum=3)
    with spread.database.write() as session:
        assert request_cancel(session, OWNER, job_id).status is JobStatus.CANCELLING
    assert spread.work(runner) == [Ending.CANCELLED]
    assert (spread.result(job_id) or {})["partial"] is True


def test_a_cancelled_job_without_workers_ends_by_the_reaper(spread: Spread) -> None:
    """If no worker comes to wind a cancelled job down, the reaper ends it."""
    job_id = spread.add()
    spread.work(spread.runner(), maximum=1)
    with spread.database.write() as session:
        request_cancel(session, OWNER, job_id)
        assert reap(session).cancelled == ()
        assert reap(session, now=time.time() + 60.0).cancelled == (job_id,)
    assert spread.job(job_id).status is JobStatus.CANCELLED
    assert spread.chunks(job_id) == []


def test_lost_messages_are_repeated(spread: Spread) -> None:
    """Chunks that nobody heard of are announced again, a message each, but not while somebody is at work."""
    job_id = spread.add()
    spread.work(spread.runner(), maximum=1)
    with spread.database.write() as session:
        assert reap(session, republish_after_s=15.0).publish == ()
        session.execute(update(jobs).values(published_at=database_time() - 20.0))
        assert reap(session, republish_after_s=15.0).publish == (), "a chunk was touched just now"
        session.execute(update(job_chunks).values(at=database_time() - 20.0))
        assert reap(session, republish_after_s=15.0).publish == (job_id,) * 4
        assert reap(session, republish_after_s=15.0).publish == (), "just announced"
    spread.work(spread.runner(), maximum=1)
    with spread.database.write() as session:
        session.execute(update(jobs).values(published_at=database_time() - 20.0))
        assert reap(session, republish_after_s=15.0).publish == ()


def test_work_of_one_part_is_not_spread(spread: Spread) -> None:
    """A generation that makes one part only is flown where the job is."""
    job_id = spread.add(chunks=1)
    assert spread.work(spread.runner()) == [Ending.SUCCEEDED]
    assert spread.result(job_id) == alone(FLOCK)
    assert spread.messages == {}
