"""What every operation shares: Ctrl-C, errors that name the option, exit codes."""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, ClassVar

import pytest
from typer.testing import CliRunner

from morphdata.faults import Interrupted, InvalidInput
from morphid.exits import Exit
from morphid.main import app
from morphid.request import Request
from worker.operations import Outcome, Step, Stop

RUNNER = CliRunner()
Document = dict[str, Any]
MODEL = {
    "links_per_wing": 1,
    "division": [1.0],
    "stiffness_nm_rad": [],
    "damping_nms_rad": [],
    "aero": {"lift_factor": 1.0},
}


class PlayedWork:
    """Work of two steps; at the second, someone presses Ctrl-C.

    Parameters
    ----------
    request : the request.
    best : of the interrupted work.
    """

    def __init__(self, request: Document, best: Document | None) -> None:
        self.request = request
        self.best = best

    def steps(self, checkpoint: bytes | None, stop: Stop) -> Iterator[Step]:
        """Give one step, then be interrupted."""
        assert checkpoint is None
        yield Step(progress={"fraction": 0.5, "phase": "polish"}, checkpoint=b"first")
        os.kill(os.getpid(), signal.SIGINT)
        if stop():
            raise Interrupted

    def outcome(self, _checkpoint: bytes, *, files: bool = True) -> Outcome:  # noqa: ARG002
        """Never reached."""
        raise AssertionError

    def best_so_far(self, checkpoint: bytes) -> Outcome | None:
        """Give the best at the first step."""
        assert checkpoint == b"first"
        return None if self.best is None else Outcome(self.best, {"result.json": b"{}"})


PlayWork = Callable[[Callable[[Document], PlayedWork]], None]


@pytest.fixture
def play_work(monkeypatch: pytest.MonkeyPatch) -> PlayWork:
    """Put played work in the place of every operation."""

    def install(begin: Callable[[Document], PlayedWork]) -> None:
        monkeypatch.setattr(
            "worker.operations.find_operation", lambda _name: lambda request, _threads: begin(request)
        )

    return install


def command(examples: Path) -> list[str]:
    """Give the command line of an identification."""
    names = {"--aircraft": "aircraft.json", "--flight": "flight.json", "--sample": "train_rate_0.8.csv"}
    return ["identify", *(word for option, name in names.items() for word in (option, str(examples / name)))]


def test_the_first_interrupt_gives_the_best_so_far(
    examples: Path, tmp_path: Path, play_work: PlayWork
) -> None:
    """Ctrl-C ends a search with what it found, marked as partial, and with its own exit code."""
    play_work(lambda request: PlayedWork(request, {"fit": [], "model": MODEL}))
    out = tmp_path / "out.json"
    before = signal.getsignal(signal.SIGINT)
    ended = RUNNER.invoke(app, [*command(examples), "--json", str(out), "--plots", str(tmp_path / "plots")])
    assert ended.exit_code == Exit.INTERRUPTED
    assert json.loads(out.read_text())["partial"] is True
    assert "best result so far" in ended.stderr
    assert (tmp_path / "plots" / "result.json").is_file()
    assert signal.getsignal(signal.SIGINT) is before


class EndedWork(PlayedWork):
    """Work of one step that notes whether its files were wanted."""

    wanted: ClassVar[list[bool]] = []

    def steps(self, checkpoint: bytes | None, stop: Stop) -> Iterator[Step]:
        """Give one step."""
        del checkpoint, stop
        yield Step(progress={"fraction": 1.0, "phase": "polish"}, checkpoint=b"last")

    def outcome(self, _checkpoint: bytes, *, files: bool = True) -> Outcome:
        """Give the result."""
        self.wanted.append(files)
        return Outcome(self.best or {}, {"fit.svg": b"<svg/>"} if files else {})


def test_plots_are_drawn_only_for_who_takes_them(examples: Path, tmp_path: Path, play_work: PlayWork) -> None:
    """Drawing takes seconds: it is left out where no option takes the files."""
    play_work(lambda request: EndedWork(request, {"fit": [], "model": MODEL}))
    EndedWork.wanted.clear()
    json_out = ["--json", str(tmp_path / "out.json")]
    assert RUNNER.invoke(app, [*command(examples), *json_out]).exit_code == Exit.OK
    plots = tmp_path / "plots"
    assert RUNNER.invoke(app, [*command(examples), *json_out, "--plots", str(plots)]).exit_code == Exit.OK
    assert EndedWork.wanted == [False, True]
    assert (plots / "fit.svg").is_file()


def test_an_interrupt_may_leave_nothing(examples: Path, tmp_path: Path, play_work: PlayWork) -> None:
    """Where there is no best so far, Ctrl-C ends without a result."""
    play_work(lambda request: PlayedWork(request, None))
    ended = RUNNER.invoke(app, [*command(examples), "--json", str(tmp_path / "out.json")])
    assert ended.exit_code == Exit.INTERRUPTED
    assert not (tmp_path / "out.json").exists()


@pytest.mark.parametrize(
    ("pointer", "option"),
    [
        ("/aircraft/surfaces/0/span_m", "--aircraft"),
        ("/samples/0/time_s/7", "--sample"),
        ("/search/seed", "--seed 3"),
        ("/model/links_per_wing", "--links 3"),
    ],
)
def test_a_refusal_names_the_option(
    examples: Path,
    play_work: PlayWork,
    pointer: str,
    option: str,
) -> None:
    """A refusal of the library by JSON pointer is reported with the option that set the field."""

    def refuse(_request: Document) -> PlayedWork:
        raise InvalidInput("it will not do", pointer=pointer, hint="do better")

    play_work(refuse)
    ended = RUNNER.invoke(app, [*command(examples), "--seed", "3", "--links", "3", "--json", "-"])
    assert ended.exit_code == Exit.INVALID_INPUT
    error = json.loads(ended.stderr.splitlines()[-1])
    assert (error["error"], error["pointer"], error["hint"]) == ("it will not do", pointer, "do better")
    assert error["given_by"].startswith(option)


def test_the_closest_option_is_named() -> None:
    """The option behind a field is that of the field itself, else of what holds it; some have none."""
    request = Request("simulate")
    request.put("/model", {}, "--parameters out.json")
    request.put("/model/lattice/chordwise", 9, "--chordwise")
    request.put("/model/lattice/spanwise", None, "--spanwise")
    assert request.document == {"model": {"lattice": {"chordwise": 9}}}
    assert request.option_at("/model/lattice/chordwise") == "--chordwise 9"
    assert request.option_at("/model/lattice/spanwise") == "--parameters out.json"
    assert request.option_at("/flight") == request.option_at("") == ""
