"""``morphid serve`` as a user meets it: a child process."""

from __future__ import annotations

import socket
import subprocess
import sys
from pathlib import Path

import pytest

from morphid.exits import Exit
from tests.live import ROOT, LiveService


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
