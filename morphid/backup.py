"""Backups of the database: made while the service runs, restored while it is stopped."""

from __future__ import annotations

import contextlib
import fcntl
import os
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

from app.private_files import close_to_others, make_private_folder, open_private, touch_private
from morphid.exits import CommandError, Exit

PAGES_AT_ONCE = 1000  # 4 MB between pauses for waiting writers
BUSY_S = 30.0
LOCK_NAME = "serve.lock"  # of `morphid serve`


@dataclass(frozen=True, slots=True)
class Backup:
    """A backup made or restored: its path, its number of jobs, the revision of its tables."""

    path: Path
    size_bytes: int
    jobs: int
    revision: str


def backup(url: str, target: Path) -> Backup:
    """Copy a consistent snapshot of an SQLite database while others keep writing to it.

    The copy appears under its name only when it is complete, checked and on disk.
    """
    source = _file_of(url, 'pg_dump --format=custom --file backup.dump "$MORPHID_DATABASE_URL"')
    if not source.exists():
        raise CommandError(
            f"there is no database {source}", code=Exit.INVALID_INPUT, hint="see MORPHID_DATA_DIR"
        )
    if target.exists():
        raise CommandError(
            f"{target} exists", code=Exit.INVALID_INPUT, hint="choose another name, or remove it"
        )
    growing = target.with_name(target.name + ".part")
    with _reports_system_errors(target):
        growing.unlink(missing_ok=True)
        touch_private(growing)  # it contains webhook secrets and the samples of all users
        try:
            with (
                closing(sqlite3.connect(source, timeout=BUSY_S)) as live,
                closing(sqlite3.connect(growing)) as copy,
            ):
                # one read transaction: otherwise SQLite restarts when a writer changes a page between two
                # steps
                live.execute("BEGIN")
                live.execute("SELECT count(*) FROM sqlite_master").fetchone()  # starts the read transaction
                live.backup(copy, pages=PAGES_AT_ONCE)
                copy.execute("PRAGMA journal_mode = DELETE")  # one file, without a journal next to it
            made = inspected(growing)
            _to_disk(growing)
            growing.rename(target)
            _to_disk(target.parent)
        finally:
            growing.unlink(missing_ok=True)
    return Backup(target, target.stat().st_size, made.jobs, made.revision)


def restore(url: str, source: Path) -> Backup:
    """Replace an SQLite database by a copy; the old one is kept as ``....before-restore``."""
    target = _file_of(url, 'pg_restore --clean --if-exists --dbname "$MORPHID_DATABASE_URL" backup.dump')
    if not source.is_file():
        raise CommandError(f"there is no file {source}", code=Exit.INVALID_INPUT)
    with _reports_system_errors(source):
        found = inspected(source)
    make_private_folder(target.parent)
    growing = target.with_name(target.name + ".part")
    with _nobody_serves(target), _reports_system_errors(target):
        growing.unlink(missing_ok=True)
        touch_private(growing)
        with closing(sqlite3.connect(source)) as copy, closing(sqlite3.connect(growing)) as new:
            copy.backup(new)
        _to_disk(growing)
        if target.exists():
            close_to_others(target)  # before it is opened, because its journals get its mode
            _fold_journal(target)
            target.replace(target.with_name(target.name + ".before-restore"))
        for suffix in ("-wal", "-shm"):  # journals of the former file, which would corrupt the new one
            target.with_name(target.name + suffix).unlink(missing_ok=True)
        growing.rename(target)
        _to_disk(target.parent)
    return Backup(target, target.stat().st_size, found.jobs, found.revision)


def inspected(file: Path) -> Backup:
    """Inspect a database file; refuse one that is damaged, not MorphID's, or of a newer version."""
    from migrations import HEAD

    try:
        with closing(sqlite3.connect(f"{file.absolute().as_uri()}?mode=ro", uri=True)) as link:
            faults = [row[0] for row in link.execute("PRAGMA integrity_check(3)")]
            if faults != ["ok"]:
                raise CommandError(
                    f"{file} is damaged: {faults[0]}", code=Exit.INVALID_INPUT, hint="use another backup"
                )
            revision = str(link.execute("SELECT version_num FROM alembic_version").fetchone()[0])
            jobs = int(link.execute("SELECT count(*) FROM jobs").fetchone()[0])
    except (sqlite3.DatabaseError, TypeError) as error:
        raise CommandError(
            f"{file} is not a MorphID database: {error}", code=Exit.INVALID_INPUT, hint="use another backup"
        ) from None
    if revision > HEAD:
        raise CommandError(
            f"{file} has revision {revision}, this version knows {HEAD}",
            code=Exit.INVALID_INPUT,
            hint="restore it with the version of MorphID that made it, or a newer one",
        )
    return Backup(file, file.stat().st_size, jobs, revision)


def _file_of(url: str, instead: str) -> Path:
    from sqlalchemy import make_url

    parsed = make_url(url)
    if parsed.get_backend_name() != "sqlite" or not parsed.database:
        raise CommandError(
            f"the database is {parsed.get_backend_name()}, which has its own tools for this",
            code=Exit.USAGE,
            hint=instead,
        )
    return Path(parsed.database)


def _fold_journal(file: Path) -> None:
    """Move the write-ahead journal into the file, so that the file is complete on its own."""
    with contextlib.suppress(sqlite3.DatabaseError), closing(sqlite3.connect(file, timeout=1.0)) as link:
        link.execute("PRAGMA wal_checkpoint(TRUNCATE)")  # a damaged file is kept as it is


@contextmanager
def _nobody_serves(target: Path) -> Iterator[None]:
    """Lock the data directory as `morphid serve` does, and check that no other process has the file open."""
    busy = CommandError(
        f"a service uses {target}",
        code=Exit.ENVIRONMENT,
        hint="stop it first: a running service must not lose its file",
    )
    with open_private(target.parent / LOCK_NAME, "a") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise busy from None
        if target.exists() and _others_have_open(target):
            raise busy
        yield


def _others_have_open(file: Path) -> bool:
    """Whether another process has the file open (Linux; elsewhere only the lock is checked)."""
    wanted = file.stat()
    for link in Path("/proc").glob("[0-9]*/fd/*"):
        with contextlib.suppress(OSError):
            if link.parent.parent.name != str(os.getpid()) and os.path.samestat(link.stat(), wanted):
                return True
    return False


def _to_disk(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


@contextmanager
def _reports_system_errors(path: Path) -> Iterator[None]:
    try:
        yield
    except (OSError, sqlite3.OperationalError) as error:
        raise CommandError(
            f"{path}: {error}", code=Exit.ENVIRONMENT, hint="check free space and permissions"
        ) from None
