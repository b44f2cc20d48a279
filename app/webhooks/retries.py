"""When a delivery that failed is tried again, and how long its destination is left alone.

Both wait by the same table, a delivery by its own tries and a destination by the failures in a row. Nothing
is sent to a destination while it waits, so a dead one sees no more than `MAX_TRIES` tries, however many jobs
end, and is given up after 18 minutes.
"""

from __future__ import annotations

from datetime import UTC
from email.utils import parsedate_to_datetime
from random import Random

DELAYS_S = (5.0, 30.0, 120.0, 300.0, 600.0)  # after the first try, the second, ...
MAX_TRIES = len(DELAYS_S) + 1  # of a delivery; so many failures in a row disable a webhook
JITTER = 0.2  # of the delay either way: a receiver that comes back is not met by all at once
MAX_RETRY_AFTER_S = 600.0  # a receiver may ask for patience, but not for ever


def next_delay_s(tries: int, retry_after_s: float | None, rng: Random) -> float | None:
    """Time to the next try, s, after `tries` tries (at least one); None when there is none.

    What the receiver requested (`retry_after_s`) can only make the time longer.
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
