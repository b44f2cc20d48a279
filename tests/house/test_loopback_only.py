"""The guard bites: nothing in tests, and nothing that they start, talks to another machine.

The addresses are those of documentation (RFC 5737, RFC 3849); were the guard gone, these tests would fail
before they could be reached by anybody.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import runpy
import socket
import subprocess
import threading
from collections.abc import Callable
from pathlib import Path

import httpx
import psycopg
import pytest
import redis

from app.database import Database
from app.settings import Settings, is_loopback
from tests.app.hostile.api_process import api_process
from tests.app.webhooks.hooks import deliveries, ended_job, new_hook
from tests.app.webhooks.receiver import receiver
from tests.loopback_only import DIAL_ONLY, LEAD_ELSEWHERE, BeyondThisMachine, refusals
from tests.waiting import until

ELSEWHERE, ELSEWHERE_6, NAME = "192.0.2.1", "2001:db8::1", "elsewhere.invalid"


def open_database(url: str) -> None:
    """Connect as the service does."""
    with Database(url).read():
        pass


def connect(family: socket.AddressFamily, host: str) -> None:
    """Connect, and do not wait: the guard stands before the first packet."""
    with socket.socket(family, socket.SOCK_STREAM) as link:
        link.settimeout(0.0)
        link.connect_ex((host, 9))


def send(host: str) -> None:
    """Send a datagram."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.sendto(b"x", (host, 9))


def send_message(host: str) -> None:
    """Send a datagram in pieces."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.sendmsg([b"x"], [], 0, (host, 9))


async def open_stream(host: str) -> None:
    """Connect from an event loop."""
    await asyncio.wait_for(asyncio.open_connection(host, 9), 1.0)


WAYS: dict[str, Callable[[], object]] = {
    "connect": lambda: connect(socket.AF_INET, ELSEWHERE),
    "connect by IPv6": lambda: connect(socket.AF_INET6, ELSEWHERE_6),
    "datagram": lambda: send(ELSEWHERE),
    "datagram in pieces": lambda: send_message(ELSEWHERE),
    "look-up": lambda: socket.getaddrinfo(NAME, 443),
    "old look-up": lambda: socket.gethostbyname(NAME),
    "backward look-up": lambda: socket.gethostbyaddr(ELSEWHERE),
    "name of an address": lambda: socket.getnameinfo((ELSEWHERE, 9), 0),
    "event loop": lambda: asyncio.run(open_stream(ELSEWHERE)),
    "look-up of an event loop": lambda: asyncio.run(open_stream(NAME)),
    "httpx": lambda: httpx.get(f"http://{ELSEWHERE}/", timeout=1.0),
    "redis": lambda: redis.Redis(host=ELSEWHERE, socket_connect_timeout=1.0).ping(),
    "libpq": lambda: psycopg.connect(f"postgresql://u@{ELSEWHERE}/x", connect_timeout=1),
    "libpq by name": lambda: psycopg.connect(host="127.0.0.1", hostaddr=ELSEWHERE, connect_timeout=1),
    "database": lambda: open_database(f"postgresql://u@{NAME}/x?connect_timeout=1"),
}


@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
def test_every_way_out_is_refused(way: Callable[[], object]) -> None:
    """Sockets, look-ups, event loops and clients in C end at the guard, which notes what they wanted."""
    with refusals() as seen, pytest.raises(BeyondThisMachine):
        way()
    assert seen


def test_threads_are_watched_and_swallowed_refusals_noted() -> None:
    """What a thread wanted is known although it took the refusal for any failure."""

    def try_it() -> None:
        with contextlib.suppress(Exception):
            connect(socket.AF_INET, ELSEWHERE)

    with refusals() as seen:
        thread = threading.Thread(target=try_it)
        thread.start()
        thread.join()
    assert len(seen) == 1
    assert ELSEWHERE in seen[0]


def test_this_machine_is_open() -> None:
    """Loopback, its names and socket files are nobody else's."""
    with receiver() as there, socket.create_connection(("localhost", there.port), timeout=5.0):
        pass
    one, other = socket.socketpair()
    one.close()
    other.close()


def test_started_services_get_an_environment_that_leads_nowhere() -> None:
    """Every child inherits hosts of this machine as the only ones for webhooks, and no collector or proxy."""
    hosts = Settings().webhook_hosts
    assert hosts
    assert all(is_loopback(host) for host in hosts)
    assert os.environ[DIAL_ONLY]
    leads = [*LEAD_ELSEWHERE, "OTEL_EXPORTER_OTLP_ENDPOINT", "PGHOST", "HTTPS_PROXY", "all_proxy"]
    assert [name for name in leads if name in os.environ] == []


def test_the_demonstration_calls_nobody(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The service that `make demo` starts may send webhooks to this machine only."""
    monkeypatch.syspath_prepend(str(root / "examples"))  # as for a script that is run
    demo = runpy.run_path(str(root / "examples" / "demo.py"))
    started: list[dict[str, str]] = []

    def start(*_command: object, env: dict[str, str], **_options: object) -> None:
        started.append(env)
        raise InterruptedError

    monkeypatch.setattr(subprocess, "Popen", start)
    with pytest.raises(InterruptedError), demo["service"]():
        pass
    assert all(is_loopback(host) for host in started[0][DIAL_ONLY].split(","))


def test_a_started_service_dials_nothing_but_what_is_named(tmp_path: Path) -> None:
    """A real process with webhooks in its table: the named receiver is sent to, the others never dialled.

    The rows are written past the check at creation; it is the sender itself that refuses.
    """
    with receiver() as named, receiver() as other:
        chosen = {"webhook_allow_private": 1, "webhook_dial_only": f"127.0.0.1:{named.port}"}
        with api_process(tmp_path, **chosen):
            database = Database(f"sqlite:///{tmp_path / 'morphid.sqlite3'}")
            urls = (
                other.url(),
                f"https://{ELSEWHERE}/",
                f"https://{NAME}/",
                f"http://localhost:{named.port}/",
            )
            refused = {new_hook(database, url) for url in urls}
            allowed = new_hook(database, named.url())
            ended_job(database)
            until(lambda: all(row.response_status or row.error for row in deliveries(database)))
            rows = {row.webhook_id: row for row in deliveries(database)}
            database.dispose()
        assert rows[allowed].status == "delivered"
        assert {rows[hook].error for hook in refused} == {
            "Refused: This service sends webhooks only to certain hosts, and this is not one of them."
        }
        assert (named.connections, other.connections) == (1, 0)
