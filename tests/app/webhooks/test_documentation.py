"""The statements of docs/webhooks.md for receivers are true."""

from __future__ import annotations

import re
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from standardwebhooks import Webhook

from app.database import Database
from app.webhooks.retries import DELAYS_S, MAX_RETRY_AFTER_S, MAX_TRIES
from app.webhooks.sender import SenderSettings, signed_headers
from app.webhooks.service import MAX_WEBHOOKS, new_secret
from tests.app.webhooks.hooks import challenged_hook, deliveries, hook_row, many_ends, send_due
from tests.app.webhooks.receiver import content, receiver

PAPER = Path(__file__).resolve().parents[3] / "docs" / "webhooks.md"
BODY = b'{"type":"job.succeeded"}'
WORDS_S = {"s": 1.0, "min": 60.0, "h": 3600.0}


@pytest.fixture(scope="module")
def text() -> str:
    """The paper, its lines joined."""
    return " ".join(PAPER.read_text(encoding="utf-8").split())


@pytest.fixture(scope="module")
def examples() -> dict[str, Any]:
    """The functions that the paper shows, by name."""
    names: dict[str, Any] = {}
    for example in re.findall(r"```python\n(.*?)```", PAPER.read_text(encoding="utf-8"), flags=re.DOTALL):
        exec(compile(example, PAPER.name, "exec"), names)  # noqa: S102 - our own text
    return names


def test_the_example_verifies_what_is_sent(examples: dict[str, Any]) -> None:
    """The example takes our headers and those of the standard's own library, and nothing else."""
    verified = examples["verified"]
    secret, now = new_secret(), time.time()
    ours = signed_headers(secret, "msg_1", now, BODY)
    theirs = Webhook(secret).sign("msg_1", datetime.now(UTC), BODY.decode())
    assert verified(secret, ours, BODY)
    assert verified(secret, {**ours, "webhook-signature": f"v2,x= {theirs}"}, BODY)
    assert not verified(secret, ours, BODY + b" ")
    assert not verified(new_secret(), ours, BODY)
    assert not verified(secret, {**ours, "webhook-id": "msg_2"}, BODY)
    assert not verified(secret, signed_headers(secret, "msg_1", now - 1000.0, BODY), BODY)


@pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)
def test_the_example_answers_the_challenge(database: Database, examples: dict[str, Any]) -> None:
    """A receiver that answers as the paper shows has its webhook enabled, and then gets the ends of jobs."""
    with receiver() as there:
        there.answers_challenges = False
        there.answer = lambda handler, _: content(handler, examples["answer"](there.received[-1].body))
        hook_id = challenged_hook(database, there.url())
        send_due(database)
        assert hook_row(database, hook_id).verified_at is not None
        many_ends(database, 1)
        send_due(database)
    assert [row.status for row in deliveries(database)] == ["delivered"] * 2


def test_the_figures_are_the_codes(text: str) -> None:
    """Delays, tries and limits in the paper are those of the code."""
    (listed,) = re.findall(r"tried again after (.*?) \(", text)
    delays = [float(number) * WORDS_S[unit] for number, unit in re.findall(r"(\d+) (s|min|h)\b", listed)]
    assert tuple(delays) == DELAYS_S
    assert MAX_TRIES == 6
    assert MAX_RETRY_AFTER_S == 600.0
    assert f"An owner may have {MAX_WEBHOOKS}." in text
    settings = SenderSettings()
    assert (settings.max_at_once, settings.max_per_owner) == (16, 4)
    assert settings.timeouts.total_s == 10.0
    for words in (
        "after the sixth try",
        "up to 10 min",
        "Six failed tries in a row",
        "Sixteen messages at once, four of one owner",
        "within ten seconds",
    ):
        assert words in text
