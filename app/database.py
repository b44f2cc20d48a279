"""Engines and transactions: SQLite (WAL, one writer at a time) and Postgres behind one small shell."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from sqlalchemy import URL, Double, Engine, Table, create_engine, event, inspect, make_url, text
from sqlalchemy.engine import Connection
from sqlalchemy.ext.compiler import compiles
from sqlalchemy.sql.compiler import SQLCompiler
from sqlalchemy.sql.functions import FunctionElement

from app.database_address import normal_url

# What store and repository functions work in: a Core connection inside a transaction. Not the ORM's session:
# nothing here maps classes to tables, and importing the ORM costs 0.3 s at every start.
Session = Connection

BUSY_TIMEOUT_MS = 15_000  # a writer waits this long for another's commit; ours last milliseconds
BEGIN_OPTION = "morphid_begin"  # execution option: how SQLite opens the transaction
CONNECT_TIMEOUT_S = 5
POSTGRES_PATIENCE = {
    # another process may be stopped amid a transaction, or its host be gone: nobody waits for it forever
    "lock_timeout": "10s",
    "statement_timeout": "60s",
    "idle_in_transaction_session_timeout": "30s",
}
POSTGRES_LINK = {
    # a host that vanished without a word is noticed within half a minute
    "connect_timeout": CONNECT_TIMEOUT_S,
    "keepalives_idle": 10,
    "keepalives_interval": 5,
    "keepalives_count": 4,
}


class database_time(FunctionElement[float]):  # noqa: N801 - reads as the SQL function it is
    """The database's clock as SQL: seconds since 1970 UTC (double). No process's own clock rules leases.

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


def insert_new(session: Session, table: Table) -> Any:
    """An INSERT that can leave existing rows alone or change them (``on_conflict_...``)."""
    if session.dialect.name == "sqlite":
        from sqlalchemy.dialects import sqlite

        return sqlite.insert(table)
    from sqlalchemy.dialects import postgresql  # lazy: slow to import, and not needed with SQLite

    return postgresql.insert(table)


def make_engine(url: str) -> Engine:
    """Open an engine for `url`; an SQLite file's folder is made when it is missing."""
    parsed = make_url(normal_url(url))
    if parsed.get_backend_name() != "sqlite":
        return create_engine(
            parsed, pool_pre_ping=True, pool_size=20, max_overflow=40, connect_args=_postgres_link(parsed)
        )
    if parsed.database and parsed.database != ":memory:":
        Path(parsed.database).parent.mkdir(parents=True, exist_ok=True)
    engine = create_engine(parsed, pool_size=20, max_overflow=40)

    @event.listens_for(engine, "connect")
    def _on_connect(connection: Any, _record: Any) -> None:
        # the driver must not open transactions by itself, or BEGIN IMMEDIATE comes too late
        connection.isolation_level = None
        cursor = connection.cursor()
        cursor.execute(f"PRAGMA busy_timeout = {BUSY_TIMEOUT_MS}")
        cursor.execute("PRAGMA journal_mode = WAL")
        cursor.execute("PRAGMA synchronous = FULL")  # an accepted job survives a power cut, not only a crash
        cursor.execute("PRAGMA foreign_keys = ON")
        cursor.close()

    @event.listens_for(engine, "begin")
    def _on_begin(connection: Connection) -> None:
        mode = connection.get_execution_options().get(BEGIN_OPTION, "DEFERRED")
        connection.exec_driver_sql(f"BEGIN {mode}")

    return engine


def _postgres_link(url: URL) -> dict[str, Any]:
    """What the driver is told beside the URL; whatever the URL says itself holds."""
    options = " ".join(f"-c {name}={value}" for name, value in POSTGRES_PATIENCE.items())
    own = url.query.get("options")
    told = {**POSTGRES_LINK, "options": f"{options} {own}" if own else options}
    return {key: value for key, value in told.items() if key == "options" or key not in url.query}


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
        # SQLite: a transaction that will write takes the write lock at once; upgrading later may fail
        self._writer = self.engine.execution_options(**{BEGIN_OPTION: "IMMEDIATE"})

    @contextmanager
    def write(self) -> Iterator[Session]:
        """A transaction that is committed at the end of the block, or rolled back by an exception."""
        with self._writer.begin() as session:
            yield session

    @contextmanager
    def read(self) -> Iterator[Session]:
        """A transaction for reading; whatever it wrote is rolled back."""
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
    config.set_main_option("script_location", folder.replace("%", "%%"))  # else taken for an interpolation
    config.attributes["url"] = url
    return config


def schema_revision(session: Session) -> str | None:
    """Name the migration that the database is at; None for one that was never migrated."""
    if not inspect(session).has_table("alembic_version"):
        return None
    revision: str | None = session.scalar(text("SELECT version_num FROM alembic_version"))
    return revision


def upgrade(url: str, revision: str = "head") -> None:
    """Migrate the database at `url` up to `revision`; safe when several processes start at once."""
    from migrations import HEAD

    if revision == "head":
        database = Database(url)
        try:
            with database.read() as session:
                if schema_revision(session) == HEAD:
                    return
        finally:
            database.dispose()
    from alembic import command  # lazy: most starts have nothing to migrate

    command.upgrade(migration_config(url), revision)


def downgrade(url: str, revision: str) -> None:
    """Migrate the database at `url` down to `revision` (``base`` empties it)."""
    from alembic import command

    command.downgrade(migration_config(url), revision)
