"""Laws of `morphid keys` and `morphid audit`, and of the key that commands send to a service."""

from __future__ import annotations

import json
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from app.database import Database
from app.keys.keyring import FRESH_S
from app.settings import Settings
from morphid.commands.keys import moment_of
from morphid.exits import CommandError, Exit
from morphid.main import app
from tests.app.running_service import DEAD_BROKER, running_service

runner = CliRunner()


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A data folder that no environment variable leads away from."""
    for name in ("MORPHID_DATABASE_URL", "MORPHID_API_KEY", "MORPHID_URL", "MORPHID_DATA_DIR"):
        monkeypatch.delenv(name, raising=False)
    return tmp_path


def keys(here: Path, *words: str) -> Result:
    """Run `morphid keys`."""
    return runner.invoke(app, ["keys", *words, "--data-dir", str(here)])


def made(here: Path, *words: str) -> dict[str, Any]:
    """Make a key; what `create --json` prints."""
    result = keys(here, "create", "--owner", "lab", "--name", "a test", "--json", *words)
    assert result.exit_code == Exit.OK, result.output
    document: dict[str, Any] = json.loads(result.stdout)
    return document


def test_a_key_is_shown_once_and_listed_without_its_secret(here: Path) -> None:
    """`create` prints the key alone on standard output; `ls` shows all but the secret."""
    result = keys(here, "create", "--owner", "lab", "--name", "laptop")
    key = result.stdout.strip()
    _, prefix, secret = key.split("_")
    for listed in (keys(here, "ls").output, keys(here, "ls", "--json").output):
        assert prefix in listed
        assert secret not in listed
    assert secret not in (here / "morphid.sqlite3").read_bytes().decode("latin-1")


def test_a_key_has_what_was_asked_for(here: Path) -> None:
    """Scopes, expiry and quotas; without a scope all but `metrics`."""
    document = made(here, "--scope", "jobs:read", "--scope", "metrics", "--expires", "90d", "--max-jobs", "3")
    assert document["scopes"] == ["jobs:read", "metrics"]
    assert document["max_jobs_in_flight"] == 3
    days = datetime.fromisoformat(document["expires_at"]) - datetime.now(UTC)
    assert 89 <= days.days <= 90
    usual = made(here)["scopes"]
    assert "metrics" not in usual
    assert len(usual) == 5


@pytest.mark.parametrize(
    ("words", "reported"),
    [
        (("--scope", "everything"), "no scope"),
        (("--expires", "soon"), "is no time"),
        (("--expires", "2001-01-31"), "has passed"),
        (("--max-jobs", "0"), "max-jobs"),
        (("--owner", "a b"), "the owner"),
        (("--owner", ""), "the owner"),
        (("--name", "a\x1bb"), "the name"),
        (("--name", 65 * "x"), "the name"),
    ],
)
def test_what_makes_no_key_is_a_sentence(here: Path, words: tuple[str, str], reported: str) -> None:
    """Nothing is stored, and the hint is shown."""
    result = keys(here, "create", "--owner", "lab", "--name", "x", *words)
    assert result.exit_code in (Exit.USAGE, Exit.INVALID_INPUT)
    assert reported in result.output
    assert json.loads(keys(here, "ls", "--json").stdout) == []


def test_revoking_is_by_prefix_or_id_and_for_good(here: Path) -> None:
    """A revoked key is listed as such; an unknown one is a sentence."""
    first, second = made(here), made(here)
    assert keys(here, "revoke", first["prefix"]).exit_code == Exit.OK
    assert json.loads(keys(here, "revoke", second["id"], "--json").stdout)["state"] == "revoked"
    listed = json.loads(keys(here, "ls", "--json").stdout)
    assert [key["state"] for key in listed] == ["revoked", "revoked"]
    when = listed[0]["revoked_at"]
    keys(here, "revoke", first["prefix"])
    assert json.loads(keys(here, "ls", "--json").stdout)[0]["revoked_at"] == when
    assert keys(here, "revoke", "nobody").exit_code == Exit.INVALID_INPUT


def test_owners_are_listed_apart_and_deeds_are_noted(here: Path) -> None:
    """`--owner` chooses; the audit log records what the operator did, without secrets."""
    document = made(here)
    keys(here, "create", "--owner", "other", "--name", "x")
    keys(here, "revoke", document["prefix"])
    assert len(json.loads(keys(here, "ls", "--owner", "lab", "--json").stdout)) == 1
    log = runner.invoke(app, ["audit", "ls", "--json", "--owner", "lab", "--data-dir", str(here)])
    assert [entry["action"] for entry in json.loads(log.stdout)] == ["key.revoke", "key.create"]
    assert document["key"].split("_")[2] not in log.stdout
    table = runner.invoke(app, ["audit", "ls", "--data-dir", str(here)])
    assert "key.revoke" in table.stdout


@pytest.mark.parametrize(
    ("text", "moment"),
    [
        ("2099-01-31", datetime(2099, 1, 31, tzinfo=UTC)),
        ("2099-01-31T12:00", datetime(2099, 1, 31, 12, tzinfo=UTC)),
        ("2099-01-31T12:00+02:00", datetime(2099, 1, 31, 10, tzinfo=UTC)),
    ],
)
def test_dates_are_utc_unless_they_say_otherwise(text: str, moment: datetime) -> None:
    """An operator's local time plays no part."""
    assert moment_of(text) == moment.timestamp()


@pytest.mark.parametrize("text", ["", "90", "d", "-3d", "99999999d", "2099-13-01", "0d"])
def test_no_time_is_no_time(text: str) -> None:
    """What cannot be read, or has passed, is refused."""
    with pytest.raises(CommandError):
        moment_of(text)


def test_commands_send_the_key(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By option or variable; without one, or with a revoked one, a sentence says what to do."""
    url = f"sqlite:///{here / 'morphid.sqlite3'}"
    key = made(here)
    with running_service(Settings(database_url=url, broker_url=DEAD_BROKER, auth="keys")) as service:
        listed = ["jobs", "ls", "--json", "--url", service.url]
        refused = runner.invoke(app, listed)
        assert refused.exit_code == Exit.INVALID_INPUT
        assert "API key" in refused.output
        assert runner.invoke(app, [*listed, "--api-key", key["key"]]).exit_code == Exit.OK
        monkeypatch.setenv("MORPHID_API_KEY", f" {key['key']}\n")
        assert json.loads(runner.invoke(app, listed).stdout) == []
        broken = runner.invoke(app, [*listed, "--api-key", "mid_… and more"])
        assert (broken.exit_code, "no key" in broken.output) == (Exit.USAGE, True)
        assert key["key"] not in runner.invoke(app, ["jobs", "ls", "--help"]).output
    assert FRESH_S <= 2.0, "the help of `revoke` and docs/security.md say two seconds"


def test_keys_are_made_without_numbers(here: Path) -> None:
    """The operator's command loads no compiler and no web framework."""
    code = (
        "import sys; from typer.testing import CliRunner; from morphid.main import app; "
        f"r = CliRunner().invoke(app, ['keys', 'ls', '--data-dir', {str(here)!r}]); assert r.exit_code == 0; "
        "print(sorted({'numba', 'fastapi', 'numpy'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
    Database(f"sqlite:///{here / 'morphid.sqlite3'}").dispose()
