"""Laws of the keys of requests that are under way, on both databases."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path

import pytest
from sqlalchemy import delete, update

from app.database import Database, Session, database_time
from app.errors import Unauthorized
from app.keys.records import ApiKey, Scope
from app.keys.service import revoke_key
from app.keys.watch import KeyInUse, KeyWatch
from app.tables import api_keys
from tests.app.key_holders import make_key

Change = Callable[[Session, str], object]


def _set(**values: object) -> Change:
    return lambda session, key_id: session.execute(
        update(api_keys).where(api_keys.c.id == key_id).values(**values)
    )


LOSSES: dict[str, Change] = {
    "revoked": revoke_key,
    "expired": _set(expires_at=database_time()),
    "fewer scopes": _set(scopes=[Scope.JOBS_READ.value]),
    "another owner": _set(owner="beta"),
    "deleted": lambda session, key_id: session.execute(delete(api_keys).where(api_keys.c.id == key_id)),
}
HARMLESS: dict[str, Change] = {
    "nothing": lambda _session, _key_id: None,
    "a smaller quota": _set(max_jobs_in_flight=1),
    "a later end": _set(expires_at=database_time() + 1000.0),
}


@pytest.mark.parametrize("name", [*LOSSES, *HARMLESS])
def test_a_wait_ends_with_its_key(database: Database, name: str) -> None:
    """Whatever takes from a key what its request was let in by breaks off the wait; nothing else does."""
    mine, other = make_key(database).key, make_key(database).key
    reported: list[ApiKey] = []

    async def play() -> tuple[bool, bool]:
        watch = KeyWatch(database, on_lost=reported.append)

        async def wait(in_use: KeyInUse) -> None:
            async with in_use.while_valid():
                await asyncio.sleep(3600.0)

        with watch.use(mine) as first, watch.use(other) as second:
            waits = [asyncio.create_task(wait(in_use)) for in_use in (first, second)]
            await asyncio.sleep(0)
            with database.write() as session:
                {**LOSSES, **HARMLESS}[name](session, mine.id)
            await watch.look()
            done, pending = await asyncio.wait(waits, timeout=0.2, return_when=asyncio.FIRST_COMPLETED)
            ended = [isinstance(task.exception(), Unauthorized) for task in done]
            for task in pending:
                task.cancel()
            if first.lost:
                with pytest.raises(Unauthorized):
                    first.require_valid()
                with pytest.raises(Unauthorized):
                    await wait(first)
            return ended == [True] and first.lost, second.lost

    assert asyncio.run(play()) == (name in LOSSES, False)
    assert [key.id for key in reported] == [mine.id] * (name in LOSSES)


def test_a_database_that_is_away_ends_nothing(database: Database, tmp_path: Path) -> None:
    """Whether the key still opens is not known then: the wait goes on, and is looked at again."""
    away = Database(f"sqlite:///{tmp_path / 'empty.sqlite3'}")  # there is not even a table

    async def play() -> bool:
        watch = KeyWatch(away, on_lost=lambda _: None)
        with watch.use(make_key(database).key) as in_use:
            await watch.look()
            return in_use.lost

    assert not asyncio.run(play())
    away.dispose()


def test_other_ends_of_a_wait_stay_what_they_are() -> None:
    """A time limit inside is a time limit, and no lost key."""

    async def play() -> None:
        with pytest.raises(TimeoutError):
            async with KeyInUse().while_valid(), asyncio.timeout(0.0):
                await asyncio.sleep(1.0)

    asyncio.run(play())
