"""Laws of a key's text."""

from __future__ import annotations

import hashlib

import pytest

from app.keys.secret import KeyText

SAMPLES = 200


def test_a_key_is_taken_apart_as_it_was_put_together() -> None:
    """Prefix and secret survive the way through the text."""
    key = KeyText.new()
    assert KeyText.parsed(key.text()) == key


def test_secrets_hold_256_random_bits() -> None:
    """Every one of the 256 bits is a one in about half of the keys, and no key comes twice."""
    alphabet = "0123456789abcdefghjkmnpqrstvwxyz"
    numbers = []
    for _ in range(SAMPLES):
        number = 0
        for character in KeyText.new().secret:
            number = 32 * number + alphabet.index(character)
        numbers.append(number)
    assert len(set(numbers)) == SAMPLES
    for bit in range(256):
        ones = sum(number >> bit & 1 for number in numbers)
        # 6.4 standard deviations of a fair coin: all 256 bits pass but once in 10^7 runs
        assert abs(ones - SAMPLES / 2) < 6.4 * (SAMPLES / 4) ** 0.5


def test_only_its_own_digest_is_opened() -> None:
    """A secret opens the SHA-256 of itself and nothing else."""
    key, other = KeyText.new(), KeyText.new()
    assert key.digest() == hashlib.sha256(key.secret.encode()).hexdigest()
    assert key.matches(key.digest())
    assert not key.matches(other.digest())
    assert not key.matches("")


def test_a_secret_is_not_shown_by_accident() -> None:
    """What logs and error reports print of a key is its prefix."""
    key = KeyText.new()
    assert key.secret not in repr(key)
    assert key.secret not in f"{key}"
    assert key.prefix in repr(key)


@pytest.mark.parametrize(
    "text",
    ["", "mid_", "mid__", "Bearer mid_a_b", "mid_4k7m2x9q_short", "MID_4k7m2x9q_" + 52 * "0"]
    + [f"mid_4k7m2x9q_{52 * '0'}{tail}" for tail in ("0", "\n", " ", "\x00", "_")]
    + [f"mid_4k7m2x9q_{51 * '0'}é", f"mid_4k7m2x9_{52 * '0'}", f"xmid_4k7m2x9q_{52 * '0'}"],
)
def test_what_is_no_key_is_recognised(text: str) -> None:
    """Only the exact form is a key."""
    assert KeyText.parsed(text) is None
