"""The commands and health checks of docker-compose.yml, run as processes on Postgres and a real broker."""

from __future__ import annotations

import os
import re
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import redis
import yaml

from app.database import Database
from app.jobs.records import Job, JobStatus
from app.jobs.store import create_job, get_job
from morphid.broker import find_server, free_port, prepare_broker
from morphid.supervisor import ChildSpec, Supervisor
from tests.servers.postgres import GivenPostgres
from tests.waiting import until

PORT_INSIDE = "8000"
PATH = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])


@dataclass
class Composition:
    """The compose file's services as processes of this machine.

    Parameters
    ----------
    services : as the file says.
    supervisor : runs them.
    environment : addresses of this machine's Postgres and broker in the place of the containers'.
    port : the API's.
    """

    services: dict[str, Any]
    supervisor: Supervisor
    environment: dict[str, str]
    port: int

    def command(self, name: str) -> list[str]:
        """Give a service's command, its port and address exchanged."""
        exchanged = {PORT_INSIDE: str(self.port), "0.0.0.0": "127.0.0.1"}  # noqa: S104 - exchanged
        return [exchanged.get(word, word) for word in self.services[name]["command"]]

    def start(self, name: str) -> None:
        """Start a service."""
        environment = {**self.services[name]["environment"], **self.environment}
        self.supervisor.start(ChildSpec(name=name, command=self.command(name), environment=environment))

    def healthy(self, name: str) -> bool:
        """Run a service's health check as its container would."""
        kind, *words = self.services[name]["healthcheck"]["test"]
        pid = self.supervisor.children[name].pid
        inside = {f":{PORT_INSIDE}/": f":{self.port}/", "/proc/1/": f"/proc/{pid}/", "$$": "$"}
        for there, here in inside.items():
            words = [word.replace(there, here) for word in words]
        command = ["sh", "-c", words[0]] if kind == "CMD-SHELL" else words
        checked = subprocess.run(
            command,
            env={**os.environ, **self.environment, "HOSTNAME": socket.gethostname()},
            capture_output=True,
            timeout=60,
            check=False,
        )
        return checked.returncode == 0

    def until_healthy(self, name: str, within_s: float = 60.0) -> None:
        """Wait for a service's health."""
        child = self.supervisor.children[name]
        until(lambda: self.healthy(name), within_s, 0.3, seen=lambda: child.last_words(30))


@pytest.fixture
def composition(root: Path, tmp_path: Path, postgres_server: GivenPostgres) -> Iterator[Composition]:
    """Postgres and a broker run; the compose file's own services are the test's to start."""
    supervisor = Supervisor(tmp_path / "logs", report=lambda _sentence: None)
    broker = prepare_broker(tmp_path)
    child = supervisor.start(broker.spec)
    assert supervisor.wait_until(child, broker.answers, 10.0)
    text = (root / "docker-compose.yml").read_text("utf-8")
    yield Composition(
        services=yaml.safe_load(re.sub(r"\$\{\w+:-([^}]*)\}", r"\1", text))["services"],
        supervisor=supervisor,
        environment={
            "MORPHID_DATABASE_URL": postgres_server.new_database(),
            "MORPHID_BROKER_URL": broker.url,
            "PATH": PATH,
        },
        port=free_port(0),
    )
    supervisor.stop()


def test_the_composed_redis_asks_for_its_password(composition: Composition, tmp_path: Path) -> None:
    """Its command, run with this machine's server: no arguments reveal the password, and all must have it."""
    redis_server = tmp_path / "bin" / "redis-server"
    redis_server.parent.mkdir()
    redis_server.symlink_to(find_server())
    port, password = free_port(0), "2f8a6c"
    words = composition.services["redis"]["command"]
    words = [
        word.replace("$$", "$").replace("redis-server -", f"redis-server - --port {port}") for word in words
    ]
    environment = {
        "REDISCLI_AUTH": password,
        "PATH": os.pathsep.join([str(redis_server.parent), os.environ["PATH"]]),
        "PWD": str(tmp_path),
    }
    words[-1] = f"cd {tmp_path}; {words[-1]}"
    child = composition.supervisor.start(ChildSpec(name="redis", command=words, environment=environment))

    def answers() -> bool:
        with suppress(redis.ConnectionError), redis.Redis(port=port, password=password) as client:
            return bool(client.ping())
        return False

    until(answers, 20.0, 0.1, seen=lambda: child.last_words(30))
    with redis.Redis(port=port) as stranger, pytest.raises(redis.AuthenticationError):
        stranger.ping()
    assert password.encode() not in Path(f"/proc/{child.pid}/cmdline").read_bytes()
    with redis.Redis(port=port, password=password) as client:
        assert str(client.config_get("maxmemory-policy")).count("noeviction") == 1
        assert str(client.config_get("appendonly")).count("yes") == 1


def test_the_composed_service_works(composition: Composition, root: Path) -> None:
    """Migrated by its own command, all services become healthy; the beat repeats a lost message."""
    environment = {**os.environ, **composition.environment}
    subprocess.run(composition.command("migrate"), env=environment, cwd=root, check=True, timeout=60)
    for name in ("api", "worker", "beat"):
        composition.start(name)
    for name in ("api", "worker", "beat"):
        composition.until_healthy(name)
    database = Database(composition.environment["MORPHID_DATABASE_URL"])
    with database.write() as connection:
        # no worker knows this operation: the row's end shows that beat, broker, worker and database connect
        job = create_job(connection, owner="local", operation="walk", request={})

    def now() -> Job:
        with database.read() as connection:
            return get_job(connection, "local", job.id)

    worker = composition.supervisor.children["worker"]
    until(lambda: now().finished, 60.0, 0.3, seen=lambda: worker.last_words(30))
    job = now()
    database.dispose()
    assert job.status is JobStatus.FAILED
    assert (job.error or {})["code"] == "unknown_operation"
