"""When a failed delivery is tried again, and how long its destination pauses.

Both use the same table of delays, a delivery by its own tries and a destination by its consecutive failures.
Nothing is sent to a pausing destination, so a dead one sees at most `MAX_TRIES` tries, however many jobs end,
and is given up after 18 minutes.
"""

from __future__ import annotations

from datetime import UTC
from email.utils import parsedate_to_datetime
from random import Random

DELAYS_S = (5.0, 30.0, 120.0, 300.0, 600.0)  # after the first try, the second, ...
MAX_TRIES = len(DELAYS_S) + 1  # of a delivery; as many consecutive failures disable a webhook
JITTER = 0.2  # random share of the delay, so that a recovering receiver is not hit by all at once
MAX_RETRY_AFTER_S = 600.0  # upper limit for a delay requested by a receiver


def next_delay_s(tries: int, retry_after_s: float | None, rng: Random) -> float | None:
    """Time to the next try, s, after `tries` tries (at least one); None when there is none.

    The receiver's request (`retry_after_s`) can only increase the delay.
    """
    if tries >= MAX_TRIES:
        return None
    planned = DELAYS_S[tries - 1] * (1.0 + JITTER * (2.0 * rng.random() - 1.0))
    return max(planned, min(retry_after_s or 0.0, MAX_RETRY_AFTER_S))


def parse_retry_after(value: str | None, now: float) -> float | None:
    """Seconds that a Retry-After header requests, as a number or as a date (RFC 9110); None if unreadable."""
    if value is None:
        return None
    text = value.strip()
    if text.isascii() and text.isdigit():
        return float(text[:9])
    try:
        moment = parsedate_to_datetime(text)
    except ValueError:
        return None
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=UTC)
    return max(0.0, moment.timestamp() - now)
