"""Engines and transactions: SQLite (WAL, one writer at a time) and Postgres behind one small interface."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar

from sqlalchemy import URL, Double, Engine, Table, create_engine, event, inspect, make_url, select, text
from sqlalchemy.engine import Connection
from sqlalchemy.exc import DBAPIError, OperationalError
from sqlalchemy.ext.compiler import compiles
from sqlalchemy.sql.compiler import SQLCompiler
from sqlalchemy.sql.functions import FunctionElement

from app.database_address import normal_url
from app.database_errors import DatabaseTrouble, trouble_of
from app.private_files import close_to_others, make_private_folder, touch_private
from app.reserve import Reserve

# The session of store and repository functions: a Core connection inside a transaction. Not the ORM's
# session: nothing here maps classes to tables, and importing the ORM costs 0.3 s at every start.
Session = Connection
Answer = TypeVar("Answer")

BUSY_TIMEOUT_MS = 15_000  # a writer waits this long for another's commit; ours last milliseconds
JOURNAL_LIMIT_BYTES = 4 * 2**20  # SQLite: a longer journal is truncated when it is restarted
LENDINGS = 16  # tries of a write that must fit
BEGIN_OPTION = "morphid_begin"  # execution option: how SQLite opens the transaction
CONNECT_TIMEOUT_S = 5
POSTGRES_PATIENCE = {
    # another process may be stopped in a transaction, or its host lost: do not wait for it forever
    "lock_timeout": "10s",
    "statement_timeout": "60s",
    "idle_in_transaction_session_timeout": "30s",
}
POSTGRES_LINK = {
    # a host that vanished silently is noticed within half a minute
    "connect_timeout": CONNECT_TIMEOUT_S,
    "keepalives_idle": 10,
    "keepalives_interval": 5,
    "keepalives_count": 4,
}


class database_time(FunctionElement[float]):  # noqa: N801 - named like the SQL function it is
    """The database's clock as SQL: seconds since 1970 UTC (double). Leases never depend on local clocks.

    Postgres uses ``clock_timestamp()``, not ``now()``: a transaction that waited for a lock must not act in
    the past.
    """

    type = Double()
    name = "database_time"
    inherit_cache = True


@compiles(database_time, "sqlite")
def _sqlite_time(_element: database_time, _compiler: SQLCompiler, **_options: Any) -> str:
    # julianday, not unixepoch('subsec'): that one needs SQLite 3.42
    return "((julianday('now') - 2440587.5) * 86400.0)"


@compiles(database_time, "postgresql")
def _postgres_time(_element: database_time, _compiler: SQLCompiler, **_options: Any) -> str:
    return "CAST(extract(epoch FROM clock_timestamp()) AS DOUBLE PRECISION)"


def current_time(session: Session) -> float:
    """Read the database's clock, s since 1970 UTC."""
    return float(session.execute(select(database_time())).scalar_one())


def insert_new(session: Session, table: Table) -> Any:
    """An INSERT that can leave existing rows alone or change them (``on_conflict_...``)."""
    if session.dialect.name == "sqlite":
        from sqlalchemy.dialects import sqlite

        return sqlite.insert(table)
    from sqlalchemy.dialects import postgresql  # lazy: slow to import, and not needed with SQLite

    return postgresql.insert(table)


def make_engine(url: str) -> Engine:
    """Open an engine for `url`; a missing SQLite file and its folder are made, private to this user."""
    parsed = make_url(normal_url(url))
    if parsed.get_backend_name() != "sqlite":
        return create_engine(
            parsed, pool_pre_ping=True, pool_size=20, max_overflow=40, connect_args=_postgres_link(parsed)
        )
    file = _sqlite_file(parsed)
    if file is not None:
        make_private_folder(file.parent)
    engine = create_engine(parsed, pool_size=20, max_overflow=40)

    @event.listens_for(engine, "do_connect")
    def _before_connect(*_how: Any) -> None:
        if file is not None:
            _keep_private(file)

    @event.listens_for(engine, "connect")
    def _on_connect(connection: Any, _record: Any) -> None:
        # the driver must not open transactions itself, or BEGIN IMMEDIATE comes too late
        connection.isolation_level = None
        cursor = connection.cursor()
        cursor.execute(f"PRAGMA busy_timeout = {BUSY_TIMEOUT_MS}")
        if file is not None and file.stat().st_size == 0:
            # so that free pages can be released; must be set before anything is in the file
            cursor.execute("PRAGMA auto_vacuum = INCREMENTAL")
        cursor.execute("PRAGMA journal_mode = WAL")
        cursor.execute(f"PRAGMA journal_size_limit = {JOURNAL_LIMIT_BYTES}")
        cursor.execute("PRAGMA synchronous = FULL")  # an accepted job survives a power cut, not only a crash
        cursor.execute("PRAGMA foreign_keys = ON")
        cursor.close()

    @event.listens_for(engine, "begin")
    def _on_begin(connection: Connection) -> None:
        mode = connection.get_execution_options().get(BEGIN_OPTION, "DEFERRED")
        connection.exec_driver_sql(f"BEGIN {mode}")

    return engine


