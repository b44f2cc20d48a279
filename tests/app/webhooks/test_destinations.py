"""Laws of destinations, on both databases: one try at a time, pauses after failures, and a quick end."""

from __future__ import annotations

import asyncio
import json
import socket
import threading
import time
from collections import Counter
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler

import pytest

from app.database import Database
from app.webhooks import deliveries as sql
from app.webhooks.addresses import destination_of
from app.webhooks.deliveries import LEASE_S
from app.webhooks.outbox import new_delivery, note_challenge
from app.webhooks.repository import reopen_webhook
from app.webhooks.retries import DELAYS_S, JITTER, MAX_TRIES
from tests.app.webhooks.hooks import (
    OWNER,
    HandClock,
    challenged_hook,
    deliveries,
    ended_job,
    hook_row,
    many_ends,
    new_hook,
    send_due,
    sender,
)
from tests.app.webhooks.receiver import Receiver, answer_json, content, receiver, status
from tests.waiting import until

on_sqlite = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)
STEP_S = 5.0  # of the clock, between two looks of the sender
SOON_S = 1800.0  # within which a dead host must be left alone for good
MAX_CONNECTIONS = 50


@pytest.fixture
def there() -> Iterator[Receiver]:
    """A receiver on loopback."""
    with receiver() as running:
        yield running


@pytest.fixture
def dead_port() -> Iterator[int]:
    """A port of this machine that refuses: taken, and never listened at."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        yield taken.getsockname()[1]


@pytest.fixture
def dialled(monkeypatch: pytest.MonkeyPatch) -> Counter[int]:
    """How often the event loops of this process began to connect, by port."""
    counted: Counter[int] = Counter()
    connect = asyncio.SelectorEventLoop.sock_connect

    async def count(loop: asyncio.SelectorEventLoop, link: socket.socket, address: tuple[str, int]) -> None:
        counted[address[1]] += 1
        await connect(loop, link, address)

    monkeypatch.setattr(asyncio.SelectorEventLoop, "sock_connect", count)
    return counted


def by_path(answers: dict[str, int]) -> object:
    """Answer by the path's status."""

    def answer(handler: BaseHTTPRequestHandler, _number: int) -> None:
        status(handler, answers[handler.path])

    return answer


