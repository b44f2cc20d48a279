"""Laws of the sender, on both databases, against a real receiver."""

from __future__ import annotations

import asyncio
import threading
import time
from collections import Counter
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler

import pytest

from app.database import Database
from app.webhooks import deliveries as sql
from app.webhooks.deliveries import LEASE_S, MAX_CLAIMS
from app.webhooks.repository import delete_webhook
from app.webhooks.retries import DELAYS_S, JITTER, MAX_TRIES
from tests.app.webhooks.hooks import (
    OWNER,
    HandClock,
    deliveries,
    ended_job,
    hook_row,
    new_hook,
    send_due,
    sender,
)
from tests.app.webhooks.receiver import Receiver, receiver, status
from tests.waiting import until

# what the database has no part in is proved on one of them
on_sqlite = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)
UNREACHABLE = "http://127.0.0.1:1024/"


@pytest.fixture
def there() -> Iterator[Receiver]:
    """A receiver on loopback."""
    with receiver() as running:
        yield running


def answer_with(code: int, **headers: str) -> object:
    """An answer of one status to every request."""

    def answer(handler: BaseHTTPRequestHandler, _number: int) -> None:
        status(handler, code, **headers)

    return answer


def test_a_delivery_is_sent_once(database: Database, there: Receiver) -> None:
    """What the receiver took is delivered, and not sent again."""
    hook_id = new_hook(database, there.url())
    ended_job(database)
    assert send_due(database) == 1
    assert send_due(database) == 0
    (row,) = deliveries(database)
    assert (row.status, row.response_status, row.error, row.next_at) == ("delivered", 204, None, None)
    assert [item.headers["webhook-id"] for item in there.received] == [row.id]
    assert hook_row(database, hook_id).failures == 0


def test_failures_are_tried_again_on_schedule(database: Database, there: Receiver) -> None:
    """Each failure waits for its delay, keeps the id and the body; the last gives up and disables."""
    there.answer = answer_with(500)  # type: ignore[assignment]
    clock = HandClock()
    hook_id = new_hook(database, there.url())
    ended_job(database)
    clock.turn(60.0)
    for planned in DELAYS_S:
        assert send_due(database, clock=clock) == 1
        assert [row.status for row in deliveries(database)] == ["waiting"]
        clock.turn(planned * (1 - JITTER) - 0.01)
        assert send_due(database, clock=clock) == 0
        clock.turn(planned * 2 * JITTER + 0.02)
    assert send_due(database, clock=clock) == 1
    (row,) = deliveries(database)
    assert (row.status, row.attempt, row.response_status) == ("given_up", MAX_TRIES, 500)
    assert row.finished_at == pytest.approx(clock.now)
    assert len({(item.headers["webhook-id"], item.body) for item in there.received}) == 1
    times = [int(item.headers["webhook-timestamp"]) for item in there.received]
    assert times == sorted(set(times))  # each try is signed for its own time
    hook = hook_row(database, hook_id)
    assert (hook.failures, hook.disabled_at) == (MAX_TRIES, pytest.approx(clock.now))
    assert f"{MAX_TRIES} tries in a row failed" in hook.disabled_reason
    clock.turn(1e6)
    assert send_due(database, clock=clock) == 0


@on_sqlite
def test_retry_after_is_honoured(database: Database, there: Receiver) -> None:
    """A receiver that requests two minutes gets them."""
    there.answer = answer_with(429, Retry_After="120")  # type: ignore[assignment]
    clock = HandClock()
    new_hook(database, there.url())
    ended_job(database)
    clock.turn(60.0)
    assert send_due(database, clock=clock) == 1
    clock.turn(119.0)
    assert send_due(database, clock=clock) == 0
    clock.turn(1.1)
    assert send_due(database, clock=clock) == 1


