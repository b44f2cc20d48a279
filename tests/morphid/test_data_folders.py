"""Data folders of any name: database, queue, logs, copies and keys are created where requested."""

from __future__ import annotations

import json
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from typer.testing import CliRunner

from morphid.broker import prepare_broker
from morphid.exits import Exit
from morphid.main import app
from morphid.supervisor import Supervisor
from tests.folder_names import ALL_NESTED, FOLDER_NAMES

RUNNER = CliRunner()


def run(*words: str | Path) -> str:
    """Run a command that must succeed."""
    ended = RUNNER.invoke(app, [str(word) for word in words])
    assert ended.exit_code == Exit.OK, ended.output
    return ended.stdout


@pytest.fixture(autouse=True)
def no_variables(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing leads elsewhere."""
    for name in ("MORPHID_DATABASE_URL", "MORPHID_DATA_DIR"):
        monkeypatch.delenv(name, raising=False)


def test_keys_copies_and_the_doctor_agree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Made, copied, put back and examined in one folder; also when its name is relative."""
    monkeypatch.chdir(tmp_path)
    home = tmp_path / ALL_NESTED
    for data_dir in (home, Path("..") / tmp_path.name / ALL_NESTED):
        run("keys", "create", "--owner", "lab", "--name", "x", "--data-dir", data_dir)
    file = home / "morphid.sqlite3"
    with closing(sqlite3.connect(file)) as link:
        assert link.execute("SELECT count(*) FROM api_keys").fetchone() == (2,)
    copy = home / "copy.sqlite3"
    run("db", "backup", copy, "--data-dir", home)
    run("keys", "create", "--owner", "lab", "--name", "x", "--data-dir", home)
    run("db", "restore", copy, "--data-dir", home)
    assert len(json.loads(run("keys", "ls", "--json", "--data-dir", home))) == 2
    monkeypatch.setattr("morphid.doctor.machine.COMPILE", """print('{"numba": "0", "cache": "/tmp"}')""")
    reported = json.loads(RUNNER.invoke(app, ["doctor", "--json", "--data-dir", str(home)]).stdout)[
        "findings"
    ]
    states = {each["name"]: (each["state"], each["message"]) for each in reported}
    assert states["data directory"] == ("ok", str(home))
    assert states["database"][0] == "ok"
    assert states["integrity"][0] == "ok"
    assert {each.name for each in tmp_path.iterdir()} == {FOLDER_NAMES[0]}


def test_the_broker_keeps_its_journal_there(tmp_path: Path) -> None:
    """Its configuration is text with quotes of its own."""
    home = tmp_path / ALL_NESTED
    supervisor = Supervisor(tmp_path / "logs", report=lambda _sentence: None)
    broker = prepare_broker(home)
    child = supervisor.start(broker.spec)
    try:
        assert supervisor.wait_until(child, broker.answers, 20.0), child.last_words()
        assert (home / "broker" / "appendonlydir").is_dir()
    finally:
        supervisor.stop()
