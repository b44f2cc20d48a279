"""One owner's costly uploads and another's small one."""

from __future__ import annotations

import socket
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import httpx
import pytest

from app.http.body_limit import BODIES_AT_ONCE
from app.parsing import pool
from app.settings import Settings
from tests.app.calls import JSON, fault
from tests.app.key_holders import holder, make_key
from tests.app.running_service import DEAD_BROKER, RunningService, running_service
from tests.waiting import until

BOMBS = 14
BOMB_S = 1.0  # a real one takes up to 20
OTHERS_WAIT_S = 3.0
FLIGHT = (
    "t,sweep_left,sweep_right,phi,theta,psi\n" + "".join(f"{0.01 * i},0,0,0,0,0\n" for i in range(20))
).encode()
BODY_BYTES = 2**20


@pytest.fixture
def keyed(tmp_path: Path) -> Iterator[RunningService]:
    """A service with keys, with two readers as by default."""
    settings = Settings(
        database_url=f"sqlite:///{tmp_path / 'service.sqlite3'}",
        broker_url=DEAD_BROKER,
        auth="keys",
        max_body_bytes=BODY_BYTES,
    )
    with running_service(settings) as running:
        yield running


@pytest.fixture
def bombs(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Let the reader of every MATLAB file think for a while and find nothing; when each began."""
    real, begun = pool.subprocess.Popen, []

    def popen(command: list[str], **options: Any) -> Any:
        if "matlab" in command:
            begun.append(time.monotonic())
            command = [sys.executable, "-c", f"import time; time.sleep({BOMB_S})"]
        return real(command, **options)

    monkeypatch.setattr(pool.subprocess, "Popen", popen)
    return begun


def upload(client: httpx.Client, name: str, content: bytes) -> int:
    """Upload a file; the status."""
    return client.post("/trajectories", files={"file": (name, content)}, timeout=120.0).status_code


@pytest.mark.slow
def test_one_owners_bombs_hold_up_nobody_else(keyed: RunningService, bombs: list[float]) -> None:
    """While fourteen of one owner are read or wait, another's small upload is read at once."""
    hostile, honest = (make_key(keyed.database, owner).text for owner in ("alpha", "beta"))
    with (
        holder(keyed, hostile) as attacker,
        holder(keyed, honest) as client,
        ThreadPoolExecutor(BOMBS) as threads,
    ):
        sent = [threads.submit(upload, attacker, "x.mat", b"bomb") for _ in range(BOMBS)]
        until(lambda: bombs)
        time.sleep(0.5)  # the others wait by now
        start = time.monotonic()
        assert upload(client, "x.csv", FLIGHT) == 201
        took_s = time.monotonic() - start
        print(f"a small upload next to {BOMBS} bombs of another owner: {took_s:.2f} s")
        assert took_s < OTHERS_WAIT_S
        assert len(bombs) < BOMBS, "nobody waited"
        assert {answer.result() for answer in sent} <= {422, 503}


def test_one_owners_bodies_leave_room_for_the_others(keyed: RunningService) -> None:
    """Large bodies that one owner keeps sending take half of what all may; another's is received."""
    hostile, honest = (make_key(keyed.database, owner).text for owner in ("alpha", "beta"))
    at = urlsplit(keyed.url)
    head = f"POST /identify HTTP/1.1\r\nHost: {at.hostname}\r\nAuthorization: Bearer {hostile}\r\n"
    head += f"Content-Type: application/json\r\nContent-Length: {BODY_BYTES}\r\n\r\n"
    with ExitStack() as stack:
        for _ in range(BODIES_AT_ONCE // 2):
            link = stack.enter_context(socket.create_connection((at.hostname, at.port), timeout=30.0))
            link.sendall(head.encode() + b" " * (BODY_BYTES - 1))
        with holder(keyed, hostile) as attacker, holder(keyed, honest) as client:
            body = b" " * BODY_BYTES

            def refused() -> Any:
                answer = attacker.post("/identify", content=body, headers=JSON)
                return answer.status_code == 503 and fault(answer, 503)

            assert "yours" in until(refused)["detail"]
            assert client.post("/identify", content=body, headers=JSON).status_code == 400
