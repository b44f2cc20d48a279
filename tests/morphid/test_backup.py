"""Backup and restore of the SQLite job store."""

from __future__ import annotations

import json
import sqlite3
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from sqlalchemy import select
from typer.testing import CliRunner

from app.database import Database
from app.jobs.reaper import reap
from app.jobs.records import JobStatus
from app.jobs.store import claim_job, create_job, get_job, load_checkpoint, save_progress
from app.private_files import make_private_folder
from app.tables import jobs
from morphid import backup as copies
from morphid.backup import backup, restore
from morphid.exits import CommandError, Exit
from morphid.main import app
from tests.servers.stores import migrated_sqlite

READER = """
import sqlite3, sys
link = sqlite3.connect(sys.argv[1])
link.execute("SELECT 1 FROM jobs")
print("open", flush=True)
input()
"""


@pytest.fixture
def url(tmp_path: Path) -> str:
    """A migrated, empty job store."""
    folder = tmp_path / "var"
    make_private_folder(folder)
    return migrated_sqlite(folder / "morphid.sqlite3")


def add(database: Database, number: int) -> str:
    """Write one job with a request of some size."""
    with database.write() as session:
        request = {"number": number, "weight": "x" * 5_000}
        return create_job(session, owner="local", operation="walk", request=request).id


def ids(url: str) -> set[str]:
    """Ids of all jobs."""
    database = Database(url)
    with database.read() as session:
        found = set(session.scalars(select(jobs.c.id)))
    database.dispose()
    return found


def test_a_backup_during_writes_is_whole(url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What was committed before the backup began is in it, each row with its request, while others write."""
    monkeypatch.setattr(copies, "PAGES_AT_ONCE", 5)  # many steps, with writers between them
    database = Database(url)
    before = {add(database, number) for number in range(100)}
    written: list[str] = []
    stop = threading.Event()

    def write_on() -> None:
        while not stop.is_set():
            written.append(add(database, len(written)))

    writer = threading.Thread(target=write_on)
    writer.start()
    try:
        while len(written) < 5:
            stop.wait(0.01)
        made = backup(url, tmp_path / "copy.sqlite3")
    finally:
        stop.set()
        writer.join()
    database.dispose()
    restored = f"sqlite:///{tmp_path / 'elsewhere' / 'morphid.sqlite3'}"
    restore(restored, made.path)
    found = ids(restored)
    assert before <= found
    assert found <= before | set(written)
    assert made.jobs == len(found)
    with sqlite3.connect(tmp_path / "elsewhere" / "morphid.sqlite3") as link:
        requests = link.execute("SELECT count(*) FROM job_requests").fetchone()[0]
    assert requests == len(found)
    assert made.path.stat().st_mode & 0o077 == 0, "nobody else may read it"


def test_running_jobs_go_on_after_a_restore(url: str, tmp_path: Path) -> None:
    """A job that ran at the time of the backup is queued again with its checkpoint once its lease is over."""
    database = Database(url)
    job_id = add(database, 1)
    with database.write() as session:
        claim = claim_job(session, job_id, "worker", lease_s=0.0)
        assert claim is not None
        save_progress(session, claim, {"fraction": 0.5}, b"half")
    made = backup(url, tmp_path / "copy.sqlite3")
    with database.write() as session:
        session.exec_driver_sql("DELETE FROM jobs")
    database.dispose()
    restore(url, made.path)
    database = Database(url)
    with database.write() as session:
        assert reap(session).requeued == (job_id,)
        again = claim_job(session, job_id, "another")
        assert again is not None
        assert load_checkpoint(session, again) == b"half"
        assert get_job(session, "local", job_id).status is JobStatus.RUNNING
    database.dispose()
    assert Path(url.removeprefix("sqlite:///") + ".before-restore").exists()


def test_a_service_does_not_lose_its_file(url: str, tmp_path: Path) -> None:
    """While a process has the database open, nothing is put in its place."""
    made = backup(url, tmp_path / "copy.sqlite3")
    path = url.removeprefix("sqlite:///")
    with subprocess.Popen(
        [sys.executable, "-c", READER, path], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == "open\n"
        with pytest.raises(CommandError) as refused:
            restore(url, made.path)
        other.communicate("\n")
    assert refused.value.code is Exit.ENVIRONMENT
    restore(url, made.path)


@pytest.mark.parametrize("damage", ["text", "cut", "flipped", "newer", "foreign"])
def test_a_spoilt_copy_is_refused(url: str, tmp_path: Path, damage: str) -> None:
    """A copy that is damaged, of a newer version, or not ours, is refused and nothing is changed."""
    database = Database(url)
    kept = {add(database, number) for number in range(20)}
    database.dispose()
    copy = backup(url, tmp_path / "copy.sqlite3").path
    data = copy.read_bytes()
    if damage == "text":
        copy.write_text("no database")
    elif damage == "cut":
        copy.write_bytes(data[: len(data) // 2])
    elif damage == "flipped":
        middle = len(data) // 2
        copy.write_bytes(data[:middle] + bytes(8192) + data[middle + 8192 :])
    else:
        with sqlite3.connect(copy) as link:
            statement = (
                "UPDATE alembic_version SET version_num = '9999'" if damage == "newer" else "DROP TABLE jobs"
            )
            link.execute(statement)
    with pytest.raises(CommandError) as refused:
        restore(url, copy)
    assert refused.value.code is Exit.INVALID_INPUT
    assert ids(url) == kept


def test_nothing_is_overwritten(url: str, tmp_path: Path) -> None:
    """A backup never takes the place of an earlier one; a missing database or folder is a sentence."""
    backup(url, tmp_path / "copy.sqlite3")
    for source, target in (
        (url, tmp_path / "copy.sqlite3"),
        (f"sqlite:///{tmp_path / 'none.sqlite3'}", tmp_path / "other"),
        (url, tmp_path / "no folder" / "copy"),
    ):
        with pytest.raises(CommandError):
            backup(source, target)
    assert not list(tmp_path.glob("*.part"))


def test_postgres_has_its_own_tools(tmp_path: Path) -> None:
    """For Postgres the command names the one to use."""
    url = "postgresql://morphid@db/morphid"
    with pytest.raises(CommandError) as refused:
        backup(url, tmp_path / "copy")
    assert "pg_dump" in refused.value.hint
    with pytest.raises(CommandError) as refused:
        restore(url, tmp_path / "copy")
    assert "pg_restore" in refused.value.hint


def test_the_commands_say_what_was_copied(url: str, tmp_path: Path) -> None:
    """`morphid db backup` and `restore` report the number of jobs in the copy."""
    database = Database(url)
    add(database, 1)
    database.dispose()
    home = Path(url.removeprefix("sqlite:///")).parent
    for command in ("backup", "restore"):
        words = ["db", command, str(tmp_path / "copy"), "--data-dir", str(home), "--json"]
        done = CliRunner().invoke(app, words)
        assert done.exit_code == Exit.OK, done.output
        assert json.loads(done.stdout)["jobs"] == 1
