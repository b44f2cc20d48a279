"""``morphid paper``: refusals, Ctrl-C, and the quick form from end to end."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Generator
from pathlib import Path

import pytest
from typer.testing import CliRunner

import morphcore.paper
from morphcore.paper import PaperSettings, Progress, Stage, StageRunner
from morphid.exits import Exit
from morphid.main import app
from tests.paper import made_up

RUNNER = CliRunner()
MAX_QUICK_S = 300.0
TRUTH = Stage("truth", "six flexible flights", lambda *_: iter(()))  # type: ignore[arg-type, return-value]


class PlayedRunner:
    """A runner whose stages are all done, or that Ctrl-C reaches once or twice."""

    def __init__(self, folder: Path, interrupts: int = 0) -> None:
        self.folder = folder
        self.finished = made_up.finished()
        self.closed = False
        self._interrupts = interrupts

    def steps(self) -> Generator[tuple[Stage, Progress]]:
        """Report two steps, with Ctrl-C before the second."""
        try:
            yield TRUTH, Progress(0.5, "0.2 rad/s")
            for _ in range(self._interrupts):
                os.kill(os.getpid(), signal.SIGINT)
            yield TRUTH, Progress(0.6, "0.5 rad/s")
            assert not self._interrupts, "worked on"
        finally:
            self.closed = True  # here the real one keeps its checkpoint


@pytest.fixture
def asked_for(monkeypatch: pytest.MonkeyPatch) -> list[PaperSettings]:
    """Play the stages; return the settings that the command requests."""
    seen: list[PaperSettings] = []

    def play(settings: PaperSettings, folder: Path) -> PlayedRunner:
        seen.append(settings)
        return PlayedRunner(folder)

    monkeypatch.setattr(morphcore.paper, "paper_runner", play)
    return seen


def test_the_choices_reach_the_stages(asked_for: list[PaperSettings], examples: Path, tmp_path: Path) -> None:
    """Seed, form, core and samples are the settings'; the report is written, its summary is JSON."""
    words = ["paper", "--out", str(tmp_path / "out"), "--quick", "--seed", "7", "--core", "smoothed"]
    ended = RUNNER.invoke(app, [*words, "--samples", str(examples), "--json"])
    assert ended.exit_code == Exit.OK, ended.output
    assert asked_for == [PaperSettings(7, quick=True, core="smoothed", samples=examples)]
    summary = json.loads(ended.stdout)
    assert Path(summary["report"]).read_text().startswith("<!DOCTYPE html>")
    assert {each["met"] for each in summary["asked"]} == {True}


def test_the_table_shows_asked_and_measured(
    asked_for: list[PaperSettings], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without ``--json`` people see the figures and where the report is; the examples are found."""
    # its plots take seconds, and the test above has it written
    monkeypatch.setattr(
        morphcore.paper, "write_report", lambda _settings, _finished, out: out / "report.html"
    )
    ended = RUNNER.invoke(app, ["paper", "--out", str(tmp_path)])
    assert ended.exit_code == Exit.OK, ended.output
    assert "met" in ended.stdout
    assert "report.html" in ended.stdout
    assert asked_for[0].samples is not None


@pytest.mark.parametrize("interrupts", [1, 2])
def test_ctrl_c_says_how_to_go_on(interrupts: int, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Exit code 130 and a hint to run the same command again, after one Ctrl-C or a second one."""
    runner = PlayedRunner(tmp_path, interrupts)
    monkeypatch.setattr(morphcore.paper, "paper_runner", lambda *_: runner)
    before = signal.getsignal(signal.SIGINT)
    ended = RUNNER.invoke(app, ["paper", "--out", str(tmp_path)])
    assert ended.exit_code == Exit.INTERRUPTED
    assert "run the same command again to continue" in ended.stderr
    assert runner.closed
    assert signal.getsignal(signal.SIGINT) is before


def test_a_folder_without_samples_is_refused(tmp_path: Path) -> None:
    """Before any work, with a way out."""
    ended = RUNNER.invoke(app, ["paper", "--out", str(tmp_path / "out"), "--samples", str(tmp_path)])
    assert ended.exit_code == Exit.INVALID_INPUT
    assert "aircraft.json" in ended.stderr
    assert not (tmp_path / "out").exists()


def test_a_folder_that_cannot_be_written_is_said(tmp_path: Path) -> None:
    """Where a file stands in the way of the folder, the command says so at once."""
    (tmp_path / "taken").write_text("")
    ended = RUNNER.invoke(app, ["paper", "--quick", "--out", str(tmp_path / "taken")])
    assert ended.exit_code == Exit.ENVIRONMENT
    assert "taken" in ended.stderr


def _started(folder: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "morphid.main", "paper", "--quick", "--out", str(folder), "--json"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "MPLBACKEND": "Agg"},
    )


@pytest.mark.slow
@pytest.mark.timed
def test_the_quick_form_from_end_to_end(tmp_path: Path) -> None:
    """Interrupted once, it goes on and ends within five minutes of work; a third run has nothing to do.

    The page contains all tables and figures and no external references. Of the required figures, those that
    do not depend on the machine's speed are met.
    """
    first = _started(tmp_path)
    while not (tmp_path / "stages" / "truth.json").is_file():
        assert first.poll() is None, first.communicate()
        time.sleep(0.2)
    first.send_signal(signal.SIGINT)
    _, errors = first.communicate(timeout=30)
    assert first.returncode == Exit.INTERRUPTED, errors

    second = _started(tmp_path)
    output, errors = second.communicate(timeout=2 * MAX_QUICK_S)
    assert second.returncode == Exit.OK, errors
    summary = json.loads(output)
    print(f"quick form: {summary['total_s']:.0f} s", {k: round(v) for k, v in summary["stages_s"].items()})
    assert summary["total_s"] < MAX_QUICK_S

    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "http" not in page
    assert re.findall(r"<b>(Table \d+|Figure \d+)\.</b>", page) == [
        "Table 1", *(f"Figure {n}" for n in range(4, 10)), "Table 2", "Table 3", "Figure 10", "Figure 11",
    ]  # fmt: skip
    missed = [each["what"] for each in summary["asked"] if each["met"] is False]
    assert [what for what in missed if not what.startswith(("computation", "the same in a batch"))] == []

    begin = time.monotonic()
    third = _started(tmp_path)
    again, errors = third.communicate(timeout=MAX_QUICK_S)
    assert third.returncode == Exit.OK, errors
    assert json.loads(again) == summary, "nothing was measured again"
    assert time.monotonic() - begin < 30.0


def test_played_stages_are_like_the_real_runner() -> None:
    """What the tests above play is there in the real one."""
    for name in ("steps", "finished", "folder"):
        assert hasattr(PlayedRunner(Path()), name)
        assert hasattr(StageRunner((), Path()), name)
