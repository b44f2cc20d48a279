"""A rate limit on invalid keys: an address that keeps sending them has to wait.

256 random bits cannot be found by trying; the limit keeps broken and hostile clients from loading the
database and filling the audit log. An address often stands for many people (an office, a proxy), so a key
that was valid from an address before is never delayed there.
"""

from __future__ import annotations

import ipaddress
import math
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

BURST = 10  # refusals that an address has initially
REFILL_S = 6.0  # s for each further one
NOTES_BURST = 200  # refusals that are recorded, from all addresses together
NOTES_REFILL_S = 1.0
REMEMBERED = 10_000  # addresses, and valid keys; the longest unused are forgotten first


Key = TypeVar("Key")
Value = TypeVar("Value")


def network_of(address: str) -> str:
    """The address itself, or the /64 inside which an IPv6 host may change its address."""
    try:
        parsed = ipaddress.ip_address(address)
    except ValueError:
        return address
    if isinstance(parsed, ipaddress.IPv6Address):
        if parsed.ipv4_mapped is not None:
            return str(parsed.ipv4_mapped)
        return str(ipaddress.ip_network((parsed, 64), strict=False))
    return str(parsed)


@dataclass(slots=True)
class TokenBucket:
    """A token bucket: a burst, then one more after each `refill_s`; it starts full."""

    burst: int
    refill_s: float
    at: float  # when it held `left`, s
    left: float = math.inf

    def wait_s(self, now: float) -> int:
        """Whole seconds until one can be taken; 0: now."""
        left = self._left(now)
        return 0 if left >= 1.0 else math.ceil((1.0 - left) * self.refill_s)

    def take(self, now: float) -> bool:
        """Take one token; False if there is none."""
        left = self._left(now)
        self.left, self.at = max(left - 1.0, 0.0), now
        return left >= 1.0

    def _left(self, now: float) -> float:
        return min(self.burst, self.left + (now - self.at) / self.refill_s)


class RefusalLimit:
    """Token buckets per address; used from one thread (the event loop's)."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._buckets: OrderedDict[str, TokenBucket] = OrderedDict()
        self._valid: OrderedDict[tuple[str, str], None] = OrderedDict()
        self._notes = TokenBucket(NOTES_BURST, NOTES_REFILL_S, clock())

    def wait_s(self, address: str, prefix: str) -> int:
        """Whole seconds until this key may be tried from this address; 0: now."""
        place = network_of(address)
        bucket = self._buckets.get(place)
        if bucket is None or (place, prefix) in self._valid:
            return 0
        return bucket.wait_s(self._clock())

    def note_refused(self, address: str) -> bool:
        """Count an invalid key; False if there were so many that this one should not be recorded."""
        place, now = network_of(address), self._clock()
        bucket = self._buckets.get(place) or TokenBucket(BURST, REFILL_S, now)
        remember(self._buckets, place, bucket)
        return bucket.take(now) and self._notes.take(now)

    def note_valid(self, address: str, prefix: str) -> None:
        """Remember a valid key, so that guesses from the same address do not delay it."""
        remember(self._valid, (network_of(address), prefix), None)

    def forget(self, address: str, prefix: str) -> None:
        """Forget a key that has expired or was revoked."""
        self._valid.pop((network_of(address), prefix), None)


def remember(known: OrderedDict[Key, Value], key: Key, value: Value) -> None:
    """Put a value into a cache of bounded size, evicting the least recently used one."""
    known[key] = value
    known.move_to_end(key)
    if len(known) > REMEMBERED:
        known.popitem(last=False)
