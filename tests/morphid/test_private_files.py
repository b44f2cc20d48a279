"""Files with secrets are private from their first byte, however careless the requesting process."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Self

import pytest
from typer.testing import CliRunner

from app.database import Database, upgrade
from morphid.backup import backup, restore
from morphid.exits import Exit
from morphid.main import app

OWNER_ONLY = {"file": 0o600, "folder": 0o700}


class Watch:
    """Looks again and again at what appears under a folder, and keeps every mode that it ever had."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.seen: set[tuple[str, str, int]] = set()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_error: object) -> None:
        self._over.set()
        self._thread.join()
        self.look()

    def look(self) -> None:
        """Note what is there now."""
        for folder, _, names in os.walk(self.folder):
            for path in (Path(folder), *(Path(folder) / name for name in names)):
                try:
                    mode = path.stat().st_mode
                except OSError:
                    continue  # gone already
                kind = "folder" if stat.S_ISDIR(mode) else "file"
                self.seen.add((str(path.relative_to(self.folder)), kind, stat.S_IMODE(mode)))

    def names(self) -> set[str]:
        """Names of all that was seen."""
        return {Path(path).name for path, _, _ in self.seen}

    def open_to_others(self, *, but: str = "") -> list[tuple[str, str, str]]:
        """What somebody else could have opened at some moment."""
        return sorted(
            (path, kind, oct(mode))
            for path, kind, mode in self.seen
            if mode & ~OWNER_ONLY[kind] and path != but
        )

    def _run(self) -> None:
        while not self._over.wait(0.001):
            self.look()


@pytest.fixture(autouse=True)
def careless() -> Iterator[None]:
    """A process that leaves everything open to everybody."""
    before = os.umask(0)
    yield
    os.umask(before)


@contextmanager
def written(home: Path) -> Iterator[Database]:
    """A migrated database with its journals open."""
    url = f"sqlite:///{home / 'morphid.sqlite3'}"
    upgrade(url)
    database = Database(url)
    with database.write() as session:
        session.exec_driver_sql("INSERT INTO owners (owner) VALUES ('a')")
    yield database
    database.dispose()


@pytest.mark.parametrize("exists", [False, True], ids=["new", "an open folder"])
def test_the_database_and_its_journals(tmp_path: Path, exists: bool) -> None:  # noqa: FBT001 - of the test
    """File, -wal, -shm and reserve are 0600 from the start, in a new folder and in one that is open."""
    home = tmp_path / "data" / "deeper"
    if exists:
        home.mkdir(parents=True)
    with Watch(tmp_path) as watch, written(home) as database:
        assert database.reserve is not None
        database.reserve.fill()
        watch.look()
    files = {"morphid.sqlite3" + suffix for suffix in ("", "-wal", "-shm", "-reserve")}
    assert files <= watch.names()
    folders = {"data", "data/deeper", "."} if exists else {"."}
    assert [found for found in watch.open_to_others() if found[0] not in folders] == []


def test_what_an_earlier_version_left_open_is_closed(tmp_path: Path) -> None:
    """A database and journals of 0644 are 0600 after the next start."""
    with written(tmp_path) as database:
        for path in tmp_path.iterdir():
            path.chmod(0o644)
        with Database(database.url).read():
            pass
        assert {stat.S_IMODE(path.stat().st_mode) for path in tmp_path.glob("*sqlite3*")} == {0o600}


def test_keys_and_copies(tmp_path: Path) -> None:
    """`keys create` in a new folder, `db backup`, and `db restore` with the file that was there before."""
    home = tmp_path / "data"
    with Watch(tmp_path) as watch:
        words = ["keys", "create", "--owner", "a", "--name", "b", "--data-dir", str(home)]
        assert CliRunner().invoke(app, words).exit_code == Exit.OK
        url = f"sqlite:///{home / 'morphid.sqlite3'}"
        copy = backup(url, tmp_path / "copy.sqlite3").path
        (home / "morphid.sqlite3").chmod(0o644)
        restore(url, copy)
        watch.look()
        restore(f"sqlite:///{tmp_path / 'elsewhere' / 'morphid.sqlite3'}", copy)
    assert {"copy.sqlite3", "copy.sqlite3.part", "morphid.sqlite3.before-restore"} <= watch.names()
    spoilt = ("data/morphid.sqlite3", "file", "0o644")  # by this test
    assert [found for found in watch.open_to_others(but=".") if found != spoilt] == []
    assert stat.S_IMODE((home / "morphid.sqlite3.before-restore").stat().st_mode) == 0o600


def test_a_folder_of_somebody_else_is_left_and_said(tmp_path: Path) -> None:
    """Where other things lie, the folder keeps its mode, and a sentence explains what that means."""
    (tmp_path / "thesis.tex").touch()
    tmp_path.chmod(0o755)
    code = (
        "import sys; from pathlib import Path; from morphid.serve import _own_data_dir\n"
        "with _own_data_dir(Path(sys.argv[1])): pass"
    )
    done = subprocess.run([sys.executable, "-c", code, tmp_path], capture_output=True, text=True, check=True)
    assert "other users may list" in done.stderr
    assert stat.S_IMODE(tmp_path.stat().st_mode) == 0o755
    assert stat.S_IMODE((tmp_path / "serve.lock").stat().st_mode) == 0o600
