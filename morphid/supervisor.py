"""Keeps a few child processes alive, and ends them all together."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import IO

from app.private_files import PRIVATE_UMASK, close_to_others, make_private_folder, open_private

FIRST_PAUSE_S = 0.5  # s before the first restart: long enough to free a port, short enough to go unnoticed
MAX_PAUSE_S = 30.0
HEALTHY_AFTER_S = 60.0  # a child that lived this long starts again with the first pause
POLL_S = 0.1
LOG_LIMIT_BYTES = 10_000_000  # a longer log is restarted at the next start
PR_SET_PDEATHSIG = 1  # linux/prctl.h


@dataclass(frozen=True)
class ChildSpec:
    """How to run one child.

    Parameters
    ----------
    name : shown to the user and used for the log file.
    command : program and arguments.
    environment : variables set on top of the parent's.
    stdin_text : fed to the child's standard input (secrets stay out of the argument list).
    stop_within_s : time to wind down after SIGTERM, then SIGKILL.
    """

    name: str
    command: Sequence[str]
    environment: Mapping[str, str] = field(default_factory=dict)
    stdin_text: str | None = None
    stop_within_s: float = 10.0


class Child:
    """One supervised process, in its own session so that its whole process tree can be ended."""

    def __init__(self, spec: ChildSpec, log_path: Path, *, clock: Callable[[], float]) -> None:
        self.spec = spec
        self.log_path = log_path
        self.restarts = 0
        self._clock = clock
        self._pause_s = FIRST_PAUSE_S
        self._started_at = 0.0
        self._start_again_at: float | None = None
        self._process: subprocess.Popen[str] | None = None

    @property
    def pid(self) -> int | None:
        """Process id while it runs."""
        return self._process.pid if self._process is not None and self._process.poll() is None else None

    @property
    def exit_code(self) -> int | None:
        """Exit code of the last run, None while it runs; negative: the signal that ended it."""
        return None if self._process is None else self._process.poll()

    def start(self) -> None:
        """Start the process; its output goes to the log."""
        with self._open_log() as log:
            self._process = subprocess.Popen(
                list(self.spec.command),
                env={**os.environ, **self.spec.environment},
                stdin=subprocess.PIPE if self.spec.stdin_text is not None else subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                text=True,
                start_new_session=True,
                umask=PRIVATE_UMASK,  # files it writes itself, such as the broker's journal, are private
                preexec_fn=_die_with_parent if sys.platform == "linux" else None,  # noqa: PLW1509 - no threads here
            )
        if self.spec.stdin_text is not None and self._process.stdin is not None:
            with contextlib.suppress(BrokenPipeError), self._process.stdin as stdin:
                stdin.write(self.spec.stdin_text)
        self._started_at = self._clock()
        self._start_again_at = None

    def tend(self) -> str | None:
        """Restart the process if it has died and its pause is over.

        Returns
        -------
        A sentence on what happened, or None.
        """
        now = self._clock()
        if self._start_again_at is not None:
            if now < self._start_again_at:
                return None
            self.restarts += 1
            self.start()
            return f"{self.spec.name} is running again (process {self.pid})"
        code = self.exit_code
        if code is None:
            return None
        self._kill_group()  # leftover processes would run at the same time as the successor
        if now - self._started_at > HEALTHY_AFTER_S:
            self._pause_s = FIRST_PAUSE_S
        pause_s, self._pause_s = self._pause_s, min(2.0 * self._pause_s, MAX_PAUSE_S)
        self._start_again_at = now + pause_s
        return f"{self.spec.name} ended ({describe_exit(code)}); starting it again in {pause_s:g} s"

    def stop(self) -> None:
        """Terminate it, wait, then kill it."""
        self._start_again_at = None
        if self._process is None:
            return
        if self._process.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                self._process.terminate()
            try:
                self._process.wait(self.spec.stop_within_s)
            except subprocess.TimeoutExpired:
                self._process.kill()
        self._kill_group()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(5.0)

    def last_words(self, lines: int = 12) -> str:
        """Return the end of the log."""
        with contextlib.suppress(OSError):
            return "\n".join(self.log_path.read_text("utf-8", "replace").splitlines()[-lines:])
        return ""

    def _kill_group(self) -> None:
        if self._process is not None:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid, signal.SIGKILL)

    def _open_log(self) -> IO[str]:
        make_private_folder(self.log_path.parent)
        close_to_others(self.log_path.parent)
        too_long = self.log_path.exists() and self.log_path.stat().st_size > LOG_LIMIT_BYTES
        return open_private(self.log_path, "w" if too_long else "a")


class Supervisor:
    """Start children in order, tend them until the end is requested, end them in reverse order.

    Parameters
    ----------
    log_dir : where each child's output goes.
    report : called with a sentence for every event that the user should know.
    clock, sleep : injected so that tests need not wait.
    """

    def __init__(
        self,
        log_dir: Path,
        *,
        report: Callable[[str], None],
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.children: dict[str, Child] = {}
        self._log_dir = log_dir
        self._report = report
        self._clock = clock
        self._sleep = sleep
        self.stopping = False  # whether a signal requested the end; `watch` then returns

    def on_signals(self) -> None:
        """Treat SIGINT, SIGTERM and SIGHUP as requests to end."""

        def stop(_number: int, _frame: FrameType | None) -> None:
            self.stopping = True

        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, stop)

    def start(self, spec: ChildSpec) -> Child:
        """Start one more child."""
        child = Child(spec, self._log_dir / f"{spec.name}.log", clock=self._clock)
        self.children[spec.name] = child
        child.start()
        return child

    def wait_until(self, child: Child, ready: Callable[[], bool], within_s: float) -> bool:
        """Wait for a fresh child to become ready.

        Returns
        -------
        False when it died, time ran out, or the end was requested.
        """
        deadline = self._clock() + within_s
        while self._clock() < deadline and not self.stopping:
            if child.exit_code is not None:
                return False
            if ready():
                return True
            self._sleep(POLL_S / 2.0)
        return False

    def watch(self) -> None:
        """Tend the children until the end is requested."""
        while not self.stopping:
            self.tend()
            self._sleep(POLL_S)

    def tend(self) -> None:
        """Look after each child once."""
        for child in self.children.values():
            event = child.tend()
            if event is not None:
                self._report(event)

    def stop(self) -> None:
        """End all children, the last started first."""
        self.stopping = True
        for child in reversed(self.children.values()):
            child.stop()


def describe_exit(code: int) -> str:
    """Describe how a process ended: its exit code, or the signal that killed it."""
    if code >= 0:
        return f"exit code {code}"
    try:
        return signal.Signals(-code).name
    except ValueError:
        return f"signal {-code}"


def _die_with_parent() -> None:
    """Have the kernel end this child if the supervisor disappears (Linux)."""
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
