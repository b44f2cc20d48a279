"""Identifiers that sort by creation time and cannot be guessed."""

from __future__ import annotations

import secrets
import time

ALPHABET = "0123456789abcdefghjkmnpqrstvwxyz"  # Crockford base 32: no i, l, o, u
TIME_CHARACTERS = 10  # 50 bits of milliseconds: until the year 37000
RANDOM_CHARACTERS = 16  # 80 bits


def base32(number: int, characters: int) -> str:
    """Write a number in a fixed number of characters of Crockford's alphabet, with leading zeros."""
    digits = []
    for _ in range(characters):
        number, digit = divmod(number, 32)
        digits.append(ALPHABET[digit])
    return "".join(reversed(digits))


def new_identifier(kind: str) -> str:
    """Return ``kind_`` and 26 characters: milliseconds since 1970, then randomness (the layout of ULID).

    The order is only used for listing; nothing depends on synchronised clocks.
    """
    milliseconds = time.time_ns() // 1_000_000
    return f"{kind}_{base32(milliseconds, TIME_CHARACTERS)}{base32(secrets.randbits(80), RANDOM_CHARACTERS)}"
