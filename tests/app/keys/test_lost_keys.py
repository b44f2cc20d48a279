"""Whatever a request waits for, it ends within seconds of its key, on both databases."""

from __future__ import annotations

import json
import socket
import threading
import time
from collections.abc import Callable, Iterator
from urllib.parse import urlsplit

import httpx
import pytest
from sqlalchemy import update

from app.database import database_time
from app.keys.service import NewKey, revoke_key
from app.observability.request_metrics import IN_FLIGHT
from app.tables import api_keys
from tests.app.key_holders import bearer, holder, make_key
from tests.app.request_documents import simulate_document
from tests.app.running_service import RunningService
from tests.waiting import until

ENDS_WITHIN_S = 3.0
BEGUN_S = 0.5  # from the beginning of a request until it waits
WAIT = {"Prefer": "wait=30"}

Ended = tuple[float, int | None]  # when, and the status; None: a stream that ended well


def waiting_get(service: RunningService, made: NewKey, job: str) -> Ended:
    """Wait for the end of a job."""
    with holder(service, made.text) as client:
        answer = client.get(f"/jobs/{job}", headers=WAIT)
    return time.monotonic(), answer.status_code


def waiting_post(service: RunningService, made: NewKey, _job: str) -> Ended:
    """Post a job and wait for its end."""
    with holder(service, made.text) as client:
        answer = client.post("/simulate", json=simulate_document(), headers=WAIT)
    return time.monotonic(), answer.status_code


def idle_stream(service: RunningService, made: NewKey, job: str) -> Ended:
    """Follow a job without news."""
    with holder(service, made.text) as client, client.stream("GET", f"/jobs/{job}/events") as stream:
        assert stream.status_code == 200
        reported = "".join(stream.iter_text())
    assert "event: queued" in reported
    return time.monotonic(), None


def slow_body(service: RunningService, made: NewKey, _job: str) -> Ended:
    """Send the headers of a post, and then nothing."""
    at = urlsplit(service.url)
    head = "".join(f"{name}: {value}\r\n" for name, value in bearer(made.text).items())
    head += "Content-Type: application/json\r\nContent-Length: 100\r\n\r\n{"
    with socket.create_connection((at.hostname, at.port), timeout=30.0) as link:
        link.sendall(f"POST /simulate HTTP/1.1\r\nHost: {at.hostname}\r\n{head}".encode())
        answer = b"".join(iter(lambda: link.recv(65_536), b""))
        now = time.monotonic()
    assert json.loads(answer.partition(b"\r\n\r\n")[2])["code"] == "unauthorized"
    return now, int(answer.split()[1])


REQUESTS: dict[str, tuple[Callable[[RunningService, NewKey, str], Ended], int | None]] = {
    "GET with Prefer: wait": (waiting_get, 401),
    "POST with Prefer: wait": (waiting_post, 401),
    "an idle event stream": (idle_stream, None),
    "a body that does not come": (slow_body, 401),
}


def revoke(service: RunningService, made: NewKey) -> None:
    """Revoke it as the operator does."""
    with service.database.write() as session:
        revoke_key(session, made.key.id)


def expire(service: RunningService, made: NewKey) -> None:
    """Let its time be over."""
    with service.database.write() as session:
        chosen = update(api_keys).where(api_keys.c.id == made.key.id)
        session.execute(chosen.values(expires_at=database_time()))


@pytest.fixture(scope="module")
def job(keyed_service: RunningService) -> Iterator[str]:
    """A job that nobody works at."""
    with holder(keyed_service, make_key(keyed_service.database).text) as client:
        yield client.post("/simulate", json=simulate_document()).raise_for_status().json()["id"]


@pytest.mark.parametrize("end", [revoke, expire])
def test_whoever_waits_is_ended_with_the_key(
    keyed_service: RunningService, job: str, end: Callable[[RunningService, NewKey], None]
) -> None:
    """All kinds at once: a waiting request gets 401, a stream ends; none outlives its key by 3 s."""
    made = make_key(keyed_service.database)
    ends: dict[str, Ended] = {}

    def ask(name: str) -> None:
        ends[name] = REQUESTS[name][0](keyed_service, made, job)

    threads = [threading.Thread(target=ask, args=(name,)) for name in REQUESTS]
    before = IN_FLIGHT._value.get()  # the server is in this process
    for thread in threads:
        thread.start()
    until(lambda: IN_FLIGHT._value.get() >= before + len(REQUESTS))
    time.sleep(BEGUN_S)
    assert not ends
    end(keyed_service, made)
    lost_at = time.monotonic()
    for thread in threads:
        thread.join(40.0)
    for name, (_, status) in REQUESTS.items():
        assert ends[name][1] == status, name
        print(f"{name}: {ends[name][0] - lost_at:.2f} s after its key")
        assert ends[name][0] - lost_at < ENDS_WITHIN_S, name


def test_other_keys_of_the_owner_go_on(keyed_service: RunningService, job: str) -> None:
    """A wait with another key of the same owner lasts for the full requested time."""
    lost, kept = make_key(keyed_service.database), make_key(keyed_service.database)
    answers: list[httpx.Response] = []

    def ask() -> None:
        with holder(keyed_service, kept.text) as client:
            answers.append(client.get(f"/jobs/{job}", headers={"Prefer": "wait=3"}))

    thread = threading.Thread(target=ask)
    start = time.monotonic()
    thread.start()
    revoke(keyed_service, lost)
    thread.join(30.0)
    assert answers[0].status_code == 200
    assert time.monotonic() - start > 2.9
