"""An API process of its own, whose memory can be measured and whose limits a test sets."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

import httpx

from tests.app.running_service import DEAD_BROKER
from tests.plain_http import CERTIFICATES

ROOT = Path(__file__).resolve().parents[3]
START_S = 40.0
MIB = 2**20


@dataclass
class ApiProcess:
    """One running API.

    Parameters
    ----------
    pid, port : of the process.
    client : of the API.
    log : what it wrote.
    """

    pid: int
    port: int
    client: httpx.Client
    log: Path

    def rss_mib(self) -> float:
        """Memory of the process itself, without its parsers."""
        pages = int(Path(f"/proc/{self.pid}/statm").read_text().split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE") / MIB

    def children(self) -> list[int]:
        """Its child processes, dead ones that nobody reaped too."""
        found = []
        for path in Path(f"/proc/{self.pid}/task").glob("*/children"):
            with suppress(OSError):
                found += [int(word) for word in path.read_text().split()]
        return found

    def connect(self) -> socket.socket:
        """Open a plain connection."""
        return socket.create_connection(("127.0.0.1", self.port), timeout=30.0)

    def raw(self, request: bytes, *, timeout_s: float = 15.0) -> bytes:
        """Send bytes and give everything that comes back until the end."""
        with self.connect() as link:
            link.settimeout(timeout_s)
            with suppress(BrokenPipeError, ConnectionResetError):
                link.sendall(request)
            return read_all(link)


def read_all(link: socket.socket) -> bytes:
    """What comes until the other end hangs up."""
    found = b""
    with suppress(ConnectionResetError):
        while piece := link.recv(65_536):
            found += piece
    return found


@contextmanager
def api_process(folder: Path, **settings: object) -> Iterator[ApiProcess]:
    """Run an API with these settings until the block ends."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    environment = {
        **os.environ,
        "MORPHID_DATA_DIR": str(folder),
        "MORPHID_BROKER_URL": DEAD_BROKER,
        "MORPHID_SECRET_OF_THE_SERVICE": "must not reach a parser",
        **{f"MORPHID_{name.upper()}": str(value) for name, value in settings.items()},
    }
    log = folder / "api.log"
    with log.open("wb") as out:
        process = subprocess.Popen(
            [sys.executable, "-m", "app.http.server", "--port", str(port)],
            cwd=ROOT,
            env=environment,
            stdout=out,
            stderr=out,
        )
    try:
        with httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=60.0) as client:
            deadline = time.monotonic() + START_S
            while True:
                assert process.poll() is None, log.read_text()
                assert time.monotonic() < deadline, log.read_text()
                with suppress(httpx.TransportError):
                    if client.get("/livez").status_code == 200:
                        break
                time.sleep(0.05)
            yield ApiProcess(process.pid, port, client, log)
    finally:
        process.send_signal(signal.SIGTERM)
        try:
            process.wait(15.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


@dataclass
class Onlooker:
    """Requests /livez repeatedly during an attack; measures the slowest answer and the highest memory."""

    api: ApiProcess
    slowest_s: float = 0.0
    highest_mib: float = 0.0
    answers: int = 0
    failures: list[str] = field(default_factory=list)

    def __enter__(self) -> Self:
        self._stop = threading.Event()
        self.before_mib = self.highest_mib = self.api.rss_mib()
        self._thread = threading.Thread(target=self._look)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()

    @property
    def grown_mib(self) -> float:
        """Memory at its highest above that at the beginning."""
        return self.highest_mib - self.before_mib

    def _look(self) -> None:
        with httpx.Client(base_url=self.api.client.base_url, timeout=30.0, verify=CERTIFICATES) as client:
            while not self._stop.wait(0.02):
                start = time.perf_counter()
                try:
                    if client.get("/livez").status_code != 200:
                        self.failures.append("not 200")
                except httpx.HTTPError as error:
                    self.failures.append(repr(error))
                self.slowest_s = max(self.slowest_s, time.perf_counter() - start)
                self.highest_mib = max(self.highest_mib, self.api.rss_mib())
                self.answers += 1
