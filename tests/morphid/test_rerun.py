"""``morphid jobs rerun``: a request is posted again, unchanged or changed."""

from __future__ import annotations

import json

import pytest
from typer.testing import CliRunner

from morphid.exits import CommandError, Exit
from morphid.main import app
from morphid.request import changed
from tests.app.request_documents import RESULT
from tests.morphid.played_service import Play, PlayedService

RUNNER = CliRunner()
REQUEST = {
    "aircraft": {"name": "a/b"},
    "samples": [{"role": "train"}, {"role": "train"}],
    "search": {"seed": 1},
}


def test_the_request_goes_to_its_operation_again(play: Play) -> None:
    """The new job's id is printed, and nothing else, so that a script can go on with it."""
    service = play(PlayedService("identify", RESULT, request=REQUEST))
    done = RUNNER.invoke(app, ["jobs", "rerun", "job_1", "--url", "http://morphid"])
    assert (done.exit_code, done.stdout) == (Exit.OK, "job_1\n"), done.output
    assert service.body == REQUEST
    assert service.requested == ["GET /jobs/job_1", "GET /jobs/job_1/request", "POST /identify"]


def test_changes_are_made_where_they_point(play: Play) -> None:
    """Numbers, texts, new fields and list items; all the rest stays."""
    service = play(PlayedService("identify", RESULT, request=REQUEST))
    words = [
        "--set",
        "/search/seed=2",
        "--set",
        "/samples/1/role=held_out",
        "--set",
        "/execution/label=again",
    ]
    done = RUNNER.invoke(app, ["jobs", "rerun", "job_1", *words, "--json", "--url", "http://morphid"])
    assert done.exit_code == Exit.OK, done.output
    assert json.loads(done.stdout)["id"] == "job_1"
    assert service.body == {
        **REQUEST,
        "samples": [{"role": "train"}, {"role": "held_out"}],
        "search": {"seed": 2},
        "execution": {"label": "again"},
    }


@pytest.mark.parametrize(("ending", "code"), [("succeeded", Exit.OK), ("failed", Exit.FAILED)])
def test_it_can_be_followed(play: Play, ending: str, code: Exit) -> None:
    """With --watch the exit code is that of the new job's outcome."""
    play(PlayedService("identify", RESULT, ending, request=REQUEST))
    done = RUNNER.invoke(app, ["jobs", "rerun", "job_1", "--watch", "--url", "http://morphid"])
    assert done.exit_code == code, done.output
    assert done.stdout.startswith("job_1\n")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("search/seed=2", "POINTER=VALUE"),
        ("/search/seed", "POINTER=VALUE"),
        ("/samples/7/role=train", "no place /samples/7/role"),
        ("/samples/first/role=train", "no place"),
        ("/search/seed/deeper=1", "no place"),
    ],
)
def test_a_change_that_leads_nowhere_is_a_sentence(change: str, words: str) -> None:
    """Nothing is posted."""
    with pytest.raises(CommandError) as refused:
        changed(REQUEST, [change])
    assert words in refused.value.message
    assert refused.value.hint
