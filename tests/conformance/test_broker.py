"""What the service requires of a broker, on each kind."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from kombu import Connection

from app.jobs.queue import QUEUE, RUN_JOB, publish
from tests.conformance.conftest import OwnBroker

RECEIVE_S = 5.0
GIVE_UP_S = 4.0  # connecting fails after half a second, a socket that hangs after two


@contextmanager
def queue_of(url: str) -> Iterator[Any]:
    """Take part as a consumer of wake-up messages."""
    with Connection(url) as connection:
        queue = connection.SimpleQueue(QUEUE)
        yield queue
        queue.close()


def received(url: str, number: int) -> list[str]:
    """Take so many messages and acknowledge them; give the job ids they name."""
    ids = []
    with queue_of(url) as queue:
        for _ in range(number):
            message = queue.get(timeout=RECEIVE_S)
            assert message.headers["task"] == RUN_JOB
            ids.append(message.payload[0][0])
            message.ack()
    return ids


def test_a_hint_is_delivered(broker_url: str) -> None:
    """What is published is received, first come first served, though nobody listened at the time."""
    for number in range(20):
        assert publish(f"job_{number}", broker_url)
    assert received(broker_url, 20) == [f"job_{number}" for number in range(20)]
    with queue_of(broker_url) as queue, pytest.raises(queue.Empty):
        queue.get(block=False)  # a taken hint is gone


def test_two_consumers_share_the_hints(broker_url: str) -> None:
    """Each hint goes to one consumer."""
    for number in range(10):
        assert publish(f"job_{number}", broker_url)
    with queue_of(broker_url) as one, queue_of(broker_url) as other:
        taken = []
        for queue in (one, other) * 5:
            message = queue.get(timeout=RECEIVE_S)
            taken.append(message.payload[0][0])
            message.ack()
    assert sorted(taken) == sorted(f"job_{number}" for number in range(10))


def test_publishing_survives_a_restart(own_broker: OwnBroker) -> None:
    """The first message after a broker's restart arrives: the sender opens a new connection by itself."""
    assert publish("before", own_broker.url)
    own_broker.restart()
    assert publish("after", own_broker.url)
    with queue_of(own_broker.url) as queue:
        left = [queue.get(timeout=RECEIVE_S).payload[0][0] for _ in range(queue.qsize())]
    assert "after" in left


def test_a_broker_that_is_away_costs_little() -> None:
    """Publishing to nobody says so, soon: the reaper repeats the hint."""
    began = time.monotonic()
    assert not publish("job", "redis://127.0.0.1:1/0")
    assert time.monotonic() - began < GIVE_UP_S
