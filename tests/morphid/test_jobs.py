"""``morphid jobs`` against the live service."""

from __future__ import annotations

import json

from typer.testing import CliRunner

from morphid.exits import Exit
from morphid.main import app
from tests.live import LiveService

RUNNER = CliRunner()


def test_an_unknown_job_is_a_sentence(live_service: LiveService) -> None:
    """A job that is not there ends with the service's own sentence and exit code 3."""
    for command in ("show", "watch", "cancel"):
        ended = RUNNER.invoke(app, ["jobs", command, "job_nothing", "--url", live_service.url])
        assert ended.exit_code == Exit.INVALID_INPUT, ended.output
        assert "job_nothing" in ended.stderr


def test_the_list_is_json_for_machines(live_service: LiveService) -> None:
    """``jobs ls --json`` prints a JSON list; the address may come from the environment."""
    ended = RUNNER.invoke(app, ["jobs", "ls", "--json"], env={"MORPHID_URL": live_service.url})
    assert ended.exit_code == Exit.OK, ended.output
    assert isinstance(json.loads(ended.stdout), list)
