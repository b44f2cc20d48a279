"""What is deleted from an SQLite file goes back to the disk; what must be written fits on a full one."""

from __future__ import annotations

import shutil
import sqlite3
import subprocess
import threading
from collections.abc import Iterator
from contextlib import closing, suppress
from pathlib import Path

import pytest
from sqlalchemy import text
from sqlalchemy.exc import OperationalError

from app import disk_space
from app.database import Database, Session, upgrade
from app.jobs import store
from app.jobs.repository import delete_job
from app.reserve import SLICE_BYTES, Reserve
from app.settings import Settings
from app.tables import jobs
from tests.app.calls import post
from tests.app.jobs.test_retention import count
from tests.app.jobs.test_store import OWNER, RESULT, claimed, new_job
from tests.app.jobs.test_upkeep import Messages, upkeep
from tests.app.request_documents import simulate_document
from tests.app.running_service import DEAD_BROKER, RunningService, running_service
from tests.waiting import until

JOBS = 20
FILE_BYTES = 500_000
WITHIN_S = 60.0
DISK = "64m"
BLOCKS = (2**20, 4096)


@pytest.fixture
def url(tmp_path: Path) -> str:
    """Address of an SQLite file that is not there yet."""
    return f"sqlite:///{tmp_path / 'store.sqlite3'}"


def fill(database: Database) -> list[str]:
    """Let many jobs end that leave large files; give their ids."""
    ids = []
    for _ in range(JOBS):
        job = new_job(database)
        claim = claimed(database, job.id)
        with database.write() as session:
            store.finish_job(
                session, claim, "succeeded", result=RESULT, artifacts={"a.bin": b"x" * FILE_BYTES}
            )
        ids.append(job.id)
    return ids


def forget(database: Database, ids: list[str]) -> None:
    """Delete jobs."""
    for job_id in ids:
        with database.write() as session:
            delete_job(session, OWNER, job_id)


def size_of(database: Database) -> int:
    """Bytes of the file."""
    return Path(str(database.engine.url.database)).stat().st_size


def test_deleted_jobs_give_their_room_back(url: str) -> None:
    """The upkeep of a service shortens the file after ten megabytes were deleted; what is left is sound."""
    upgrade(url)
    database = Database(url)
    ids = fill(database)
    full = size_of(database)
    forget(database, ids[1:])
    with upkeep(database, Messages()):
        until(lambda: size_of(database) < full - 0.7 * JOBS * FILE_BYTES, WITHIN_S)
    with database.read() as session:
        assert session.scalar(text("PRAGMA integrity_check")) == "ok"
    assert count(database, jobs) == 1
    database.dispose()


def test_room_is_given_back_in_short_transactions(url: str) -> None:
    """Each moves so many pages at most, and other writers come between."""
    upgrade(url)
    database = Database(url)
    forget(database, fill(database))

    def free() -> int:
        with database.read() as session:
            return int(session.scalar(text("PRAGMA freelist_count")) or 0)

    before, moved = free(), []
    while disk_space.give_back(database):
        moved.append(before - free())
        before = free()
        new_job(database)
    assert len(moved) > 2
    assert 0 < max(moved) <= disk_space.SLICE_PAGES
    assert free() <= disk_space.KEPT_PAGES
    database.dispose()


def test_a_file_of_an_earlier_version_learns_it_at_the_next_start(url: str, tmp_path: Path) -> None:
    """It is rewritten once; its rows stay, and from then on it shrinks."""
    upgrade(url)
    database = Database(url)
    ids = fill(database)
    database.dispose()
    with closing(sqlite3.connect(tmp_path / "store.sqlite3")) as link:
        link.execute("PRAGMA journal_mode = DELETE")
        link.execute("PRAGMA auto_vacuum = NONE")
        link.execute("VACUUM")
        assert link.execute("PRAGMA auto_vacuum").fetchone() == (0,)
    upgrade(url)
    database = Database(url)
    with database.read() as session:
        assert session.scalar(text("PRAGMA auto_vacuum")) == disk_space.INCREMENTAL
    assert count(database, jobs) == JOBS
    full = size_of(database)
    forget(database, ids)
    with upkeep(database, Messages()):
        until(lambda: size_of(database) < full - 0.7 * JOBS * FILE_BYTES, WITHIN_S)
    database.dispose()


