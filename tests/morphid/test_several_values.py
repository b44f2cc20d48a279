"""Options that take several files, patterns of files, and the version."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from morphid.exits import CommandError, Exit
from morphid.files import matching_files
from morphid.main import app
from morphid.several_values import repeated
from tests.morphid.command_lines import command, sample
from tests.morphid.conftest import Play
from tests.morphid.played_service import PlayedService

RUNNER = CliRunner()
RESULT = {"model": {"links_per_wing": 3, "aero": {}}, "fit": [], "search": {"history": []}}
URL = ("--url", "http://played", "--json", "-")
FLIGHTS = [f"train_rate_{rate}" for rate in ("0.2", "0.5", "0.8")]


def samples_of(played: PlayedService, *words: str) -> list[tuple[str, str]]:
    """Names and roles in a request to a service."""
    ended = RUNNER.invoke(app, command(played.operation, *words, *URL))
    assert ended.exit_code == 0, ended.output
    return [(item["name"], item["role"]) for item in played.body["samples"]]


@pytest.mark.parametrize("operation", ["identify", "study"])
def test_an_option_takes_several_files(operation: str, play: Play) -> None:
    """One option with three files is three options with one; the same of those that are held out."""
    files = [sample(name) for name in FLIGHTS]
    played = play(PlayedService(operation, RESULT))
    once = samples_of(played, "--sample", *files[:2], "--held-out", files[2], "--seed", "1")
    each = samples_of(played, "--sample", files[0], "--held-out", files[2], f"--sample={files[1]}")
    assert once == each == [(FLIGHTS[0], "train"), (FLIGHTS[1], "train"), (FLIGHTS[2], "held_out")]
    turned = samples_of(played, "--held-out", *files[1:], "--sample", files[0])
    assert [role for _, role in turned] == ["train", "held_out", "held_out"]


def test_a_quoted_pattern_is_what_matches_it(play: Play) -> None:
    """A pattern that the shell left alone gives its files by name."""
    played = play(PlayedService("identify", RESULT))
    words = ("--sample", sample("train_rate_0.[25]"), "--held-out", sample("*asym*"))
    assert [name for name, _ in samples_of(played, *words)] == [*FLIGHTS[:2], "train_asymmetric"]


def test_a_pattern_that_matches_nothing_is_refused(tmp_path: Path) -> None:
    """The option and the pattern are named; a file that is called like a pattern is just a file."""
    with pytest.raises(CommandError, match=r"--held-out .*\*\.csv: no file matches") as caught:
        matching_files([tmp_path / "*.csv"], "--held-out")
    assert caught.value.code is Exit.INVALID_INPUT
    odd = tmp_path / "run[1].csv"
    odd.write_text("")
    assert matching_files([odd], "--sample") == [odd]
    (tmp_path / "deep" / "er").mkdir(parents=True)
    (tmp_path / "deep" / "er" / "b.csv").write_text("")
    assert [path.name for path in matching_files([tmp_path / "**" / "*.csv"], "--sample")] == [
        "b.csv",
        odd.name,
    ]


def test_only_repeatable_options_go_on() -> None:
    """Words behind another option stay where they are; nothing is touched behind `--`."""
    words = ["--sample", "a", "b", "--links", "3", "x", "--sample=c", "d", "--", "--sample", "e", "f"]
    assert list(repeated(words, {"--sample"})) == [
        *("--sample", "a", "--sample", "b", "--links", "3", "x", "--sample=c", "--sample", "d"),
        *("--", "--sample", "e", "f"),
    ]


def test_every_option_for_several_files_takes_them_at_once() -> None:
    """No repeatable option of a command without positional arguments has to be repeated."""
    root = typer.main.get_command(app)
    for name, found in root.commands.items():  # type: ignore[attr-defined]
        lists = [p for p in getattr(found, "params", ()) if getattr(p, "multiple", False)]
        if lists:
            assert hasattr(found, "parse_args") and type(found).__name__ == "SeveralValues", name  # noqa: PT018
            assert all(p.param_type_name == "option" for p in found.params), name


def test_the_version_is_the_projects() -> None:
    """`morphid --version`, the library's and the service's: that of pyproject.toml; no compiler is loaded."""
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]
    program = (
        "import sys\nfrom morphid.main import app\n"
        "try:\n    app(['--version'])\n"
        "except SystemExit as end:\n    sys.exit('loaded' if 'numba' in sys.modules else end.code)\n"
    )
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout == f"morphid {project['version']}\n"
    assert re.fullmatch(r"\d+\.\d+\.\d+\S*", project["version"])
