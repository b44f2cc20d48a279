"""The wheel, as ``pip install`` leaves it in an environment of its own, away from this checkout."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from morphid.exits import Exit
from tests.live import LiveService
from tests.servers.hostile_folder import OURS, HostileFolder

pytestmark = pytest.mark.slow

UV = Path(sys.executable).with_name("uv")
SOURCES = (*OURS, "pyproject.toml", "README.md", "LICENSE")
# of this checkout's environment, none may reach the installed command
FOREIGN = ("PYTHONPATH", "VIRTUAL_ENV", "NUMBA_CACHE_DIR")
SERVER_COMMANDS = (["serve"], ["doctor"], ["ready"], ["db", "upgrade"], ["keys", "ls"], ["audit", "ls"])
SAMPLES = ("--sample", "train_rate_0.5.csv", "--sample", "train_rate_0.8.csv")
FLIGHT = ("--aircraft", "aircraft.json", "--flight", "flight.json")
SMALL = ("--chordwise", "1", "--spanwise", "4")  # a coarse lattice: what is tested is the installation
SEARCH = ("--method", "hybrid", "--seed", "1", "--max-seconds", "20")


@dataclass
class Installation:
    """An environment with the wheel in it, and a user's working folder.

    Parameters
    ----------
    root : this repository, for the pinned versions.
    home : the environment.
    wheel : what is installed.
    folder : where commands run; it holds the example flights and modules that must not be imported.
    """

    root: Path
    home: Path
    wheel: Path
    folder: HostileFolder

    @property
    def morphid(self) -> Path:
        """The installed command."""
        return self.home / "bin" / "morphid"

    def install(self, extra: str = "") -> None:
        """Install the wheel, with an extra such as ``[server]``."""
        constraints = ("-c", str(self.root / "constraints.txt"))
        python = ("--python", str(self.home / "bin" / "python"))
        ran(
            [
                str(UV),
                "pip",
                "install",
                "-q",
                *python,
                *constraints,
                f"morphid{extra} @ {self.wheel.as_uri()}",
            ]
        )

    def run(self, *arguments: str, code: int = 0) -> subprocess.CompletedProcess[str]:
        """Run ``morphid`` in the user's folder."""
        environment = {name: value for name, value in os.environ.items() if name not in FOREIGN}
        command = [str(self.morphid), *arguments]
        ended = subprocess.run(
            command, cwd=self.folder.path, env=environment, capture_output=True, text=True, check=False
        )
        assert ended.returncode == code, f"{arguments}: {ended.stdout}\n{ended.stderr}"
        return ended


def ran(command: list[str]) -> None:
    """Run a command that has to succeed."""
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, f"{command}: {ended.stdout}\n{ended.stderr}"


@pytest.fixture(scope="module")
def installation(root: Path, examples: Path, tmp_path_factory: pytest.TempPathFactory) -> Installation:
    """Build the wheel from a copy without leftovers and install it, without extras."""
    source = tmp_path_factory.mktemp("source")
    for name in SOURCES:
        if (root / name).is_dir():
            shutil.copytree(root / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(root / name, source)
    dist = tmp_path_factory.mktemp("dist")
    ran([str(UV), "build", "-q", "--wheel", "-o", str(dist), str(source)])
    home = tmp_path_factory.mktemp("installed") / "venv"
    ran([str(UV), "venv", "-q", "--python", sys.executable, str(home)])
    folder = HostileFolder(tmp_path_factory.mktemp("user") / "work")
    for path in (*examples.glob("*.json"), *examples.glob("*.csv")):
        shutil.copy(path, folder.path)
    made = Installation(root, home, next(dist.glob("*.whl")), folder)
    made.install()
    return made


def test_the_base_installation_computes(installation: Installation) -> None:
    """Without the server's packages all operations run, in a folder with modules named like ours."""
    installation.run("identify", *FLIGHT, *SAMPLES, *SMALL, "--links", "1", *SEARCH, "--json", "out.json")
    found = json.loads((installation.folder.path / "out.json").read_text())
    assert found["model"]["links_per_wing"] == 1
    swarm = ("--method", "pso", "--particles", "4", "--generations", "1")
    installation.run("identify", *FLIGHT, *SAMPLES, *SMALL, "--links", "1", *swarm, "--json", "swarm.json")
    assert not (installation.folder.path / "report.log").exists(), "pyswarms reads our logging settings"
    installation.run("study", *FLIGHT, *SAMPLES, *SMALL, "--links", "1,2", *SEARCH, "--json", "study.json")
    schedule = ("--schedule", "train_rate_0.8.csv", "--out", "flight.csv")
    installation.run("simulate", *FLIGHT, "--model", "equivalent", "--parameters", "out.json", *schedule)
    morph = ("--final", "0.4", "--duration", "1.0", "--settle", "0.5", "--knots", "3", "--rate-limit", "1.0")
    installation.run("optimize", *FLIGHT, "--parameters", "out.json", *morph, *SEARCH, "--json", "best.json")
    assert installation.folder.imported() == []


def test_what_needs_the_server_says_so(installation: Installation) -> None:
    """Commands of the service name the missing package in a sentence; a client of a service needs none."""
    for command in SERVER_COMMANDS:
        ended = installation.run(*command, code=Exit.ENVIRONMENT)
        assert "pip install 'morphid[server]'" in ended.stderr, command
        assert "Traceback" not in ended.stderr, command
    installation.run("jobs", "ls", "--url", "http://127.0.0.1:1", code=Exit.UNREACHABLE)


def test_the_server_installation_serves(installation: Installation, tmp_path: Path) -> None:
    """With the extra, `morphid serve` in that folder runs a job; nothing in the folder is imported."""
    installation.install("[server]")
    service = LiveService(
        tmp_path / "var", morphid=installation.morphid, folder=installation.folder.path
    ).start()
    try:
        options = (*FLIGHT, *SAMPLES, *SMALL, "--links", "1", *SEARCH)
        installation.run("identify", *options, "--url", service.url, "--json", "served.json")
        listed = installation.run("jobs", "ls", "--url", service.url)
    finally:
        service.stop()
    assert "succeeded" in listed.stdout
    assert json.loads((installation.folder.path / "served.json").read_text())["model"]["links_per_wing"] == 1
    assert installation.folder.imported() == []
