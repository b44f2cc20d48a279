"""The doctor: each fault really produced, found, and named with its remedy."""

from __future__ import annotations

import json
import os
import resource
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import text, update

from app.database import Database, upgrade
from app.health.broker import broker_client
from app.health.presence import Sign, note_started
from app.jobs.store import claim_job, create_job
from app.settings import Settings
from app.tables import jobs, workers
from morphid.broker import free_port, prepare_broker
from morphid.doctor import machine, remote, service
from morphid.doctor.findings import Finding, State, examined
from morphid.doctor.round import round_here, round_there
from morphid.exits import Exit
from morphid.supervisor import Supervisor
from tests.waiting import until


def states(findings: Iterator[Finding]) -> dict[str, State]:
    """State by what was looked at; every complaint comes with a remedy."""
    found = list(findings)
    assert all(each.remedy for each in found if each.state is not State.OK), found
    return {each.name: each.state for each in found}


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    """Settings of a service with a migrated database."""
    made = Settings(data_dir=tmp_path, worker_seen_every_s=5.0)
    upgrade(made.database_url)
    return made


@pytest.fixture(scope="module")
def broker_url(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A broker behind a password."""
    folder = tmp_path_factory.mktemp("broker")
    supervisor = Supervisor(folder / "logs", report=lambda _sentence: None)
    broker = prepare_broker(folder)
    assert supervisor.wait_until(supervisor.start(broker.spec), broker.answers, 10.0)
    yield broker.url
    supervisor.stop()


def doctor(*words: str, **variables: str) -> tuple[int, dict[str, dict[str, str]]]:
    """Run the command; give its exit code and findings by name."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("MORPHID_")}
    done = subprocess.run(
        [sys.executable, "-m", "morphid.main", "doctor", "--json", *words],
        capture_output=True,
        text=True,
        env=environment | variables,
        check=False,
    )
    assert done.returncode in {Exit.OK, Exit.ENVIRONMENT}, done.stderr
    reported = json.loads(done.stdout)
    assert (reported["status"] == "fail") == (done.returncode == Exit.ENVIRONMENT)
    return done.returncode, {each["name"]: each for each in reported["findings"]}


def test_this_installation_is_sound(tmp_path: Path) -> None:
    """Where the tests run, nothing is wrong."""
    code, found = doctor(MORPHID_DATA_DIR=str(tmp_path), MORPHID_PORT=str(free_port(0)))
    assert code == Exit.OK, found
    assert found["compiler"]["state"] == found["kernel cache"]["state"] == found["packages"]["state"] == "ok"


def test_a_wrong_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A numpy that is too old is named."""
    info = tmp_path / "numpy-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: numpy\nVersion: 1.0\n")
    monkeypatch.syspath_prepend(tmp_path)
    (finding,) = machine.packages()
    assert finding.state is State.FAIL
    assert "numpy 1.0" in finding.message


def test_other_packages_than_tested(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An accepted but untested version is reported."""
    constraints = tmp_path / "constraints.txt"
    constraints.write_text("numpy==2.1.0  # other\nabsent==1\nwinonly==1; sys_platform == 'win32'\n")
    monkeypatch.setattr(machine, "CONSTRAINTS", constraints)
    assert states(machine.packages()) == {"packages": State.OK, "constraints": State.WARN}


def test_a_compiler_that_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Kernels that cannot be compiled are a fault, kernels that cannot be kept a nuisance."""
    (tmp_path / "file").touch()
    reported = json.dumps({"numba": "0", "cache": str(tmp_path / "file" / "cache")})
    monkeypatch.setattr(machine, "COMPILE", f"print({reported!r})")
    assert states(machine.compiler()) == {"compiler": State.OK, "kernel cache": State.WARN}
    monkeypatch.setattr(machine, "COMPILE", "raise RuntimeError('no compiler')")
    (finding,) = machine.compiler()
    assert "no compiler" in finding.message
    monkeypatch.setattr(machine, "COMPILE", "import time; time.sleep(60)")
    monkeypatch.setattr(machine, "COMPILE_WITHIN_S", 0.2)
    assert states(machine.compiler()) == {"compiler": State.FAIL}


def test_more_workers_than_cores() -> None:
    """Jobs that would compete for cores and memory are reported."""
    assert states(machine.cores(1))["cores"] is State.OK
    assert states(machine.cores(1000)) == {"cores": State.WARN, "memory": State.WARN}


def test_contradicting_settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Refused settings are reported in the service's words; unsafe but accepted ones cause warnings."""
    monkeypatch.setattr(machine, "COMPILE", """print('{"numba": "0", "cache": "/"}')""")
    monkeypatch.setenv("MORPHID_LEASE_S", "1")
    last = list(round_here(tmp_path))[-1]
    assert (last.name, last.state) == ("settings", State.FAIL)
    assert "MORPHID_HEARTBEAT_S" in last.message
    monkeypatch.delenv("MORPHID_LEASE_S")
    monkeypatch.setenv("MORPHID_BROKER_URL", "redis://:secret@127.0.0.1:1/0")
    found = {each.name: each for each in round_here(tmp_path)}
    assert found["broker"].state is State.FAIL
    assert "secret" not in found["broker"].message
    opened = Settings(data_dir=tmp_path, host="0.0.0.0", allow_open=True)  # noqa: S104 - never bound
    assert states(service.unsafe(opened)) == {"settings": State.WARN}
    private = Settings(data_dir=tmp_path, webhook_allow_private=True)
    assert states(service.unsafe(private)) == {"settings": State.WARN}
    assert states(service.unsafe(Settings(data_dir=tmp_path))) == {"settings": State.OK}


def test_few_open_files(monkeypatch: pytest.MonkeyPatch) -> None:
    """A limit below what the API needs is a fault."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    reported = machine.resource
    for maximum, state in ((200, State.FAIL), (800, State.WARN), (100_000, State.OK)):
        monkeypatch.setattr(reported, "getrlimit", lambda _which, maximum=maximum: (maximum, maximum))
        assert states(machine.files()) == {"open files": state}
    monkeypatch.undo()
    assert resource.getrlimit(resource.RLIMIT_NOFILE) == (soft, hard)


def test_scarce_room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A disk with too little space is reported; SQLite on a network disk is refused."""
    assert states(machine.data_dir(tmp_path, sqlite=True))["data directory"] is State.OK
    (tmp_path / "file").touch()
    assert states(machine.data_dir(tmp_path / "file" / "var", sqlite=True)) == {"data directory": State.FAIL}
    monkeypatch.setattr(machine, "SCARCE_SPACE", 10**18)
    assert states(machine.data_dir(tmp_path, sqlite=True))["disk"] is State.WARN
    monkeypatch.setattr(machine, "MIN_SPACE", 10**18)
    assert states(machine.data_dir(tmp_path, sqlite=True))["disk"] is State.FAIL
    monkeypatch.setattr(machine, "NETWORK_FILE_SYSTEMS", {machine._file_system(tmp_path)})
    assert states(machine.data_dir(tmp_path, sqlite=True))["data directory"] is State.FAIL


def test_sqlite_in_every_state(settings: Settings, monkeypatch: pytest.MonkeyPatch) -> None:
    """Sound, not there, of the past, of the future, readable by all, with another clock, spoilt."""
    file = Path(settings.database_url.removeprefix("sqlite:///"))
    file.chmod(0o600)
    assert set(states(service.database(settings)).values()) == {State.OK}
    file.chmod(0o644)
    assert states(service.database(settings))["permissions"] is State.WARN
    now = time.time
    monkeypatch.setattr(time, "time", lambda: now() + 3600.0)
    assert states(service.database(settings))["clock"] is State.WARN
    monkeypatch.undo()
    store = Database(settings.database_url)
    for revision in ("0001", "9999"):
        with store.write() as session:
            session.execute(text("UPDATE alembic_version SET version_num = :it"), {"it": revision})
        assert states(service.database(settings)) == {"database": State.FAIL}
    with store.write() as session:
        session.exec_driver_sql("UPDATE alembic_version SET version_num = '0002'")
        for _ in range(50):
            create_job(session, owner="local", operation="walk", request={"weight": "x" * 4000})
    with store.read() as session:
        session.exec_driver_sql("PRAGMA wal_checkpoint(TRUNCATE)")
    store.dispose()
    data = bytearray(file.read_bytes())
    middle = len(data) // 2 // 4096 * 4096
    data[middle : middle + 16_384] = bytes(16_384)
    file.write_bytes(data)
    assert State.FAIL in states(service.database(settings)).values()
    file.unlink()
    assert states(service.database(settings)) == {"database": State.WARN}


def test_postgres_that_is_not_there(tmp_path: Path) -> None:
    """A database that does not respond is a fault; its password is not shown."""
    settings = Settings(
        data_dir=tmp_path, database_url="postgresql://u:hush-hush@127.0.0.1:1/x?connect_timeout=2"
    )
    (finding,) = service.database(settings)
    assert finding.state is State.FAIL
    assert "hush" not in finding.message


def test_a_broker_in_every_state(broker_url: str) -> None:
    """As `morphid serve` runs it, it is sound; without journal, evicting, with another password it is not."""
    assert set(states(service.broker(broker_url)).values()) == {State.OK}
    client = broker_client(broker_url)
    client.config_set("appendonly", "no")
    client.config_set("maxmemory-policy", "allkeys-lru")
    found = states(service.broker(broker_url))
    assert (found["broker journal"], found["broker memory"]) == (State.WARN, State.FAIL)
    wrong = f"redis://:wrong@{broker_url.rpartition('@')[2]}"
    assert states(service.broker(wrong)) == {"broker": State.FAIL}
    assert states(service.broker("redis://127.0.0.1:1/0")) == {"broker": State.FAIL}
    assert states(service.broker("memory://")) == {"broker": State.OK}


def test_workers_and_jobs_in_every_state(settings: Settings) -> None:
    """No workers, live ones, stalled ones; jobs whose worker is gone, jobs that wait despite a free slot."""
    store = Database(settings.database_url)
    assert states(service.work(settings)) == {"workers": State.WARN, "jobs": State.OK}
    with store.write() as session:
        note_started(session, Sign("host:1", "1", slots=1, busy=0))
        waiting = create_job(session, owner="local", operation="walk", request={}).id
    assert states(service.work(settings)) == {"workers": State.OK, "jobs": State.OK}
    with store.write() as session:
        session.execute(update(jobs).values(created_at=jobs.c.created_at - 3600.0))
    assert states(service.work(settings))["jobs"] is State.FAIL
    with store.write() as session:
        claim_job(session, waiting, "host:1")
    assert states(service.work(settings))["jobs"] is State.OK
    with store.write() as session:
        session.execute(update(jobs).values(lease_until=jobs.c.lease_until - 3600.0))
        session.execute(update(workers).values(seen_at=workers.c.seen_at - 60.0))
    assert states(service.work(settings)) == {"workers": State.FAIL, "jobs": State.FAIL}
    store.dispose()


def test_demanded_keys(settings: Settings) -> None:
    """Where keys are demanded, one should be there."""
    locked = settings.model_copy(update={"auth": "keys"})
    assert states(service.keys(locked)) == {"keys": State.WARN}
    assert states(service.keys(settings)) == {}


def test_a_port_free_and_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    """A port that another program holds is a fault."""
    assert states(service.port("127.0.0.1", free_port(0))) == {"port": State.OK}
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        monkeypatch.setattr(remote, "TIMEOUT_S", 0.5)
        assert states(service.port("127.0.0.1", taken.getsockname()[1])) == {"port": State.FAIL}


def test_a_service_from_outside(live_service: Any) -> None:
    """A running service is sound from outside and holds its port; where there is none, that is found."""

    def found() -> dict[str, State]:
        return states(remote.service(live_service.url, None))

    until(lambda: found()["workers"] is State.OK, 30.0, 0.5, seen=found)  # it may still be loading
    assert set(found().values()) == {State.OK}
    host, _, number = live_service.url.removeprefix("http://").partition(":")
    assert states(service.port(host, int(number))) == {"port": State.OK}
    assert states(round_there("http://127.0.0.1:1", None)) == {"service": State.FAIL}


def test_the_doctor_finishes_his_round() -> None:
    """A check that breaks is a finding, and the next ones are made."""

    def broken() -> Iterator[Finding]:
        raise RuntimeError("unforeseen")
        yield

    found = list(examined([("first", broken), ("second", machine.python)]))
    assert [each.state for each in found] == [State.FAIL, State.OK]
    assert "unforeseen" in found[0].message
