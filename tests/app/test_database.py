"""Laws of migrations and transactions."""

from __future__ import annotations

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from alembic import command
from sqlalchemy import inspect, select, text

from app.database import Database, database_time, downgrade, migration_config, upgrade
from app.jobs import store
from app.tables import jobs, metadata


def test_up_down_up_with_rows(database_url: str) -> None:
    """Migrations go up, down to nothing and up again, with rows in the tables."""
    for _ in range(2):
        upgrade(database_url)
        database = Database(database_url)
        with database.write() as session:
            job = store.create_job(session, owner="local", operation="identify", request={"a": 1})
            claim = store.claim_job(session, job.id, "w")
            assert claim is not None
            store.save_progress(session, claim, {"fraction": 0.1}, b"state")
            store.finish_job(session, claim, "succeeded", result={"model": {}}, artifacts={"a.csv": b"t"})
        assert set(inspect(database.engine).get_table_names()) == {*metadata.tables, "alembic_version"}
        database.dispose()
        downgrade(database_url, "base")
        database = Database(database_url)
        assert set(inspect(database.engine).get_table_names()) <= {"alembic_version"}
        database.dispose()


def test_migrations_make_what_the_code_expects(database_url: str) -> None:
    """The tables of the newest migration are the tables of the code (``alembic check``)."""
    upgrade(database_url)
    command.check(migration_config(database_url))


def test_processes_may_migrate_together(database_url: str) -> None:
    """Several starts at the same moment migrate once and all succeed."""
    call = "import sys; from app.database import upgrade; upgrade(sys.argv[1])"
    starts = [subprocess.Popen([sys.executable, "-c", call, database_url]) for _ in range(3)]
    assert [start.wait(30) for start in starts] == [0, 0, 0]
    database = Database(database_url)
    with database.read() as session:
        assert session.scalar(text("SELECT count(*) FROM alembic_version")) == 1
    database.dispose()


def test_database_time_is_now(database: Database) -> None:
    """The database's clock agrees with this machine's to within seconds, and moves within a transaction."""
    import time

    with database.write() as session:
        first = session.scalar(select(database_time()))
        time.sleep(0.01)
        second = session.scalar(select(database_time()))
    assert first is not None
    assert second is not None
    assert abs(first - time.time()) < 5.0
    assert second > first


def test_writers_queue_up(tmp_path: Path) -> None:
    """Many threads that read and then write one SQLite file never meet `database is locked`."""
    url = f"sqlite:///{tmp_path / 'busy.sqlite3'}"
    upgrade(url)
    database = Database(url)

    def work(number: int) -> None:
        for _ in range(10):
            with database.write() as session:
                session.execute(select(jobs.c.id)).all()
                store.create_job(session, owner=f"o{number}", operation="identify", request={})

    with ThreadPoolExecutor(8) as pool:
        list(pool.map(work, range(8)))
    with database.read() as session:
        assert len(session.execute(select(jobs.c.id)).all()) == 80
    database.dispose()


def test_accepted_rows_are_synced_to_disk(tmp_path: Path) -> None:
    """SQLite runs with WAL, full sync and foreign keys on every connection."""
    database = Database(f"sqlite:///{tmp_path / 'new folder' / 'x.sqlite3'}")
    with database.read() as session:
        answers = {
            name: session.scalar(text(f"PRAGMA {name}"))
            for name in ("journal_mode", "synchronous", "foreign_keys")
        }
    database.dispose()
    assert answers == {"journal_mode": "wal", "synchronous": 2, "foreign_keys": 1}
