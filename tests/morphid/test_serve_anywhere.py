"""``morphid serve`` in the worst surroundings at once, from its start to Ctrl-C.

One service, because a start takes many seconds. Its data folder has a name full of special characters and was
open to everybody; the process that starts it leaves new files open to others; the working folder holds
modules with the names of ours; every proxy variable names a proxy that is not there.
"""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import psutil
import pytest

from app.jobs.store import create_job, get_job
from tests.folder_names import ALL_NESTED, FOLDER_NAMES
from tests.live import MORPHID, LiveService
from tests.morphid.test_private_files import Watch
from tests.servers.hostile_folder import HostileFolder
from tests.waiting import until

PROXIES = ("HTTP_PROXY", "HTTPS_PROXY", "http_proxy", "https_proxy")


@dataclass
class Life:
    """What a service left and said from start to end.

    Parameters
    ----------
    base : the folder of its data folder, where nothing else may appear.
    home : its data folder.
    exit_code : of the whole service, after Ctrl-C.
    alive : its processes that outlived it.
    announced : what it said when a child died.
    imported : modules of the working folder that anybody imported.
    watch : every file and folder of the data folder with all modes that it ever had.
    commands : by name, the outcomes of commands that a user ran meanwhile.
    """

    base: Path
    home: Path
    exit_code: int
    alive: list[psutil.Process]
    announced: list[str]
    imported: list[str]
    watch: Watch
    commands: dict[str, subprocess.CompletedProcess[str]]


@contextmanager
def open_to_all() -> Iterator[None]:
    """Leave whatever is made meanwhile open to everybody."""
    before = os.umask(0)
    try:
        yield
    finally:
        os.umask(before)


@pytest.fixture(scope="module")
def dead_proxies() -> Iterator[dict[str, str]]:
    """Variables that send everything through a port at which nobody listens."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        dead = f"127.0.0.1:{taken.getsockname()[1]}"
        yield {**dict.fromkeys(PROXIES, f"http://{dead}"), "ALL_PROXY": f"socks5://{dead}"}


@pytest.fixture(scope="module")
def life(tmp_path_factory: pytest.TempPathFactory, dead_proxies: dict[str, str]) -> Life:
    """Start the service, use it, kill its API, press Ctrl-C."""
    base = tmp_path_factory.mktemp("base")
    hostile = HostileFolder(tmp_path_factory.mktemp("working") / "hostile")
    home = base / ALL_NESTED
    home.mkdir(mode=0o755, parents=True)
    service = LiveService(home, dead_proxies, folder=hostile.path)
    watch = Watch(home)
    try:
        with open_to_all(), watch:
            service.start()
            watch.seen = {found for found in watch.seen if found[0] != "."}  # it was open until then
        commands = used(service, dead_proxies)
        processes = tree(service)
        os.kill(service.children["api"], signal.SIGKILL)
        announced = [service.next_event()["message"] for _ in range(2)]
        with httpx.Client(base_url=service.url, timeout=1.0, trust_env=False) as client:
            until(lambda: answers(client), 60.0)
        processes += tree(service)
        ending = Watch(home)
        with ending:
            exit_code = service.stop()
        watch.seen |= ending.seen
    finally:
        if service.process.poll() is None:
            service.stop()
    _, alive = psutil.wait_procs(processes, timeout=5.0)
    return Life(base, home, exit_code, alive, announced, hostile.imported(), watch, commands)


def used(service: LiveService, proxies: dict[str, str]) -> dict[str, subprocess.CompletedProcess[str]]:
    """Run commands as a user in the same surroundings does, and have a job ended by the worker."""
    here = ["--data-dir", str(service.data_dir)]
    lines = {
        "keys": ["keys", "create", "--owner", "lab", "--name", "x", *here],
        "ready": ["ready", "--worker", "--wait", "30", *here],
        "doctor": ["doctor", "--url", service.url, "--json"],
    }
    ends = {
        name: subprocess.run(
            [str(MORPHID), *words],
            cwd=service.folder,
            env={**os.environ, **proxies},
            capture_output=True,
            text=True,
            check=False,
        )
        for name, words in lines.items()
    }
    database = service.database()
    with database.write() as session:
        # no worker knows this operation: the row's end shows that broker, worker and database have met
        job = create_job(session, owner="local", operation="walk", request={})

    def ended() -> bool:
        with database.read() as session:
            return get_job(session, "local", job.id).finished

    until(ended, 60.0, 0.2, seen=service.logs)
    database.dispose()
    return ends


def tree(service: LiveService) -> list[psutil.Process]:
    """The service's processes now."""
    top = psutil.Process(service.process.pid)
    return [top, *top.children(recursive=True)]


def answers(client: httpx.Client) -> bool:
    """Whether the API answers."""
    try:
        return client.get("/livez").is_success
    except httpx.TransportError:
        return False


def findings(life: Life) -> list[dict[str, Any]]:
    """What the doctor said."""
    found: list[dict[str, Any]] = json.loads(life.commands["doctor"].stdout)["findings"]
    return found


def test_nothing_of_the_working_folder_is_imported(life: Life) -> None:
    """A working folder with the user's own app/, worker/ and numpy.py serves like any other: a job ended."""
    assert life.imported == []


def test_a_service_lives_in_a_folder_of_any_name(life: Life) -> None:
    """`serve` with all its children; keys are made from another process; no files are created elsewhere."""
    for name in ("keys", "ready"):
        assert life.commands[name].returncode == 0, life.commands[name]
    assert {each.name for each in life.base.iterdir()} == {FOLDER_NAMES[0]}
    assert {"morphid.sqlite3", "broker", "logs", "serve.lock"} <= {each.name for each in life.home.iterdir()}


def test_the_whole_service_starts_behind_a_dead_proxy(life: Life) -> None:
    """`morphid serve` became ready, and `ready` and `doctor` agree."""
    assert "does not answer" not in life.commands["doctor"].stdout
    assert findings(life)[0]["state"] == "ok"


def test_a_service_writes_nothing_that_others_can_read(life: Life) -> None:
    """Database, reserve, logs, lock and the broker's journal, in an empty folder that was open."""
    assert {"morphid.sqlite3", "serve.lock", "api.log", "broker.log", "appendonlydir"} <= life.watch.names()
    assert life.watch.open_to_others() == []


def test_a_dead_child_is_restarted_and_ctrl_c_ends_all(life: Life) -> None:
    """A killed API was back within seconds; Ctrl-C then ended every process of the tree with exit code 0."""
    assert "api ended (SIGKILL)" in life.announced[0]
    assert "api is running again" in life.announced[1]
    assert life.exit_code == 0
    assert life.alive == []
