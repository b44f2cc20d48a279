"""Laws of the brake on guessing."""

from __future__ import annotations

from app.keys.refusal_limit import BURST, NOTES_BURST, REFILL_S, REMEMBERED, RefusalLimit, network_of


class Clock:
    """A clock set by the test, s."""

    now = 0.0

    def __call__(self) -> float:
        """Read the clock."""
        return self.now


def tried(limit: RefusalLimit, address: str, prefix: str = "guess") -> bool:
    """Try a key that does not open; False when it was not even looked at."""
    if limit.wait_s(address, prefix) > 0:
        return False
    limit.note_refused(address)
    return True


def test_guesses_are_limited_and_come_back() -> None:
    """An address has a burst of guesses, then one per refill time, whatever it does meanwhile."""
    clock = Clock()
    limit = RefusalLimit(clock)
    assert sum(tried(limit, "203.0.113.5") for _ in range(100)) == BURST
    assert limit.wait_s("203.0.113.5", "guess") == REFILL_S
    for _ in range(7):
        clock.now += REFILL_S
        assert sum(tried(limit, "203.0.113.5") for _ in range(100)) == 1
    clock.now += 1000 * REFILL_S
    assert sum(tried(limit, "203.0.113.5") for _ in range(100)) == BURST


def test_addresses_do_not_answer_for_one_another() -> None:
    """Another address may guess for itself; the addresses of one IPv6 network count as one."""
    limit = RefusalLimit(Clock())
    while tried(limit, "2001:db8::1"):
        pass
    assert not tried(limit, "2001:db8::ffff:1")
    assert tried(limit, "2001:db8:0:1::1")
    assert tried(limit, "203.0.113.5")
    assert network_of("::ffff:203.0.113.5") == network_of("203.0.113.5")


def test_a_key_that_opened_is_never_held_up() -> None:
    """Others' guesses from the same office do not lock out who works there, until the key itself is ended."""
    limit = RefusalLimit(Clock())
    limit.note_valid("203.0.113.5", "mine")
    while tried(limit, "203.0.113.5"):
        pass
    assert limit.wait_s("203.0.113.5", "mine") == 0
    assert limit.wait_s("203.0.113.6", "mine") == 0
    assert limit.wait_s("203.0.113.5", "new") > 0
    limit.forget("203.0.113.5", "mine")
    assert limit.wait_s("203.0.113.5", "mine") > 0


def test_notes_are_limited_over_all_addresses() -> None:
    """A thousand addresses that guess do not fill the audit log."""
    limit = RefusalLimit(Clock())
    noted = sum(limit.note_refused(f"10.{number // 250}.{number % 250}.1") for number in range(1000))
    assert noted == NOTES_BURST


def test_memory_is_bounded() -> None:
    """However many addresses guess, a bounded number is remembered."""
    limit = RefusalLimit(Clock())
    for number in range(REMEMBERED + 50):
        address = f"10.{number >> 16}.{number >> 8 & 255}.{number & 255}"
        limit.note_refused(address)
        limit.note_valid(address, "mine")
    assert len(limit._buckets) == len(limit._valid) == REMEMBERED
