"""Laws of the times at which a delivery is tried again."""

from __future__ import annotations

from random import Random

import pytest

from app.webhooks.retries import (
    DELAYS_S,
    JITTER,
    MAX_RETRY_AFTER_S,
    MAX_TRIES,
    next_delay_s,
    parse_retry_after,
)

NOW = 784_111_777.0  # Sun, 06 Nov 1994 08:49:37 GMT, the example of RFC 9110


def test_delays_grow_and_end() -> None:
    """Each delay is its plan within the jitter; after the last try there is none."""
    rng = Random(1)
    for tries, planned in enumerate(DELAYS_S, start=1):
        delays = [next_delay_s(tries, None, rng) or 0.0 for _ in range(200)]
        assert planned * (1 - JITTER) <= min(delays) < planned < max(delays) <= planned * (1 + JITTER)
    assert next_delay_s(MAX_TRIES, None, rng) is None
    assert next_delay_s(MAX_TRIES, 10.0, rng) is None


def test_a_receiver_may_ask_for_patience_but_not_for_haste() -> None:
    """Retry-After makes the delay longer, up to a bound, and never shorter."""
    rng = Random(1)
    assert next_delay_s(1, 100.0, rng) == 100.0
    assert next_delay_s(1, 1e12, rng) == MAX_RETRY_AFTER_S
    assert (next_delay_s(5, 0.0, rng) or 0.0) >= DELAYS_S[4] * (1 - JITTER)


@pytest.mark.parametrize(
    ("value", "seconds"),
    [
        (None, None),
        ("120", 120.0),
        (" 0 ", 0.0),
        ("-5", None),
        ("1.5", None),
        ("soon", None),
        ("", None),
        ("9" * 400, 999999999.0),
        ("Sun, 06 Nov 1994 08:50:37 GMT", 60.0),
        ("Sun, 06 Nov 1994 08:00:00 GMT", 0.0),
        ("Sun, 06 Nov 99999 08:00:00 GMT", None),
        ("Sun, 06 Nov 1994 08:50:37 -0000", 60.0),
    ],
)
def test_retry_after_is_seconds_or_a_date(value: str | None, seconds: float | None) -> None:
    """Both forms of the header are read; anything else is ignored."""
    assert parse_retry_after(value, NOW) == seconds
