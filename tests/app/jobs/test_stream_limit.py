"""Laws of how many jobs one owner follows at once: streams and waiting requests have their places."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path

import httpx
import pytest

from app.observability.request_metrics import IN_FLIGHT
from app.settings import Settings
from tests.app.calls import fault
from tests.app.key_holders import holder, make_key
from tests.app.request_documents import simulate_document
from tests.app.running_service import DEAD_BROKER, RunningService, running_service
from tests.waiting import until

LIMIT = 3
WAIT_S = 4


@pytest.fixture(scope="module")
def limited(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningService]:
    """A service with keys where an owner may follow a few jobs at once."""
    folder: Path = tmp_path_factory.mktemp("limited")
    settings = Settings(
        database_url=f"sqlite:///{folder / 'service.sqlite3'}",
        broker_url=DEAD_BROKER,
        auth="keys",
        event_poll_s=0.02,
        keep_alive_s=0.2,
        max_streams_per_owner=LIMIT,
    )
    with running_service(settings) as running:
        yield running


@pytest.fixture
def client(limited: RunningService) -> Iterator[httpx.Client]:
    """A client with a key of its owner."""
    with holder(limited, make_key(limited.database, "alpha").text) as opened:
        yield opened


def new_job(client: httpx.Client) -> str:
    """Post a job that nobody will work at."""
    job_id: str = client.post("/simulate", json=simulate_document()).raise_for_status().json()["id"]
    return job_id


def test_one_stream_too_many_is_reported(limited: RunningService, client: httpx.Client) -> None:
    """429 with a way out for this owner, by whichever key; nothing for others; room afterwards."""
    events = f"/jobs/{new_job(client)}/events"
    second = holder(limited, make_key(limited.database, "alpha").text)
    other = holder(limited, make_key(limited.database, "beta").text)
    with ExitStack() as stack, second as same_owner, other as stranger:
        for _ in range(LIMIT):
            assert stack.enter_context(client.stream("GET", events)).status_code == 200
        for refused in (client, same_owner):
            answer = refused.get(events)
            problem = fault(answer, 429)
            assert problem["code"] == "too_many_streams"
            assert str(LIMIT) in problem["detail"]
            assert int(answer.headers["retry-after"]) >= 1
        assert client.head(events).status_code == 429
        # the way out that the hint names
        page = client.get(events, headers={"Accept": "application/json"}).raise_for_status().json()
        assert page["events"][0]["type"] == "queued"
        theirs = f"/jobs/{new_job(stranger)}/events"
        with stranger.stream("GET", theirs) as stream:
            assert stream.status_code == 200
    until(lambda: open_stream(client, events) == 200)


def open_stream(client: httpx.Client, events: str) -> int:
    """Open a stream for a moment."""
    with client.stream("GET", events) as stream:
        return stream.status_code


def test_head_takes_no_place(client: httpx.Client) -> None:
    """However often the headers of a stream are requested, no stream is left open."""
    events = f"/jobs/{new_job(client)}/events"
    for _ in range(5 * LIMIT):
        answer = client.head(events)
        assert answer.status_code == 200
        assert answer.headers["content-type"].startswith("text/event-stream")
    with ExitStack() as stack:
        for _ in range(LIMIT):
            assert stack.enter_context(client.stream("GET", events)).status_code == 200


def test_one_wait_too_many_is_reported(limited: RunningService, client: httpx.Client) -> None:
    """A read that would wait is refused, one that does not is answered; a post is made, and does not wait."""
    job_id = new_job(client)
    waits = {"Prefer": f"wait={WAIT_S}"}
    with (
        httpx.Client(base_url=limited.url, headers=client.headers, timeout=30.0) as patient,
        ThreadPoolExecutor(LIMIT) as threads,
    ):
        begun = time.monotonic()
        waiting = [threads.submit(patient.get, f"/jobs/{job_id}", headers=waits) for _ in range(LIMIT)]
        until(lambda: IN_FLIGHT._value.get() >= LIMIT, WAIT_S / 2)  # the server is in this process
        problem = fault(client.get(f"/jobs/{job_id}", headers=waits), 429)
        assert problem["code"] == "too_many_streams"
        assert "Prefer" in problem["hint"]
        assert client.get(f"/jobs/{job_id}").status_code == 200
        posted = client.post("/simulate", json=simulate_document(), headers=waits)
        assert posted.status_code == 202
        assert "preference-applied" not in posted.headers
        assert time.monotonic() - begun < WAIT_S
        assert [answer.result().status_code for answer in waiting] == [200] * LIMIT
    assert client.get(f"/jobs/{job_id}", headers={"Prefer": "wait=1"}).status_code == 200


def test_no_storm_opens_more_than_the_limit(client: httpx.Client, limited: RunningService) -> None:
    """Of many that are opened at the same moment as many as the limit get through."""
    events = f"/jobs/{new_job(client)}/events"
    done, statuses = threading.Event(), []

    def follow() -> None:
        with (
            httpx.Client(base_url=limited.url, headers=client.headers, timeout=30.0) as mine,
            mine.stream("GET", events) as stream,
        ):
            statuses.append(stream.status_code)
            done.wait(30.0)

    threads = [threading.Thread(target=follow) for _ in range(4 * LIMIT)]
    for thread in threads:
        thread.start()
    until(lambda: len(statuses) == len(threads), seen=lambda: statuses)
    done.set()
    for thread in threads:
        thread.join(30.0)
    assert sorted(statuses) == [200] * LIMIT + [429] * (3 * LIMIT)
