"""A live service for tests: `morphid serve` as a child process on a free port with files of its own."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from app.database import Database
from app.database_address import sqlite_url

ROOT = Path(__file__).resolve().parent.parent
MORPHID = Path(sys.executable).with_name("morphid")  # the command, as it is installed


@dataclass
class LiveService:
    """One running ``morphid serve``.

    Parameters
    ----------
    data_dir : its database, queue and logs.
    environment : variables set on top of this process's.
    morphid : the command.
    folder : working folder.
    """

    data_dir: Path
    environment: dict[str, str] = field(default_factory=dict)
    morphid: Path = MORPHID
    folder: Path = ROOT
    url: str = ""
    children: dict[str, int] = field(default_factory=dict)

    def start(self) -> LiveService:
        """Start it and wait until it is ready."""
        self.process = subprocess.Popen(
            [str(self.morphid), "serve", "--json", "--port", "0", "--data-dir", str(self.data_dir)],
            cwd=self.folder,
            env={**os.environ, **self.environment},
            stdout=subprocess.PIPE,
            text=True,
        )
        try:
            ready = self.next_event()
            assert ready["event"] == "ready", f"{ready}\n{self.logs()}"
        except BaseException:
            self.stop()
            raise
        self.url, self.children = ready["url"], ready["children"]
        return self

    def next_event(self) -> dict[str, Any]:
        """Read the next line that the service announces."""
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        assert line, f"the service ended: {self.logs()}"
        event: dict[str, Any] = json.loads(line)
        return event

    def stop(self) -> int:
        """Press Ctrl-C, wait, give the exit code."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        self.process.communicate(timeout=60)
        return self.process.returncode

    def database(self) -> Database:
        """Open its job store."""
        return Database(sqlite_url(self.data_dir / "morphid.sqlite3"))

    def logs(self) -> str:
        """Give the ends of its logs."""
        return "\n".join(
            f"--- {path.name}\n" + "\n".join(path.read_text(errors="replace").splitlines()[-20:])
            for path in sorted(self.data_dir.glob("logs/*.log"))
        )
