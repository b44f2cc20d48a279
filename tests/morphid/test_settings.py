"""One law for every command: an option, then its variable, then the default."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from typer.core import TyperGroup
from typer.main import get_command
from typer.testing import CliRunner

from app.database import Database, upgrade
from app.database_address import sqlite_url
from app.http import server
from app.settings import PREFIX, Settings, UnsafeSettings, load_settings
from morphid import serve as serving
from morphid.configured import settings_for
from morphid.connections import KEY_VARIABLE, URL_VARIABLE
from morphid.exits import Exit
from morphid.main import app

RUNNER = CliRunner()
ROOT = Path(__file__).resolve().parents[2]
OF_CLIENTS = {"url": URL_VARIABLE, "api_key": KEY_VARIABLE}
# what a process hands to its own children is no setting
BETWEEN_PROCESSES = {"worker/shutdown.py"}


def commands(group: Any, words: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Give every command with the words that call it."""
    for name, command in group.commands.items():
        if isinstance(command, TyperGroup):
            yield from commands(command, (*words, name))
        else:
            yield (*words, name), command


COMMANDS = dict(commands(get_command(app)))
SETTING_OPTIONS = [
    (words, option)
    for words, command in COMMANDS.items()
    for option in command.params
    if option.name in Settings.model_fields
]
ON_A_DATABASE = [
    words for words in COMMANDS if any(option.name == "data_dir" for option in COMMANDS[words].params)
]


@pytest.fixture(autouse=True)
def no_variables(monkeypatch: pytest.MonkeyPatch) -> None:
    """Take away what the test machine sets."""
    for name in (*Settings.model_fields, *OF_CLIENTS):
        monkeypatch.delenv(PREFIX + name.upper(), raising=False)


def test_options_that_are_settings_leave_the_rest_to_them() -> None:
    """They have no default of their own, and their help names the variable and the settings' own default."""
    assert len(SETTING_OPTIONS) >= 14
    for words, option in SETTING_OPTIONS:
        default = Settings.model_fields[option.name].default
        assert option.default is None, words
        assert option.show_default == f"{PREFIX}{option.name.upper()}, else {default}", words


def test_options_that_lead_to_a_service_obey_their_variables() -> None:
    """In every command, `--url` comes before MORPHID_URL and `--api-key` before MORPHID_API_KEY."""
    found = set()
    for words, command in COMMANDS.items():
        for option in command.params:
            if option.name in OF_CLIENTS:
                assert option.envvar == OF_CLIENTS[option.name], words
                found.add(words)
    assert {("identify",), ("study",), ("simulate",), ("optimize",), ("doctor",), ("jobs", "ls")} <= found


def test_nothing_but_the_settings_reads_the_settings_variables() -> None:
    """No second reader in the service, the worker or the command could take another default."""
    own = re.compile(rf"(os\.environ|getenv)[^\n]*{PREFIX}")
    readers = {
        str(path.relative_to(ROOT))
        for package in ("app", "morphid", "worker", "migrations")
        for path in (ROOT / package).rglob("*.py")
        if own.search(path.read_text("utf-8"))
    }
    assert readers <= BETWEEN_PROCESSES


