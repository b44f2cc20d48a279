"""Laws of the body limit, over a real socket."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator

import pytest

from app.http.server import LINGER_S
from tests.app.running_service import RunningService

GIGABYTE = 2**30
CHUNK = b" " * 2**18


def endless(total: int, head: bytes = b"") -> Iterator[bytes]:
    """Stream `total` bytes."""
    yield head
    for _ in range(total // len(CHUNK)):
        yield CHUNK


@pytest.mark.parametrize("path", ["/identify", "/validate/identify", "/trajectories", "/jobs/job_x/cancel"])
@pytest.mark.parametrize("announced", ["announced", "chunked"])
def test_gigabyte_is_refused(service: RunningService, path: str, announced: str) -> None:
    """A gigabyte is refused with a problem document within two seconds, and nothing suffers."""
    headers = {"Content-Type": "application/json"}
    if announced == "announced":
        headers["Content-Length"] = str(GIGABYTE)
    start = time.perf_counter()
    answer = service.client.post(path, content=endless(GIGABYTE), headers=headers)
    took = time.perf_counter() - start
    if path == "/jobs/job_x/cancel" and announced == "chunked":
        assert answer.status_code == 404  # this one reads no body: it answers and hangs up
    else:
        assert answer.status_code == 413
        assert answer.json()["code"] == "body_too_large"
    assert took < 2.0
    assert service.client.get("/livez").status_code == 200


def test_gigabyte_upload_is_refused(service: RunningService) -> None:
    """The same for a well-formed multipart upload: the limit holds while the form is being read."""
    head = b'--b\r\nContent-Disposition: form-data; name="file"; filename="x.csv"\r\n\r\n'
    answer = service.client.post(
        "/trajectories",
        content=endless(GIGABYTE, head),
        headers={"Content-Type": "multipart/form-data; boundary=b"},
    )
    assert answer.status_code == 413


def test_body_at_the_limit_passes(service: RunningService) -> None:
    """A body of exactly the limit is read (and found to be no JSON); one byte more is refused."""
    headers = {"Content-Type": "application/json"}
    limit = service.settings.max_body_bytes
    assert service.client.post("/identify", content=b" " * limit, headers=headers).status_code == 400
    assert service.client.post("/identify", content=b" " * (limit + 1), headers=headers).status_code == 413


def test_nonsense_length_is_survived(service: RunningService) -> None:
    """A service survives nonsensical requests."""
    assert service.client.get("/livez", headers={"X-Long": "x" * 5000}).status_code == 200


def test_a_late_body_and_the_next_request_keep_the_connection(service: RunningService) -> None:
    """The rest of an answered request that comes together with the next one closes nothing afterwards."""
    url = service.client.base_url
    head = f"HTTP/1.1\r\nHost: {url.host}:{url.port}\r\n"
    ask = f"GET /livez {head}\r\n".encode()
    with socket.create_connection((url.host, url.port), timeout=10.0) as connection:

        def answer() -> bytes:
            found = b""
            while b"\r\n\r\n" not in found:
                piece = connection.recv(65536)
                assert piece, f"closed after {found!r}"
                found += piece
            return found.splitlines()[0]

        connection.sendall(f"POST /livez {head}Content-Length: 10\r\n\r\n12345".encode())
        assert answer().split()[1].startswith(b"4")
        connection.sendall(b"67890" + ask)
        assert b"200" in answer()
        time.sleep(LINGER_S + 0.5)
        connection.sendall(ask)
        assert b"200" in answer()
