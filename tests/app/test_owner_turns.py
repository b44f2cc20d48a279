"""Laws of slots that owners take by turns."""

from __future__ import annotations

import asyncio

import pytest

from app.errors import TooManyStreams
from app.owner_turns import OwnerLimit, OwnerTurns


class Readers:
    """Requests that take a turn and keep it until the test ends them."""

    def __init__(self, turns: OwnerTurns) -> None:
        self.turns = turns
        self.served: list[str] = []
        self.ends: dict[str, asyncio.Event] = {}
        self.tasks: dict[str, asyncio.Task[None]] = {}

    async def ask(self, *names: str) -> None:
        """Let requests wait for a turn; the first letter is the owner."""
        for name in names:
            self.ends[name] = asyncio.Event()
            self.tasks[name] = asyncio.create_task(self._have(name))
        await self.settle()

    async def end(self, name: str) -> None:
        """End one that has its turn."""
        self.ends[name].set()
        await self.settle()

    async def settle(self) -> None:
        """Let everybody go on who can."""
        for _ in range(5):
            await asyncio.sleep(0)

    async def _have(self, name: str) -> None:
        async with self.turns.turn(name[0]):
            self.served.append(name)
            await self.ends[name].wait()


def test_one_slot_is_left_to_the_others() -> None:
    """However many of one owner wait, the first of another is served at once."""

    async def play() -> None:
        readers = Readers(OwnerTurns(2, 1))
        await readers.ask(*(f"a{number}" for number in range(14)))
        assert readers.served == ["a0"]
        await readers.ask("b0")
        assert readers.served == ["a0", "b0"]

    asyncio.run(play())


def test_owners_take_turns() -> None:
    """With one slot each owner's first is served before anybody's second; inside an owner in order."""

    async def play() -> None:
        readers = Readers(OwnerTurns(1, 1))
        await readers.ask("a0", "a1", "a2", "b0", "b1", "c0")
        for _ in range(6):
            await readers.end(readers.served[-1])
        assert readers.served == ["a0", "a1", "b0", "c0", "a2", "b1"]

    asyncio.run(play())


def test_who_has_fewest_is_next() -> None:
    """A free slot goes to the owner who has the fewest."""

    async def play() -> None:
        readers = Readers(OwnerTurns(3, 3))
        await readers.ask("a0", "a1", "b0", "a2", "b1", "c0")
        assert readers.served == ["a0", "a1", "b0"]
        await readers.end("b0")
        assert readers.served[3:] == ["b1"] or readers.served[3:] == ["c0"]
        await readers.end("a0")
        assert sorted(readers.served[3:]) == ["b1", "c0"]

    asyncio.run(play())


def test_a_request_that_gives_up_costs_no_slot() -> None:
    """Cancelled while it waits, at the moment it is served, or later: the slot is there for the next."""

    async def play() -> None:
        readers = Readers(OwnerTurns(1, 1))
        await readers.ask("a0", "b0", "c0", "d0")
        readers.tasks["b0"].cancel()
        await readers.settle()
        readers.ends["a0"].set()
        await asyncio.sleep(0)  # c0 has its slot and does not know yet
        readers.tasks["c0"].cancel()
        await readers.settle()
        assert readers.served == ["a0", "d0"]
        readers.tasks["d0"].cancel()
        await readers.settle()
        await readers.ask("e0")
        assert readers.served[-1] == "e0"

    asyncio.run(play())


def test_a_limit_is_an_owners_own() -> None:
    """One owner's last place is not another's, and one that is given back is there again."""
    limit = OwnerLimit(2, TooManyStreams.of_streams)
    with limit.place("a"):
        with limit.place("a"):
            assert not limit.has_room("a")
            with pytest.raises(TooManyStreams, match="You have 2"), limit.place("a"):
                pass
            with limit.place("b"):
                assert limit.has_room("b")
        assert limit.has_room("a")
