"""``morphid serve`` as a user meets it: a child process."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import httpx
import psutil
import pytest

from app.jobs.store import create_job, get_job
from morphid.exits import Exit
from tests.live import ROOT, LiveService
from tests.servers.hostile_folder import HostileFolder
from tests.waiting import until


def serve(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run ``morphid serve`` to its (early) end."""
    command = [sys.executable, "-m", "morphid.main", "serve", *arguments]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60, check=False)


def test_a_taken_port_gives_a_sentence(tmp_path: Path) -> None:
    """A port in use ends the command with a sentence that says what to do, not with a traceback."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        ended = serve("--port", str(port), "--data-dir", str(tmp_path))
    assert ended.returncode == Exit.ENVIRONMENT
    assert f"port {port}" in ended.stderr
    assert "--port 0" in ended.stderr
    assert "Traceback" not in ended.stderr


def test_an_open_address_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Listening beyond this machine without keys is refused with the reason."""
    monkeypatch.setenv("MORPHID_AUTH", "off")
    ended = serve("--host", "0.0.0.0", "--port", "0", "--data-dir", str(tmp_path))  # noqa: S104 - refused
    assert ended.returncode == Exit.USAGE
    assert "other machines" in ended.stderr


def test_nothing_of_the_working_folder_is_imported(tmp_path: Path) -> None:
    """A working folder with the user's own app/, worker/ and numpy.py serves like any other: a job ends."""
    hostile = HostileFolder(tmp_path / "hostile")
    service = LiveService(tmp_path / "var", folder=hostile.path).start()
    try:
        database = service.database()
        with database.write() as session:
            # no worker knows this operation: the row's end shows that broker, worker and database have met
            job = create_job(session, owner="local", operation="walk", request={})

        def ended() -> bool:
            with database.read() as session:
                return get_job(session, "local", job.id).finished

        until(ended, 60.0, 0.2, seen=service.logs)
        database.dispose()
    finally:
        service.stop()
    assert hostile.imported() == []


def test_an_unwritable_folder_gives_a_sentence(tmp_path: Path) -> None:
    """A data directory that cannot be made ends the command with a sentence."""
    (tmp_path / "file").touch()
    ended = serve("--port", "0", "--data-dir", str(tmp_path / "file" / "var"))
    assert ended.returncode == Exit.ENVIRONMENT
    assert "--data-dir" in ended.stderr


def test_a_data_directory_serves_one(live_service: LiveService) -> None:
    """A second service on the same data directory is refused."""
    ended = serve("--port", "0", "--data-dir", str(live_service.data_dir))
    assert ended.returncode == Exit.ENVIRONMENT
    assert "another" in ended.stderr


def test_the_api_loads_no_compiler(live_service: LiveService) -> None:
    """The API process has mapped neither numba nor its compiler."""
    maps = Path(f"/proc/{live_service.children['api']}/maps").read_text()
    assert "llvmlite" not in maps
    assert "numba" not in maps


def test_a_dead_child_is_restarted_and_ctrl_c_ends_all(tmp_path: Path) -> None:
    """A killed API is back within seconds; Ctrl-C then ends every process of the tree with exit code 0."""
    service = LiveService(tmp_path).start()
    tree = [
        psutil.Process(service.process.pid),
        *psutil.Process(service.process.pid).children(recursive=True),
    ]
    os.kill(service.children["api"], signal.SIGKILL)
    assert "api ended (SIGKILL)" in service.next_event()["message"]
    assert "api is running again" in service.next_event()["message"]
    until_it_answers(service.url)
    tree += psutil.Process(service.process.pid).children(recursive=True)
    assert service.stop() == 0
    _, alive = psutil.wait_procs(tree, timeout=5.0)
    assert alive == []


def until_it_answers(url: str, within_s: float = 60.0) -> None:
    """Ask until the service answers."""
    deadline = time.monotonic() + within_s
    while True:
        try:
            httpx.get(f"{url}/livez", timeout=1.0).raise_for_status()
            return
        except httpx.TransportError:
            assert time.monotonic() < deadline, url
            time.sleep(0.02)
