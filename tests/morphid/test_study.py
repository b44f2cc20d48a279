"""``morphid study``: in this process, at a played service, and at the live one."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from morphid.exits import Exit
from morphid.main import app
from tests.live import LiveService
from tests.morphid.command_lines import COARSE, command, sample
from tests.morphid.played_service import Play, PlayedService

RUNNER = CliRunner()
SAMPLES = ("--sample", sample("train_rate_0.8"), "--held-out", sample("train_rate_0.5"))
QUICK = ("--method", "pso", "--particles", "8", "--generations", "1", "--seed", "2", *COARSE)


def accuracy(result: dict[str, Any]) -> list[tuple[Any, ...]]:
    """Give what does not depend on the clock."""
    return [
        (row["links_per_wing"], row["J_train"], row["J_held_out"], row["model"]) for row in result["rows"]
    ]


def test_a_study_ends_in_a_table_and_a_recommendation(tmp_path: Path) -> None:
    """Each number of links has its row, fitted and predicted; one is recommended, and why."""
    words = (*SAMPLES, *QUICK, "--links", "1,2", "--json", tmp_path / "s.json", "--plots", tmp_path / "plots")
    ended = RUNNER.invoke(app, command("study", *words))
    assert ended.exit_code == Exit.OK, ended.output
    result = json.loads((tmp_path / "s.json").read_text())
    assert [row["links_per_wing"] for row in result["rows"]] == [1, 2]
    assert all(row["J_held_out"] > 0.0 for row in result["rows"])
    assert f"* {result['recommended']['links_per_wing']}" in ended.stdout
    assert "Recommended: " in ended.stdout
    assert (tmp_path / "plots" / "study.csv").is_file()
    assert "Verdict by number of links: 1: " in ended.stdout


def test_the_choices_reach_the_service(play: Play) -> None:
    """Samples, numbers of links, lattice and search of the command line stand in the request."""
    result = {"rows": [], "recommended": {"links_per_wing": None, "reason": "No model flew."}}
    played = play(PlayedService("study", result))
    words = (*SAMPLES, "--links", "3,1", "--core", "smoothed", "--seed", "4", "--max-seconds", "9")
    ended = RUNNER.invoke(app, command("study", *words, "--url", "http://there"))
    assert ended.exit_code == Exit.OK, ended.output
    assert [(each["name"], each["role"]) for each in played.body["samples"]] == [
        ("train_rate_0.8", "train"),
        ("train_rate_0.5", "held_out"),
    ]
    assert played.body["model"] == {"links_per_wing": [3, 1], "lattice": {"core": {"law": "smoothed"}}}
    assert played.body["search"] == {"seed": 4, "max_seconds": 9.0}
    assert "No model flew." in ended.stdout


def test_numbers_by_surface_are_listed_too(play: Play) -> None:
    """Between others, with a plus between the surfaces."""
    result = {"rows": [], "recommended": {"links_per_wing": None, "reason": "No model flew."}}
    played = play(PlayedService("study", result))
    words = (*SAMPLES, "--links", "1,wing=3,wing=4", "--url", "http://played")
    ended = RUNNER.invoke(app, command("study", *words))
    assert ended.exit_code == Exit.OK, ended.output
    assert played.body["model"] == {"links_per_wing": [1, {"wing": 3}, {"wing": 4}]}


@pytest.mark.parametrize(
    ("links", "code", "reported"),
    [
        ("1,two", Exit.USAGE, "write --links 1,2,3"),
        ("1,1", Exit.INVALID_INPUT, "given by --links 1,1"),
        ("1,99", Exit.INVALID_INPUT, "given by --links 1,99"),
        ("1,wing=", Exit.USAGE, "NAME=N"),
        ("1,wing=2+fin=1", Exit.INVALID_INPUT, "each flexible surface: wing"),
    ],
)
def test_wrong_numbers_of_links_are_named(links: str, code: Exit, reported: str) -> None:
    """What is wrong with ``--links`` is said so."""
    ended = RUNNER.invoke(app, command("study", *SAMPLES, "--links", links))
    assert ended.exit_code == code, ended.output
    assert reported in ended.stderr


@pytest.mark.timeout(600)
def test_the_service_studies_the_same(live_service: LiveService, tmp_path: Path) -> None:
    """The same command in this process and at the service gives the same rows: same seed, same answer."""
    found = {}
    for name, more in (("here", ()), ("there", ("--url", live_service.url))):
        out = tmp_path / f"{name}.json"
        ended = RUNNER.invoke(app, command("study", *SAMPLES, *QUICK, "--links", "1,2", *more, "--json", out))
        assert ended.exit_code == Exit.OK, ended.output
        found[name] = json.loads(out.read_text())
    assert accuracy(found["here"]) == accuracy(found["there"])
