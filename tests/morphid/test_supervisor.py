"""The supervisor keeps children alive and leaves none behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from morphid.supervisor import FIRST_PAUSE_S, MAX_PAUSE_S, Child, ChildSpec, Supervisor, describe_exit

SLEEPER = [sys.executable, "-c", "import time; time.sleep(60)"]
QUITTER = [sys.executable, "-c", "print('no such luck'); raise SystemExit(3)"]


class Clock:
    """Time that a test moves by hand, s."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        """Give the time."""
        return self.now


def supervisor(folder: Path, **kwargs: object) -> tuple[Supervisor, list[str]]:
    """Make a supervisor that notes what it reports."""
    said: list[str] = []
    return Supervisor(folder, report=said.append, **kwargs), said  # type: ignore[arg-type]


def tend_until_restart(child: Child, clock: Clock, pause_s: float) -> None:
    """Wait for the child's death and pass its pause."""
    assert child._process is not None
    child._process.wait(10.0)
    assert "ended" in (child.tend() or "")
    clock.now += 0.99 * pause_s
    assert child.tend() is None, "not before its pause is over"
    clock.now += 0.02 * pause_s
    assert "running again" in (child.tend() or "")


def test_a_dead_child_is_started_again_with_growing_pauses(tmp_path: Path) -> None:
    """Each death in a row doubles the pause, up to a longest one."""
    clock = Clock()
    child = Child(ChildSpec("quitter", QUITTER), tmp_path / "log", clock=clock)
    child.start()
    pause_s = FIRST_PAUSE_S
    for _ in range(8):
        tend_until_restart(child, clock, pause_s)
        pause_s = min(2.0 * pause_s, MAX_PAUSE_S)
    assert child.restarts == 8
    child.stop()


def test_a_long_life_forgives_the_past(tmp_path: Path) -> None:
    """A child that lived for a minute is started again without delay."""
    clock = Clock()
    child = Child(ChildSpec("sleeper", SLEEPER), tmp_path / "log", clock=clock)
    child._pause_s = MAX_PAUSE_S
    child.start()
    clock.now += 61.0
    assert child.pid is not None
    os.kill(child.pid, signal.SIGKILL)
    tend_until_restart(child, clock, FIRST_PAUSE_S)
    child.stop()


def test_the_report_names_the_cause(tmp_path: Path) -> None:
    """Exit codes and signals are reported by name, and the log keeps the child's last output."""
    overseer, said = supervisor(tmp_path)
    child = overseer.start(ChildSpec("quitter", QUITTER))
    assert not overseer.wait_until(child, lambda: False, 10.0), "a dead child never becomes ready"
    overseer.tend()
    assert said == ["quitter ended (exit code 3); starting it again in 0.5 s"]
    assert child.last_words() == "no such luck"
    assert describe_exit(-9) == "SIGKILL"
    overseer.stop()


def test_stop_ends_grandchildren_too(tmp_path: Path) -> None:
    """What a child started ends with it, even when it ignores the polite signal."""
    program = (
        "import signal, subprocess, sys, time\n"
        "signal.signal(signal.SIGTERM, signal.SIG_IGN)\n"
        "print(subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(60)']).pid, flush=True)\n"
        "time.sleep(60)\n"
    )
    overseer, _ = supervisor(tmp_path)
    child = overseer.start(ChildSpec("stubborn", [sys.executable, "-c", program], stop_within_s=0.3))
    assert overseer.wait_until(child, lambda: child.last_words().strip().isdigit(), 10.0)
    grandchild = psutil.Process(int(child.last_words()))
    overseer.stop()
    assert child.exit_code == -signal.SIGKILL
    assert grandchild.wait(5.0) is not None or not grandchild.is_running()


def test_secrets_travel_by_standard_input(tmp_path: Path) -> None:
    """Text for a child's standard input reaches it and is not on its command line."""
    program = "import sys; print(sys.stdin.read())"
    overseer, _ = supervisor(tmp_path)
    child = overseer.start(ChildSpec("reader", [sys.executable, "-c", program], stdin_text="secret"))
    overseer.wait_until(child, lambda: False, 10.0)
    assert child.last_words() == "secret"
    assert "secret" not in " ".join(child.spec.command)
    overseer.stop()


@pytest.mark.skipif(sys.platform != "linux", reason="the kernel's parent-death signal is Linux")
def test_children_end_with_a_killed_supervisor(tmp_path: Path) -> None:
    """Even SIGKILL of the supervisor leaves no child behind."""
    program = (
        "import sys, time\n"
        "from pathlib import Path\n"
        "from morphid.supervisor import ChildSpec, Supervisor\n"
        f"s = Supervisor(Path({str(tmp_path)!r}), report=print)\n"
        f"print(s.start(ChildSpec('sleeper', {SLEEPER!r})).pid, flush=True)\n"
        "time.sleep(60)\n"
    )
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        child = psutil.Process(int(parent.stdout.readline()))
        time.sleep(0.2)  # the child arms the signal between fork and exec
        parent.kill()
    child.wait(5.0)
    assert not child.is_running()
