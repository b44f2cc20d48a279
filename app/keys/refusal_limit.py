"""A brake on guessing: an address that keeps sending keys that do not open has to wait.

Nobody finds 256 random bits by trying; the brake keeps broken and hostile clients from filling the database's
time and the audit log. Addresses often stand for many people (an office, a proxy), so a key that has opened
from an address before is never held up there.
"""

from __future__ import annotations

import ipaddress
import math
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass

BURST = 10  # refusals that an address has free
REFILL_S = 6.0  # and one more after each such time
NOTES_BURST = 200  # refusals that are written down, from all addresses together
NOTES_REFILL_S = 1.0
REMEMBERED = 10_000  # addresses, and keys that opened; the longest unused are forgotten first


def network_of(address: str) -> str:
    """Name whom an address stands for: itself, or the /64 that an IPv6 host changes its address in."""
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
    """So many at once, then one more after each `refill_s`.

    Attributes
    ----------
    burst : int
        Most that it holds; it begins full.
    refill_s : float
        Time for one more, s.
    at : float
        When it held `left`, s.
    left : float
    """

    burst: int
    refill_s: float
    at: float
    left: float = math.inf

    def wait_s(self, now: float) -> int:
        """Whole seconds until one can be taken; 0: now."""
        left = self._left(now)
        return 0 if left >= 1.0 else math.ceil((1.0 - left) * self.refill_s)

    def take(self, now: float) -> bool:
        """Take one; False when there is none."""
        left = self._left(now)
        self.left, self.at = max(left - 1.0, 0.0), now
        return left >= 1.0

    def _left(self, now: float) -> float:
        return min(self.burst, self.left + (now - self.at) / self.refill_s)


class RefusalLimit:
    """Token buckets per address; used from one thread (the event loop's).

    Parameters
    ----------
    clock
        Seconds that only rise.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._buckets: OrderedDict[str, TokenBucket] = OrderedDict()
        self._opened: OrderedDict[tuple[str, str], None] = OrderedDict()
        self._notes = TokenBucket(NOTES_BURST, NOTES_REFILL_S, clock())

    def wait_s(self, address: str, prefix: str) -> int:
        """Whole seconds until this key may be tried from this address; 0: now."""
        place = network_of(address)
        bucket = self._buckets.get(place)
        if bucket is None or (place, prefix) in self._opened:
            return 0
        return bucket.wait_s(self._clock())

    def note_refused(self, address: str) -> bool:
        """Count a key that did not open; False when so many were that none should be written down."""
        place, now = network_of(address), self._clock()
        bucket = self._buckets.setdefault(place, TokenBucket(BURST, REFILL_S, now))
        self._buckets.move_to_end(place)
        if len(self._buckets) > REMEMBERED:
            self._buckets.popitem(last=False)
        return bucket.take(now) and self._notes.take(now)

    def note_opened(self, address: str, prefix: str) -> None:
        """Remember a key that opened, so that others' guesses from the same address do not hold it up."""
        pair = (network_of(address), prefix)
        self._opened[pair] = None
        self._opened.move_to_end(pair)
        if len(self._opened) > REMEMBERED:
            self._opened.popitem(last=False)

    def forget(self, address: str, prefix: str) -> None:
        """Hold up a key like any other again: its holder was told that it expired or was revoked."""
        self._opened.pop((network_of(address), prefix), None)