@pytest.mark.parametrize(("hooks", "ends"), [pytest.param(1, 4000, marks=pytest.mark.slow), (5, 100)])
def test_a_dead_host_sees_a_handful_of_connections(
    database: Database, dead_port: int, dialled: Counter[int], hooks: int, ends: int
) -> None:
    """4,000 ends of jobs to a port that refuses: at most 50 connections, and disabled within half an hour."""
    clock = HandClock()
    made = [new_hook(database, f"http://127.0.0.1:{dead_port}/{number}") for number in range(hooks)]
    many_ends(database, ends // 2)
    clock.turn(60.0)
    began = clock.now
    send_due(database, clock=clock)
    many_ends(database, ends - ends // 2)

    def disabled() -> list[float]:
        return [at for hook in made if (at := hook_row(database, hook).disabled_at) is not None]

    while len(disabled()) < hooks and clock.now < began + SOON_S:
        send_due(database, clock=clock)
        clock.turn(STEP_S)
    assert len(disabled()) == hooks
    assert max(disabled()) - began < SOON_S
    print(f"{dialled[dead_port]} connections, disabled after {(max(disabled()) - began) / 60:.1f} min")
    assert MAX_TRIES <= dialled[dead_port] <= MAX_CONNECTIONS
    assert {row.status for row in deliveries(database)} == {"given_up"}
    many_ends(database, 10)
    clock.turn(1e6)
    assert send_due(database, clock=clock) == 0


def test_one_try_at_a_time(database: Database, there: Receiver) -> None:
    """Two webhooks of one owner at one host, many deliveries and two senders: never two tries at once."""
    under_way, maximum = 0, 0
    lock = threading.Lock()

    def answer(handler: BaseHTTPRequestHandler, _number: int) -> None:
        nonlocal under_way, maximum
        with lock:
            under_way += 1
            maximum = max(maximum, under_way)
        time.sleep(0.01)
        with lock:
            under_way -= 1
        status(handler, 204)

    there.answer = answer
    for path in ("/a", "/b"):
        new_hook(database, there.url(path))
    many_ends(database, 15)
    both = [sender(database) for _ in range(2)]
    for one in both:
        one.start()
    there.wait_for(30, within_s=60.0)
    until(lambda: not deliveries(database, status="waiting"), 30.0)
    for one in both:
        one.stop()
    assert maximum == 1
    assert len(there.received) == 30


def test_a_claim_takes_the_destination(database: Database, there: Receiver) -> None:
    """While one delivery is claimed, no other of its destination is due; a lost sender frees it in time."""
    clock = HandClock()
    for path in ("/a", "/b"):
        new_hook(database, there.url(path))
    many_ends(database, 2)
    clock.turn(60.0)
    with database.read() as session:
        seen = sql.due(session, 10, 4, {}, clock)
    assert len(seen) == 1
    with database.write() as session:
        (lost,) = sql.claim(session, seen, LEASE_S, clock)
    new_hook(database, there.url("/c"))  # a new webhook finds the destination as it is
    ended_job(database)
    assert send_due(database, clock=clock) == 0
    clock.turn(LEASE_S + 1.0)
    assert send_due(database, clock=clock) == 7
    assert {row.id for row in deliveries(database, status="delivered")} >= {lost.id}


def test_a_failure_pauses_all_that_goes_there(database: Database, there: Receiver) -> None:
    """The pause is the destination's, and grows with the failures in a row; a success ends it."""
    answers = {"/a": 500, "/b": 500}
    there.answer = by_path(answers)  # type: ignore[assignment]
    clock = HandClock()
    for path in answers:
        new_hook(database, there.url(path))
    many_ends(database, 5)
    clock.turn(60.0)
    assert send_due(database, clock=clock) == 1
    clock.turn(DELAYS_S[0] * (1 - JITTER) - 0.1)
    assert send_due(database, clock=clock) == 0
    clock.turn(DELAYS_S[0] * 2 * JITTER + 0.2)
    answers["/a"] = answers["/b"] = 204
    assert send_due(database, clock=clock) == 10


def test_another_owner_is_not_silenced(database: Database, there: Receiver) -> None:
    """Who fails at a host does not hold up another owner's deliveries to it, nor are they counted."""
    there.answer = by_path({"/mine": 500, "/theirs": 204})  # type: ignore[assignment]
    clock = HandClock()
    mine = new_hook(database, there.url("/mine"), owner="mine")
    theirs = new_hook(database, there.url("/theirs"), owner="theirs")
    for owner in ("mine", "theirs"):
        many_ends(database, 4, owner=owner)
    clock.turn(60.0)
    assert send_due(database, clock=clock) == 5
    assert (hook_row(database, mine).failures, hook_row(database, theirs).failures) == (1, 0)
    assert {row.status for row in deliveries(database, webhook_id=theirs)} == {"delivered"}


def test_an_answer_is_one_webhooks_own(database: Database, there: Receiver) -> None:
    """Of two webhooks at one host the one that always answers 500 is disabled, its neighbour gets all."""
    there.answer = by_path({"/bad": 500, "/good": 204})  # type: ignore[assignment]
    clock = HandClock()
    bad, good = (new_hook(database, there.url(path)) for path in ("/bad", "/good"))
    clock.turn(60.0)
    began = clock.now
    while hook_row(database, bad).disabled_at is None and clock.now < began + SOON_S:
        many_ends(database, 1)
        send_due(database, clock=clock)
        clock.turn(60.0)
    assert hook_row(database, bad).disabled_at is not None
    send_due(database, clock=clock)
    row = hook_row(database, good)
    assert (row.failures, row.disabled_at) == (0, None)
    assert {row.status for row in deliveries(database, webhook_id=good)} == {"delivered"}


@on_sqlite
def test_a_quiet_webhook_is_not_blamed(database: Database, dead_port: int) -> None:
    """A host that does not answer is counted for whom something waits, and for nobody else."""
    url = f"http://127.0.0.1:{dead_port}/"
    tried, waiting = new_hook(database, url), new_hook(database, url)
    quiet = new_hook(database, url, events=["job.failed"])
    many_ends(database, 1)
    clock = HandClock()
    clock.turn(60.0)
    assert send_due(database, clock=clock) == 1
    assert [hook_row(database, hook).failures for hook in (tried, waiting, quiet)] == [1, 1, 0]


@on_sqlite
def test_a_success_ends_the_row_of_failures(database: Database, there: Receiver) -> None:
    """Failures count only while no try succeeds between them."""
    clock = HandClock()
    hook_id = new_hook(database, there.url("/a"))
    answers = {"/a": 500}
    there.answer = by_path(answers)  # type: ignore[assignment]
    for code in (*[500] * (MAX_TRIES - 1), 204, *[500] * (MAX_TRIES - 1)):
        answers["/a"] = code
        many_ends(database, 1)
        clock.turn(2 * DELAYS_S[-1])
        send_due(database, clock=clock, max_at_once=1)
    row = hook_row(database, hook_id)
    assert (row.failures, row.disabled_at) == (MAX_TRIES - 1, None)


@on_sqlite
def test_a_receiver_that_does_not_answer_the_challenge(database: Database, there: Receiver) -> None:
    """It is retried like any message, then the webhook is disabled; it can be reopened."""
    there.answers_challenges = False
    clock = HandClock()
    hook_id = challenged_hook(database, there.url())
    for planned in (60.0, *DELAYS_S):
        clock.turn(planned * (1 + JITTER) + 0.1)
        assert send_due(database, clock=clock) == 1
    row = hook_row(database, hook_id)
    assert (row.verified_at, row.disabled_at) == (None, pytest.approx(clock.now))
    assert "did not answer with the challenge" in row.disabled_reason
    assert len({item.body for item in there.received}) == 1
    there.answers_challenges = True
    with database.write() as session:
        shown = reopen_webhook(session, OWNER, hook_id)
    assert (shown.failures, shown.status, shown.disabled_at) == (0, "pending", None)


def test_reopening_waits_for_nothing(database: Database, there: Receiver) -> None:
    """A new challenge is sent at once, amid a pause after others' failures and after a try it crossed."""
    clock = HandClock()
    clock.turn(60.0)
    there.answers_challenges = False
    hook_id = challenged_hook(database, there.url("/new"))

    def reopen() -> None:
        with database.write() as session:
            reopen_webhook(session, OWNER, hook_id)
            note_challenge(session, hook_id)

    def crossed(handler: BaseHTTPRequestHandler, _number: int) -> None:
        reopen()
        there.answers_challenges = True
        status(handler, 500)

    there.answer = crossed
    assert send_due(database, clock=clock) == 2
    assert hook_row(database, hook_id).verified_at is not None
    there.answer = by_path({"/bad": 500, "/new": 204})  # type: ignore[assignment]
    new_hook(database, there.url("/bad"))
    many_ends(database, 1)
    assert send_due(database, clock=clock) == 2  # an end is written for the older webhook first
    with database.write() as session:
        sql.disable(session, hook_id, "a test")
    reopen()
    assert send_due(database, clock=clock) == 1
    assert len(there.challenges) == 2


@on_sqlite
def test_a_disabled_webhook_that_is_reopened_asks_before_it_sends(
    database: Database, there: Receiver
) -> None:
    """A delivery inserted concurrently with the disabling is not sent before the receiver has answered."""
    hook_id = new_hook(database, there.url())
    with database.write() as session:
        sql.disable(session, hook_id, "a test")
        reopen_webhook(session, OWNER, hook_id)
        session.execute(
            sql.webhook_deliveries.insert().values(
                new_delivery(hook_id, "job.failed", {"type": "job.failed"})
            )
        )
    send_due(database)
    assert there.connections == 0
    assert [row.status for row in deliveries(database)] == ["given_up"]


ECHOES: dict[str, bytes] = {
    "nothing": b"",
    "text": b"<challenge>",
    "a list": b'["<challenge>"]',
    "another word": b'{"challenge": "x"}',
    "no word": b'{"challenge": true}',
    "a nest": b"[" * 60_000,
    "broken JSON": b'{"challenge": "<challenge>"',
    "the message itself": b"<body>",
}


@on_sqlite
@pytest.mark.parametrize("said", ECHOES.values(), ids=ECHOES)
def test_only_the_documented_answer_counts(database: Database, there: Receiver, said: bytes) -> None:
    """An echo server, a page that answers 200 to anything, and half an answer are no consent."""

    def answer(handler: BaseHTTPRequestHandler, _number: int) -> None:
        body = there.received[-1].body
        challenge = json.loads(body)["data"]["challenge"].encode()
        content(handler, said.replace(b"<challenge>", challenge).replace(b"<body>", body))

    there.answers_challenges, there.answer = False, answer
    hook_id = challenged_hook(database, there.url())
    assert send_due(database) == 1
    assert hook_row(database, hook_id).verified_at is None
    there.answer = lambda handler, _: answer_json(
        handler, {"challenge": json.loads(there.received[-1].body)["data"]["challenge"], "more": 1}
    )
    clock = HandClock()
    clock.turn(60.0)
    assert send_due(database, clock=clock) == 1
    assert hook_row(database, hook_id).verified_at is not None


@pytest.mark.parametrize(
    ("url", "destination"),
    [
        ("https://Example.com/a?b=c", "https://example.com:443"),
        ("https://example.com.:443/", "https://example.com:443"),
        ("https://example.com:8443", "https://example.com:8443"),
        ("http://127.0.0.1:9000/x", "http://127.0.0.1:9000"),
        ("https://[2606:4700::1]/", "https://2606:4700::1:443"),
    ],
)
def test_a_destination_is_scheme_host_and_port(url: str, destination: str) -> None:
    """Spellings of one place are one destination."""
    assert destination_of(url) == destination