def _sqlite_file(url: URL) -> Path | None:
    named = url.database or ":memory:"
    return None if named == ":memory:" or named.startswith("file:") else Path(named)


def _keep_private(file: Path) -> None:
    """Make the database's file before SQLite does, so that its journals get the same mode from the start."""
    with suppress(OSError):  # SQLite then reports the error itself
        touch_private(file)
        for suffix in ("-wal", "-shm"):
            journal = file.with_name(file.name + suffix)
            if journal.exists():
                close_to_others(journal)


def _postgres_link(url: URL) -> dict[str, Any]:
    """Connection options in addition to the URL; whatever the URL says itself takes precedence."""
    options = " ".join(f"-c {name}={value}" for name, value in POSTGRES_PATIENCE.items())
    link = {key: value for key, value in POSTGRES_LINK.items() if key not in url.query}
    return {**link, "options": f"{options} {url.query.get('options', '')}".rstrip()}


class Database:
    """One engine and its two kinds of transaction.

    Parameters
    ----------
    url : str
        SQLAlchemy URL, ``sqlite:///...`` or ``postgresql://...``.
    """

    def __init__(self, url: str) -> None:
        self.url = normal_url(url)
        self.engine = make_engine(url)
        parsed = make_url(self.url)
        file = _sqlite_file(parsed) if parsed.get_backend_name() == "sqlite" else None
        self.reserve = None if file is None else Reserve(file)  # space for `write_even_if_full`
        # SQLite: a transaction that will write takes the write lock at once; upgrading later may fail
        self._writer = self.engine.execution_options(**{BEGIN_OPTION: "IMMEDIATE"})

    @contextmanager
    def write(self) -> Iterator[Session]:
        """A transaction that is committed at the end of the block, or rolled back by an exception."""
        with self._writer.begin() as session:
            yield session

    def write_even_if_full(self, write: Callable[[Session], Answer]) -> Answer:
        """Run a small write in its own transaction; on a full disk it uses space from the reserve.

        For the operations needed most when the disk is full: cancelling, deleting, ending a job. `write` is
        called again if it did not fit.
        """
        try:
            with self.write() as session:
                return write(session)
        except DBAPIError as error:
            if trouble_of(error) is not DatabaseTrouble.FULL or self.reserve is None:
                raise
            return self._write_with(self.reserve, write, error)

    def _write_with(self, reserve: Reserve, write: Callable[[Session], Answer], why: DBAPIError) -> Answer:
        """Repeat a write that did not fit; another write may take the lent space before ours is on disk."""
        for _ in range(LENDINGS):
            try:
                with self.write() as session:
                    answer = write(session)
                    # at the last moment, while no one else can write: the commit finds the space
                    if not reserve.lend():
                        raise why
                reserve.take_back()
            except OperationalError as error:
                if error is why:
                    raise
            else:
                return answer
        raise why

    @contextmanager
    def read(self) -> Iterator[Session]:
        """A transaction for reading; any writes are rolled back."""
        with self.engine.connect() as session:
            yield session

    def dispose(self) -> None:
        """Close every pooled connection (also call it in a forked child before first use)."""
        self.engine.dispose()


def migration_config(url: str) -> Any:
    """Alembic configuration for `url`, found from the installed package: no working directory is assumed."""
    from alembic.config import Config  # lazy: only a start or an operator migrates

    import migrations

    config = Config()
    folder = str(Path(migrations.__file__).parent)
    config.set_main_option(
        "script_location", folder.replace("%", "%%")
    )  # otherwise treated as an interpolation
    config.attributes["url"] = url
    return config


def schema_revision(session: Session) -> str | None:
    """Return the revision of the database; None if it was never migrated."""
    if not inspect(session).has_table("alembic_version"):
        return None
    revision: str | None = session.scalar(text("SELECT version_num FROM alembic_version"))
    return revision


def upgrade(url: str, revision: str = "head") -> None:
    """Migrate the database at `url` up to `revision`; safe when several processes start at once."""
    from app.disk_space import make_shrinkable  # lazy: it imports this module
    from migrations import HEAD

    database = Database(url)
    try:
        with database.read() as session:
            current = schema_revision(session)
        if revision != "head" or current != HEAD:
            from alembic import command  # lazy: most starts have nothing to migrate

            command.upgrade(migration_config(url), revision)
        if revision == "head":
            make_shrinkable(database)
    finally:
        database.dispose()


def downgrade(url: str, revision: str) -> None:
    """Migrate the database at `url` down to `revision` (``base`` empties it)."""
    from alembic import command

    command.downgrade(migration_config(url), revision)
