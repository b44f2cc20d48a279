"""Wake-up messages are read strictly, and what Celery sees is written by us."""

from __future__ import annotations

import json
import random
from datetime import UTC, datetime
from typing import Any

import pytest
from celery import Celery

from app.jobs.queue import QUEUE, RUN_JOB
from tests.faults.malformed import HARMFUL, MALFORMED, envelope
from worker.hints import LONGEST_BYTES, REAP, Hint, read_hint
from worker.transport import Dropped


def sent_by_celery(task: str, *arguments: str, **options: Any) -> bytes:
    """A message as Celery's client puts it into the broker."""
    app = Celery("client", set_as_current=False, broker="memory://")
    with app.connection_for_write() as connection:
        channel = connection.default_channel
        kept: list[dict[str, Any]] = []
        channel._put = lambda _queue, message, **_: kept.append(message)
        with app.amqp.Producer(channel, auto_declare=False) as producer:
            app.send_task(task, arguments, options, queue=QUEUE, producer=producer, expires=60.0)
    return json.dumps(kept[0]).encode()


@pytest.mark.parametrize("name", MALFORMED)
def test_a_malformed_message_is_refused(name: str) -> None:
    """Nothing of it gets through, and nothing but a ValueError comes of it."""
    with pytest.raises(ValueError):  # noqa: PT011 - whose words differ: JSON's, base64's, pydantic's
        read_hint(MALFORMED[name])


def test_a_spoilt_message_is_read_or_refused() -> None:
    """Bytes changed, taken out and doubled at random: a hint or a ValueError comes of it, nothing else."""
    rng = random.Random(11)
    good = Hint(RUN_JOB, ["job_1"]).packed()
    refused = 0
    for _ in range(3000):
        spoilt = bytearray(good)
        for _ in range(rng.randint(1, 4)):
            place = rng.randrange(len(spoilt))
            piece = rng.choice([b"", bytes([rng.randrange(256)]), spoilt[place : place + 40] * 2])
            spoilt[place : place + rng.randint(0, 3)] = piece
        try:
            read_hint(bytes(spoilt))
        except ValueError:
            refused += 1
    assert refused > 1000


@pytest.mark.parametrize("name", HARMFUL)
def test_what_would_harm_celery_is_left_out(name: str) -> None:
    """A message with more than a hint in it is taken for the hint."""
    hint = read_hint(HARMFUL[name])
    assert hint is not None
    assert (hint.task, hint.arguments) == (RUN_JOB, ["job"])
    again = json.loads(hint.packed())
    assert again["headers"]["timelimit"] == [None, None]
    assert again["headers"]["eta"] is None
    assert json.loads(hint.body()) == [["job"], {}, {}]
    assert isinstance(again["properties"]["delivery_tag"], str)


def test_what_celery_sends_is_read() -> None:
    """Messages of the API, the workers and the beat are well-formed, and ours read the same."""
    read = read_hint(sent_by_celery(RUN_JOB, "job_1"))
    assert read is not None
    assert (read.task, read.arguments, read.options) == (RUN_JOB, ["job_1"], {})
    read = read_hint(sent_by_celery(REAP, republish_after_s=0.0))
    assert read is not None
    assert (read.task, read.arguments, read.options) == (REAP, [], {"republish_after_s": 0.0})
    again = read_hint(read.packed())
    assert again is not None
    assert (again.task, again.options) == (read.task, read.options)
    assert again.id != read.id, "two deliveries of one message are two requests"


def test_an_expired_message_is_no_hint() -> None:
    """A message from before its expiry is a hint, one from after it is none, and neither is malformed."""
    at = datetime(2026, 1, 1, tzinfo=UTC)
    message = json.dumps(envelope(headers={"expires": at.isoformat()})).encode()
    assert read_hint(message, clock=lambda: at.timestamp() - 1.0) is not None
    assert read_hint(message, clock=lambda: at.timestamp() + 1.0) is None


def test_a_flood_is_one_line_of_the_log(caplog: pytest.LogCaptureFixture) -> None:
    """A thousand malformed messages are counted to the last; only the first is worth a line."""
    dropped = Dropped()
    for _ in range(1000):
        dropped.note("nonsense")
    assert dropped.number == 1000
    assert len(caplog.records) == 1


def test_hints_have_room() -> None:
    """A hint of ours is far from the limit."""
    assert 8 * len(Hint(RUN_JOB, ["job_" + "x" * 26]).packed()) < LONGEST_BYTES