@pytest.mark.parametrize("name", ["data_dir", "host", "port", "workers"])
def test_serve_takes_option_then_variable_then_default(
    name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Each of the service's own options."""
    option, variable = {
        "data_dir": (str(tmp_path / "a"), str(tmp_path / "b")),
        "host": ("127.0.0.2", "127.0.0.3"),
        "port": ("8101", "8102"),
        "workers": ("3", "4"),
    }[name]
    seen: list[Settings] = []
    monkeypatch.setattr(serving, "serve", lambda settings, **_: seen.append(settings))
    monkeypatch.chdir(tmp_path)
    given = ["serve", f"--{name.replace('_', '-')}", option]
    for words, environment in ((given, {f"{PREFIX}{name.upper()}": variable}), (given, {})):
        assert RUNNER.invoke(app, words, env=environment).exit_code == Exit.OK
        assert str(getattr(seen.pop(), name)) == option
    RUNNER.invoke(app, ["serve"], env={f"{PREFIX}{name.upper()}": variable})
    assert str(getattr(seen.pop(), name)) == variable
    RUNNER.invoke(app, ["serve"])
    default = load_settings()
    assert getattr(seen.pop(), name) == getattr(default, name)


def test_options_of_serve_reach_its_children(tmp_path: Path) -> None:
    """The API, the worker and the beat read variables: they get the ones that the options came to."""
    settings = settings_for(data_dir=tmp_path / "x", host="127.0.0.5", workers=7)
    reported = serving._environment(settings, 8123)
    for name, value in load_settings(**{k: getattr(settings, k) for k in ("data_dir", "host", "workers")}):
        variable = reported.get(PREFIX + name.upper())
        assert variable is None or variable == str(8123 if name == "port" else value)
    assert reported["MORPHID_DATABASE_URL"] == sqlite_url(tmp_path / "x" / "morphid.sqlite3")


@pytest.mark.parametrize("words", ON_A_DATABASE, ids=" ".join)
def test_every_command_opens_the_same_database(
    words: tuple[str, ...], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """With MORPHID_DATA_DIR, with `--data-dir`, and where both are given the option's."""
    opened: list[Path] = []

    def looked(**given: object) -> Settings:
        opened.append(load_settings(**given).data_dir)
        raise UnsafeSettings("seen enough")

    monkeypatch.setattr("app.settings.load_settings", looked)
    needed = {("keys", "create"): ["--owner", "a", "--name", "b"], ("keys", "revoke"): ["abc"]}
    needed |= {("db", "downgrade"): ["base"], ("db", "backup"): ["copy"], ("db", "restore"): ["copy"]}
    line = [*words, *needed.get(words, [])]
    here, there = tmp_path / "here", tmp_path / "there"
    monkeypatch.setattr("morphid.doctor.round.examined", lambda _checks: iter(()))
    for extra, environment, expected in (
        ([], {"MORPHID_DATA_DIR": str(here)}, here),
        (["--data-dir", str(there)], {"MORPHID_DATA_DIR": str(here)}, there),
        (["--data-dir", str(there)], {}, there),
    ):
        opened.clear()
        ended = RUNNER.invoke(app, [*line, *extra], env=environment)
        assert ended.exit_code in {Exit.USAGE, Exit.ENVIRONMENT}, ended.output
        assert opened == [expected]


def test_keys_land_in_the_service_s_own_database(tmp_path: Path) -> None:
    """What `serve` would open with MORPHID_DATA_DIR is what `keys create` wrote into."""
    environment = {"MORPHID_DATA_DIR": str(tmp_path)}
    made = RUNNER.invoke(app, ["keys", "create", "--owner", "a", "--name", "b"], env=environment)
    assert made.exit_code == Exit.OK, made.output
    assert (tmp_path / "morphid.sqlite3").exists()


def test_the_server_by_itself_obeys_its_options(monkeypatch: pytest.MonkeyPatch) -> None:
    """`python -m app.http.server --host 0.0.0.0` demands keys as MORPHID_HOST=0.0.0.0 does."""
    seen: list[Settings] = []

    def configured(application: Any, settings: Settings, **_: object) -> None:
        seen.extend((settings, application.args[0]))
        raise SystemExit

    monkeypatch.setattr(server, "GuardedConfig", configured)
    monkeypatch.setenv("MORPHID_PORT", "8102")
    with pytest.raises(SystemExit):
        server.main(["--host", "0.0.0.0"])  # noqa: S104 - what it is about
    assert seen[0] is seen[1]
    assert (seen[0].host, seen[0].port, seen[0].demands_keys) == ("0.0.0.0", 8102, True)  # noqa: S104


def test_refused_settings_end_each_process_with_a_sentence(tmp_path: Path) -> None:
    """The API process, the worker and every command: no traceback."""
    import os
    import subprocess
    import sys

    environment = {**os.environ, "MORPHID_PORT": "eighty", "MORPHID_DATA_DIR": str(tmp_path)}
    for module in (
        ("app.http.server",),
        ("celery", "--quiet", "--app", "worker.celery_app:app", "worker"),
        ("morphid.main", "serve"),
    ):
        ended = subprocess.run(
            [sys.executable, "-m", *module],
            env=environment,
            cwd=ROOT,
            capture_output=True,
            text=True,
            check=False,
        )
        assert ended.returncode != 0
        assert "MORPHID_PORT" in ended.stderr
        assert "Traceback" not in ended.stderr, ended.stderr


def test_a_misspelt_variable_is_asked_after(tmp_path: Path) -> None:
    """One that is nearly called like a setting; others' variables are not our business."""
    environment = {"MORPHID_DATADIR": "x", "MORPHID_DATA_DIR": str(tmp_path), "MORPHID_TEST_SEED": "1"}
    ended = RUNNER.invoke(app, ["keys", "ls"], env=environment)
    assert ended.exit_code == Exit.OK
    assert "MORPHID_DATADIR is no setting; is MORPHID_DATA_DIR meant?" in ended.stderr
    assert ended.stderr.count("warning") == 1


def test_an_empty_variable_is_none(tmp_path: Path) -> None:
    """Compose files and shells hand on empty variables for what nobody set."""
    environment = dict.fromkeys(("MORPHID_PORT", "MORPHID_DATABASE_URL", "MORPHID_BROKER_URL"), "")
    seen: list[Settings] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(serving, "serve", lambda settings, **_: seen.append(settings))
        RUNNER.invoke(app, ["serve", "--data-dir", str(tmp_path)], env=environment)
    assert (seen[0].port, seen[0].names_broker) == (8000, False)


def test_the_url_of_the_environment_gives_way_to_a_data_directory(tmp_path: Path) -> None:
    """`doctor --data-dir` looks here though MORPHID_URL leads elsewhere; both as options contradict."""
    upgrade(sqlite_url(tmp_path / "morphid.sqlite3"))
    words = ["doctor", "--data-dir", str(tmp_path), "--url", "http://127.0.0.1:1"]
    assert RUNNER.invoke(app, words).exit_code == Exit.USAGE
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("morphid.doctor.round.examined", lambda _checks: iter(()))
        ended = RUNNER.invoke(app, words[:3], env={URL_VARIABLE: "http://127.0.0.1:1"})
    assert "does not answer" not in ended.output
    Database(sqlite_url(tmp_path / "morphid.sqlite3")).dispose()