def test_gone_disables_at_once(database: Database, there: Receiver) -> None:
    """After 410 nothing is sent any more, what waits is given up, and new ends are not noted."""
    there.answer = answer_with(410)  # type: ignore[assignment]
    hook_id = new_hook(database, there.url())
    for _ in range(3):
        ended_job(database)
    send_due(database, max_at_once=1)
    ended_job(database)
    assert [row.status for row in deliveries(database)] == ["given_up"] * 3
    assert len(there.received) == 1
    row = hook_row(database, hook_id)
    assert row.disabled_at is not None
    assert "410" in row.disabled_reason


def test_two_senders_share_one_table(database: Database, there: Receiver) -> None:
    """Of many deliveries and two senders with threads of their own each is sent, and none twice."""
    count = 60
    hooks = [new_hook(database, there.url(f"/{number}"), owner=f"owner{number % 3}") for number in range(6)]
    for number in range(count // 2):
        ended_job(database, owner=f"owner{number % 3}")
    both = [sender(database, max_at_once=8) for _ in range(2)]
    for one in both:
        one.start()
    there.wait_for(count, within_s=60.0)
    until(lambda: not deliveries(database, status="waiting"), 30.0)
    for one in both:
        one.stop()
    rows = deliveries(database)
    assert len(rows) == count
    assert {row.status for row in rows} == {"delivered"}
    assert Counter(item.headers["webhook-id"] for item in there.received) == Counter(row.id for row in rows)
    assert {row.webhook_id for row in rows} == set(hooks)


def test_a_claim_is_one_senders(database: Database) -> None:
    """Of two senders that saw a delivery one gets it; when its lease ends it is sent again, id unchanged."""
    clock = HandClock()
    new_hook(database, UNREACHABLE)
    ended_job(database)
    clock.turn(60.0)
    with database.read() as session:
        seen = sql.due(session, 10, 4, {}, clock)
    with database.write() as session:
        (crashed,) = sql.claim(session, seen, LEASE_S, clock)
    with database.write() as session:
        assert sql.claim(session, seen, LEASE_S, clock) == []
    clock.turn(LEASE_S - 1.0)
    with database.read() as session:
        assert sql.due(session, 10, 4, {}, clock) == []
    clock.turn(2.0)
    with database.read() as session:
        again = sql.due(session, 10, 4, {}, clock)
    with database.write() as session:
        (second,) = sql.claim(session, again, LEASE_S, clock)
    assert (second.id, second.tries, second.fence) == (crashed.id, 2, 2)


def test_late_news_change_nothing(database: Database) -> None:
    """What a sender writes after its claim went to another is ignored."""
    clock = HandClock()
    new_hook(database, UNREACHABLE)
    ended_job(database)
    clock.turn(60.0)
    claims = []
    for _ in range(2):
        with database.write() as session:
            claims += sql.claim(session, sql.due(session, 10, 4, {}, clock), LEASE_S, clock)
        clock.turn(LEASE_S + 1.0)
    late, current = claims
    settings = sender(database)._settings
    with database.write() as session:
        options = {"rng": settings.rng, "clock": clock}
        assert sql.settle(session, late, sql.Answer(410, "Gone."), **options) is None
        assert sql.settle(session, current, sql.Answer(204), **options) == "delivered"


@on_sqlite
def test_a_delivery_that_kills_its_senders_ends(database: Database) -> None:
    """Claims that never come to an end are not made for ever."""
    clock = HandClock()
    new_hook(database, UNREACHABLE)
    ended_job(database)
    claims = 0
    for _ in range(MAX_CLAIMS + 3):
        clock.turn(LEASE_S + 1.0)
        with database.write() as session:
            claims += len(sql.claim(session, sql.due(session, 10, 4, {}, clock), LEASE_S, clock))
    assert claims == MAX_CLAIMS
    assert [row.status for row in deliveries(database)] == ["given_up"]


def test_a_slow_receiver_does_not_hold_up_other_owners(database: Database, there: Receiver) -> None:
    """Many deliveries to a receiver that never answers leave room for another owner's."""
    hold = threading.Event()

    def hang(handler: BaseHTTPRequestHandler, _number: int) -> None:
        hold.wait(20.0)
        status(handler, 204)

    with receiver() as stuck:
        stuck.answer = hang
        new_hook(database, stuck.url(), owner="slow")
        new_hook(database, there.url(), owner="quick")
        for _ in range(20):
            ended_job(database, owner="slow")
        ended_job(database, owner="quick")
        running = sender(database, max_at_once=6, max_per_owner=3)
        running.start()
        stuck.wait_for(1)
        there.wait_for(1)
        assert len(stuck.received) == 1
        hold.set()
        running.stop()


@on_sqlite
def test_stopping_is_quick_and_gives_back(database: Database) -> None:
    """A sender in the midst of a slow try stops within seconds; the delivery is due at once, under its id."""
    hold = threading.Event()

    def hang(handler: BaseHTTPRequestHandler, _number: int) -> None:
        hold.wait(20.0)
        status(handler, 204)

    with receiver() as slow:
        slow.answer = hang
        new_hook(database, slow.url())
        ended_job(database)
        running = sender(database)
        running.start()
        slow.wait_for(1)
        start = time.monotonic()
        running.stop(patience_s=30.0)
        assert time.monotonic() - start < 10.0  # 1 s is what it gives itself; the try would last 20 s
        hold.set()
        (row,) = deliveries(database)
        assert (row.status, row.attempt) == ("waiting", 0)
        assert send_due(database) == 1
        assert len({item.headers["webhook-id"] for item in slow.received}) == 1


def test_a_deleted_webhook_is_not_missed(database: Database, there: Receiver) -> None:
    """Deleting a webhook while a try is under way takes its deliveries along, and nothing breaks."""
    hook_id = new_hook(database, there.url())
    ended_job(database)

    def delete_first(handler: BaseHTTPRequestHandler, _number: int) -> None:
        with database.write() as session:
            delete_webhook(session, OWNER, hook_id)
        status(handler, 204)

    there.answer = delete_first
    assert send_due(database) == 1
    assert deliveries(database) == []


def test_jobs_end_while_their_webhooks_are_deleted(database: Database) -> None:
    """Ends of jobs and deletions of webhooks at the same time: neither fails for the other."""
    hooks = [new_hook(database, UNREACHABLE) for _ in range(15)]

    def delete_all() -> None:
        for hook_id in hooks:
            with database.write() as session:
                delete_webhook(session, OWNER, hook_id)

    thread = threading.Thread(target=delete_all)
    thread.start()
    for _ in range(15):
        ended_job(database)
    thread.join(60.0)
    assert deliveries(database) == []


@on_sqlite
def test_nothing_is_sent_to_an_address_that_turned_inside(database: Database) -> None:
    """A webhook whose name was public when it was made and is loopback now: a failed try, no connection."""
    with receiver() as inside:
        new_hook(database, f"https://rebinding.example:{inside.port}/")
        ended_job(database)
        policy = type(sender(database)._settings.policy)(resolve=lambda _host, _port: ["127.0.0.1"])
        assert send_due(database, policy=policy) == 1
        (row,) = deliveries(database)
        assert row.status == "waiting"
        assert row.error.startswith("Refused:")
        assert inside.connections == 0


@on_sqlite
def test_a_database_that_is_away_does_not_end_the_sender(database: Database, there: Receiver) -> None:
    """The sender goes on looking after its database failed it."""
    new_hook(database, there.url())
    running = sender(database)
    failures = iter([True, True])
    take = running._take

    def failing(room: int, under_way: Counter[str]) -> list[sql.Dispatch]:
        if next(failures, False):
            from sqlalchemy.exc import OperationalError

            raise OperationalError("SELECT 1", {}, Exception("away"))
        return take(room, under_way)

    running._take = failing  # type: ignore[method-assign]
    running.start()
    ended_job(database)
    there.wait_for(1)
    running.stop()


@on_sqlite
def test_running_and_stopping_without_work(database: Database) -> None:
    """A sender that never had anything to do stops at once, also before it began."""

    async def nothing() -> None:
        idle = sender(database)
        idle.stop()
        await idle.run()

    asyncio.run(nothing())
