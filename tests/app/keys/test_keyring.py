"""Laws of checking keys, on both databases."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

from sqlalchemy import event, update

from app.background_writer import BackgroundWriter, Write
from app.database import Database, database_time
from app.keys import repository
from app.keys.keyring import FRESH_S, KeyRing, Refusal
from app.keys.records import ApiKey
from app.keys.repository import USE_NOTED_EVERY_S
from app.keys.secret import KeyText
from app.keys.service import NewKey, revoke_key
from app.tables import api_keys
from tests.app.key_holders import make_key


class Clock:
    """A clock set by the test, s."""

    now = 0.0

    def __call__(self) -> float:
        """Read the clock."""
        return self.now


class Noted:
    """Takes what would be written afterwards."""

    def __init__(self) -> None:
        self.writes: list[Write] = []

    def put(self, write: Write) -> None:
        """Take one."""
        self.writes.append(write)


def ring(database: Database, clock: Callable[[], float], noted: Noted | None = None) -> KeyRing:
    """A key ring whose clock and notes are the test's."""
    return KeyRing(database, cast(BackgroundWriter, noted or Noted()), clock)


def text_of(made: NewKey) -> KeyText:
    """The key as its holder has it."""
    text = KeyText.parsed(made.text)
    assert text is not None
    return text


def statements(database: Database) -> list[str]:
    """Collect the SQL that is sent from now on."""
    sent: list[str] = []

    def collect(_connection: Any, _cursor: Any, statement: str, *_rest: Any) -> None:
        sent.append(statement)

    event.listen(database.engine, "before_cursor_execute", collect)
    return sent


def test_a_key_tells_owner_scopes_and_quota(database: Database) -> None:
    """What was given at its making is what the service knows of a key."""
    made = make_key(database, "lab")
    found = ring(database, Clock()).check(text_of(made))
    assert isinstance(found, ApiKey)
    assert found == made.key


def test_only_the_digest_is_stored(database: Database) -> None:
    """Nothing in the key's row or in the audit log gives the secret away."""
    made = make_key(database)
    with database.read() as session:
        rows = [str(row) for row in session.exec_driver_sql("SELECT * FROM api_keys")]
        rows += [str(row) for row in session.exec_driver_sql("SELECT * FROM audit_log")]
    assert len(rows) == 2
    assert not any(text_of(made).secret in row for row in rows)


def test_wrong_unknown_expired_and_revoked_keys_open_nothing(database: Database) -> None:
    """The reasons are distinguished for the audit log, by the database's clock."""
    keys = ring(database, Clock())
    made, late, gone = make_key(database), make_key(database, expires_in_s=-1.0), make_key(database)
    with database.write() as session:
        revoke_key(session, gone.key.prefix)
    forged = KeyText(text_of(made).prefix, KeyText.new().secret)
    assert keys.check(forged) is Refusal.UNKNOWN
    assert keys.check(KeyText.new()) is Refusal.UNKNOWN
    assert keys.check(text_of(late)) is Refusal.EXPIRED
    assert keys.check(text_of(gone)) is Refusal.REVOKED
    assert isinstance(keys.check(text_of(made)), ApiKey)


def test_revoking_takes_effect_when_the_memory_is_stale(database: Database) -> None:
    """A key that was in use a moment ago opens nothing `FRESH_S` after it was revoked, or has expired."""
    clock = Clock()
    keys = ring(database, clock)
    revoked, expiring = make_key(database), make_key(database, expires_in_s=1000.0)
    assert all(isinstance(keys.check(text_of(made)), ApiKey) for made in (revoked, expiring))
    with database.write() as session:
        revoke_key(session, revoked.key.id)
        session.execute(
            update(api_keys).where(api_keys.c.id == expiring.key.id).values(expires_at=database_time())
        )
    clock.now += FRESH_S
    assert keys.check(text_of(revoked)) is Refusal.REVOKED
    assert keys.check(text_of(expiring)) is Refusal.EXPIRED


def test_a_thousand_requests_cost_one_read_and_no_write(database: Database) -> None:
    """Within `FRESH_S` the database is read once per key; recording its use is deferred."""
    noted = Noted()
    keys = ring(database, Clock(), noted)
    text = text_of(make_key(database))
    sent = statements(database)
    for _ in range(1000):
        assert isinstance(keys.check(text), ApiKey)
    reads = [statement for statement in sent if statement.startswith("SELECT")]
    assert len(reads) == 1
    assert not [statement for statement in sent if statement.startswith(("INSERT", "UPDATE", "DELETE"))]
    assert len(noted.writes) == 1


def test_the_last_use_is_noted_once_a_minute(database: Database) -> None:
    """Two processes and many requests write one time, and again when the note is a minute old."""
    made = make_key(database)

    def writes_of_two_processes() -> int:
        writes = 0
        for _process in range(2):
            noted, clock = Noted(), Clock()
            keys = ring(database, clock, noted)
            for _ in range(5):
                keys.check(text_of(made))
                clock.now += FRESH_S
                with database.write() as session:
                    for write in noted.writes:
                        write(session)
                writes += len(noted.writes)
                noted.writes.clear()
        return writes

    assert writes_of_two_processes() == 1
    with database.read() as session:
        assert repository.key_by_id(session, made.key.id).last_used_at is not None
    assert writes_of_two_processes() == 0
    with database.write() as session:
        session.execute(update(api_keys).values(last_used_at=api_keys.c.last_used_at - USE_NOTED_EVERY_S))
    assert writes_of_two_processes() == 1


def test_guesses_do_not_push_out_keys_in_use(database: Database) -> None:
    """Unknown prefixes are not remembered."""
    keys = ring(database, Clock())
    text = text_of(make_key(database))
    keys.check(text)
    for _ in range(20):
        keys.check(KeyText.new())
    assert list(keys._remembered) == [text.prefix]
