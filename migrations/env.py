"""Run migrations in one transaction under a lock: processes that start together wait for one another."""

from __future__ import annotations

from alembic import context
from sqlalchemy import text

from app.database import BEGIN_OPTION, make_engine
from app.tables import metadata

MIGRATION_LOCK = 0x4D4F5250  # "MORP": Postgres advisory lock held during migrations


def database_url() -> str:
    """The URL passed by `app.database`, or that of the settings when Alembic is called by hand."""
    url = context.config.attributes.get("url")
    if url is None:
        from app.settings import load_settings

        url = load_settings().database_url
    return str(url)


def run() -> None:
    """Open the database, lock it, migrate, commit."""
    engine = make_engine(database_url())
    try:
        with engine.execution_options(**{BEGIN_OPTION: "IMMEDIATE"}).begin() as connection:
            if connection.dialect.name == "postgresql":
                # waiting for another migration, or rewriting a large table, may take longer than a request
                connection.execute(text("SET LOCAL statement_timeout = 0"))
                connection.execute(text("SET LOCAL lock_timeout = 0"))
                connection.execute(text("SELECT pg_advisory_xact_lock(:key)"), {"key": MIGRATION_LOCK})
            context.configure(
                connection=connection,
                target_metadata=metadata,
                render_as_batch=connection.dialect.name == "sqlite",
                compare_type=True,
            )
            context.run_migrations()
    finally:
        engine.dispose()


run()