def test_a_file_in_use_waits_for_the_next_start(url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Somebody else's transaction only puts it off: the start goes on."""
    monkeypatch.setattr("app.database.BUSY_TIMEOUT_MS", 50)
    upgrade(url)
    database = Database(url)
    connection = database.engine.raw_connection()
    connection.cursor().execute("PRAGMA auto_vacuum = NONE")
    connection.cursor().execute("VACUUM")
    connection.close()
    with database.write() as session:
        session.execute(text("DELETE FROM owners"))
        upgrade(url)
    upgrade(url)
    database.dispose()
    fresh = Database(url)
    with fresh.read() as session:
        assert session.scalar(text("PRAGMA auto_vacuum")) == disk_space.INCREMENTAL
    fresh.dispose()


def test_a_reserve_is_really_there_and_lends_slice_by_slice(tmp_path: Path) -> None:
    """It has blocks on the disk, not a hole; what it lends it takes back."""
    reserve = Reserve(tmp_path / "x.sqlite3", 3 * SLICE_BYTES)
    assert not reserve.lend(), "nothing was filled"
    reserve.fill()
    found = reserve.path.stat()
    assert (found.st_size, found.st_mode & 0o777) == (3 * SLICE_BYTES, 0o600)
    assert found.st_blocks * 512 >= found.st_size
    assert reserve.lend()
    assert reserve.path.stat().st_size == 2 * SLICE_BYTES
    reserve.take_back()
    assert reserve.path.stat().st_size == 3 * SLICE_BYTES
    assert [reserve.lend() for _ in range(4)] == [True, True, True, False]


def test_without_a_reserve_the_first_error_is_reported(url: str) -> None:
    """A write that does not fit where nothing is lent leaves no trace."""
    upgrade(url)
    database = Database(url)

    def never_fits(session: Session) -> None:
        session.execute(text("INSERT INTO owners (owner) VALUES ('a')"))
        session.execute(text("PRAGMA max_page_count = 1"))
        session.execute(text("INSERT INTO counters VALUES ('x', zeroblob(1000000))"))

    with pytest.raises(OperationalError, match="full"):
        database.write_even_if_full(never_fits)
    with database.read() as session:
        assert session.scalar(text("SELECT count(*) FROM owners")) == 0
    database.dispose()


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of some megabytes, where this machine lets us make one."""
    folder = tmp_path / "small"
    folder.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", f"size={DISK}", "tmpfs", folder], capture_output=True, check=False
    )
    if mounted.returncode != 0:
        pytest.skip("needs the right to mount a file system")
    yield folder
    subprocess.run(["umount", "--lazy", folder], check=True)


def take_every_byte(folder: Path) -> None:
    """Fill the disk to its last block."""
    with (folder / "filler").open("ab", buffering=0) as filler:
        for block in BLOCKS:
            with suppress(OSError):
                while filler.write(bytes(block)) == block:
                    pass


def until_full(service: RunningService, folder: Path) -> None:
    """Take all room until a post is refused for want of it."""
    for _ in range(100):
        take_every_byte(folder)
        answer = post(service, "/simulate", simulate_document())
        if answer.status_code == 503:
            assert answer.json()["code"] == "storage_full"
            return
    raise AssertionError("the disk does not become full")


def test_on_a_full_disk_everything_can_be_cancelled_and_deleted(small_disk: Path) -> None:
    """Dozens of jobs, queued and running, while others try to take each byte that becomes free."""
    settings = Settings(database_url=f"sqlite:///{small_disk / 'store.sqlite3'}", broker_url=DEAD_BROKER)
    with running_service(settings) as service:
        ids = [post(service, "/simulate", simulate_document()).json()["id"] for _ in range(30)]
        claims = {job_id: service.claim(job_id) for job_id in ids[20:]}
        over = threading.Event()

        def take_on() -> None:
            while not over.wait(0.02):
                take_every_byte(small_disk)

        until_full(service, small_disk)
        taker = threading.Thread(target=take_on)
        taker.start()
        try:
            answers = [service.client.post(f"/jobs/{job_id}/cancel") for job_id in ids]
            assert [answer.status_code for answer in answers] == [200] * 30, answers[-1].text
            assert [answer.json()["status"] for answer in answers] == ["cancelled"] * 20 + ["cancelling"] * 10
            for claim in claims.values():
                ended = service.database.write_even_if_full(
                    lambda session, claim=claim: store.finish_job(session, claim, "cancelled")
                )
                assert ended
            assert shutil.disk_usage(small_disk).free < SLICE_BYTES, "it is still full"
            gone = [service.client.delete(f"/jobs/{job_id}").status_code for job_id in ids]
            assert gone == [204] * 30
        finally:
            over.set()
            taker.join()
