"""``morphid bench`` and Ctrl-C."""

from __future__ import annotations

import os
import signal
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from benchmarks import fresh_process, run
from morphcore.stopping import Interrupted, check_stop, stoppable
from morphid.exits import Exit
from morphid.main import app

RUNNER = CliRunner()


@pytest.mark.parametrize("interrupts", [1, 2])
def test_ctrl_c_ends_it(interrupts: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first is checked between measurements, as an exception may be lost; the second ends at once."""
    reached: list[str] = []

    def measure(*_: object, **__: object) -> dict[str, Any]:
        try:
            os.kill(os.getpid(), signal.SIGINT)  # an exception would be lost here, where a kernel is loaded
        except KeyboardInterrupt:
            reached.append("lost")
        reached.append("loaded")
        if interrupts == 2:
            os.kill(os.getpid(), signal.SIGINT)
        check_stop()
        reached.append("worked on")
        return {}

    monkeypatch.setattr(run, "run_benchmarks", measure)
    before = signal.getsignal(signal.SIGINT)
    ended = RUNNER.invoke(app, ["bench", "--quick"])
    assert (ended.exit_code, reached) == (Exit.INTERRUPTED, ["loaded"])
    assert "stopped" in ended.stderr
    assert signal.getsignal(signal.SIGINT) is before


def test_measurements_ask_whether_to_go_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """Between two sections, and where a process of its own was ended by the same Ctrl-C."""
    seen: list[str] = []
    monkeypatch.setattr(run, "warm_up", lambda: None)
    monkeypatch.setattr(
        run,
        "SECTIONS",
        {name: lambda _bench, name=name: {name: seen.append(name)} for name in ("one", "two")},
    )
    with pytest.raises(Interrupted), stoppable(lambda: "one" in seen):
        run.run_benchmarks(sections=("one", "two"))
    assert seen == ["one"]
    with pytest.raises(Interrupted), stoppable(lambda: True):
        fresh_process.in_fresh_process("os:abort")
    with pytest.raises(RuntimeError, match="os:abort"):
        fresh_process.in_fresh_process("os:abort")


def test_an_installed_command_says_where_the_benchmarks_are(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """The wheel ships no benchmarks; the command names what has them."""
    command = import_module("morphid.commands.bench")
    monkeypatch.setattr(
        command, "__file__", str(tmp_path / "site-packages" / "morphid" / "commands" / "bench.py")
    )
    ended = RUNNER.invoke(app, ["bench"])
    assert ended.exit_code == Exit.ENVIRONMENT
    assert "make bench" in ended.stderr
