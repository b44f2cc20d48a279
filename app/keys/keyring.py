"""Checks keys: one digest per request, one indexed read per key every two seconds, never a write."""

from __future__ import annotations

import time
from collections import OrderedDict
from collections.abc import Callable
from enum import StrEnum
from functools import partial

from app.background_writer import BackgroundWriter
from app.database import Database
from app.keys.records import ApiKey
from app.keys.refusal_limit import remember
from app.keys.repository import StoredKey, find_key, note_use
from app.keys.secret import KeyText

FRESH_S = 2.0  # a revoked key is refused after this long, in every process


class Refusal(StrEnum):
    """Why a key is not valid: for the audit log, never for the caller."""

    MALFORMED = "malformed"
    UNKNOWN = "unknown"
    EXPIRED = "expired"
    REVOKED = "revoked"


class KeyRing:
    """The keys of the database, cached briefly; their last use is written in the background."""

    def __init__(
        self, database: Database, background: BackgroundWriter, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._database = database
        self._background = background
        self._clock = clock
        self._remembered: OrderedDict[str, StoredKey] = OrderedDict()

    def is_fresh(self, text: KeyText) -> bool:
        """Whether `check` does not need the database."""
        known = self._remembered.get(text.prefix)
        return known is not None and self._clock() - known.read_at < FRESH_S

    def check(self, text: KeyText) -> ApiKey | Refusal:
        """Return the key's record, or why it is not valid; reads the database unless it `is_fresh`."""
        known = self._remembered.get(text.prefix)
        if known is None or self._clock() - known.read_at >= FRESH_S:
            known = self._read(text.prefix)
        if known is None or not text.matches(known.secret_sha256):
            return Refusal.UNKNOWN
        key = known.key
        if key.revoked_at is not None:
            return Refusal.REVOKED
        if key.expired:
            return Refusal.EXPIRED
        if known.use_is_due:
            known.use_is_due = False
            self._background.put(partial(note_use, key_id=key.id))
        return key

    def forget(self, key: ApiKey) -> None:
        """Drop a key from the cache because it has changed."""
        self._remembered.pop(key.prefix, None)

    def _read(self, prefix: str) -> StoredKey | None:
        read_at = (
            self._clock()
        )  # taken before the read, so that cached entries are never younger than assumed
        with self._database.read() as session:
            known = find_key(session, prefix)
        if known is None:
            # unknown prefixes are not cached: guesses must not displace keys in use
            self._remembered.pop(prefix, None)
        else:
            known.read_at = read_at
            remember(self._remembered, prefix, known)
        return known
