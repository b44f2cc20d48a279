"""Headers above 32 KiB are refused, however they arrive, and those below pass."""

from __future__ import annotations

import json
import socket
import time
from collections.abc import Iterable
from urllib.parse import urlsplit

import pytest

from app.http.server import MAX_HEADER_BYTES
from tests.app.hostile.api_process import read_all
from tests.app.request_documents import simulate_document
from tests.app.running_service import RunningService

GET = b"GET /livez HTTP/1.1\r\nHost: 127.0.0.1\r\n"
POST = b"POST /validate/simulate HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n"
CHUNKED = POST + b"Transfer-Encoding: chunked\r\n\r\n"
BODY = json.dumps(simulate_document()).encode()
CHUNK = b"%x\r\n%b\r\n" % (len(BODY), BODY)
CLOSE = b"Connection: close\r\n"
TOO_LARGE, TOO_LONG = (431, "headers_too_large"), (414, "address_too_long")


def filled(head: bytes, size: int) -> bytes:
    """A request of headers alone, of exactly this size."""
    return head + b"X: " + b"y" * (size - len(head) - 7) + b"\r\n\r\n"


def many(size: int) -> bytes:
    """Header lines of this size."""
    return b"X: y\r\n" * (size // 6)


def answers(service: RunningService, pieces: Iterable[bytes], pause_s: float = 0.0) -> bytes:
    """What the server says to these pieces until it hangs up."""
    at = urlsplit(service.url)
    with socket.create_connection((at.hostname, at.port), timeout=20.0) as link:
        try:
            for piece in pieces:
                link.sendall(piece)
                time.sleep(pause_s)
        except (BrokenPipeError, ConnectionResetError):
            pass
        return read_all(link)


def last_problem(answer: bytes) -> tuple[int, str]:
    """Status and code of the last of some answers."""
    head, _, body = answer[answer.rindex(b"HTTP/1.1 ") :].partition(b"\r\n\r\n")
    assert b"application/problem+json" in head.lower(), answer[:500]
    assert b"connection: close" in head.lower()
    problem = json.loads(body)
    assert "32 KiB" in problem["hint"]
    return int(head.split()[1]), problem["code"]


def in_pieces(data: bytes, size: int) -> list[bytes]:
    """The same bytes in pieces."""
    return [data[at : at + size] for at in range(0, len(data), size)]


LARGE: dict[str, tuple[list[bytes], tuple[int, str]]] = {
    "one byte too much": ([filled(GET, MAX_HEADER_BYTES + 1)], TOO_LARGE),
    "one large header": ([filled(GET, 60_000)], TOO_LARGE),
    "blanks around a value": ([GET + b"X:" + b" " * 60_000 + b"y\r\n\r\n"], TOO_LARGE),
    "a folded header": ([GET + b"X: y\r\n" + b" yyyyyyy\r\n" * 6_000 + b"\r\n"], TOO_LARGE),
    "many small headers": ([GET + many(60_000) + b"\r\n"], TOO_LARGE),
    "lines that end in a line feed": (
        [(GET + many(60_000)).replace(b"\r\n", b"\n") + b"\n"],
        TOO_LARGE,
    ),
    "in pieces": (in_pieces(filled(GET, 60_000), 7_000), TOO_LARGE),
    "no end": ([GET + many(60_000)], TOO_LARGE),
    "with a body": ([POST + many(60_000) + b"Content-Length: 2\r\n\r\n{}"], TOO_LARGE),
    "the second of two requests": ([GET + b"\r\n" + filled(GET, 60_000)], TOO_LARGE),
    "a long address": ([b"GET /" + b"y" * 60_000 + b" HTTP/1.1\r\nHost: x\r\n\r\n"], TOO_LONG),
    "a long query in pieces": (
        in_pieces(b"GET /jobs?label=" + b"y" * 60_000 + b" HTTP/1.1\r\nHost: x\r\n\r\n", 9_000),
        TOO_LONG,
    ),
    "an address without an end": ([b"GET /" + b"y" * 60_000], TOO_LONG),
    "after a chunked body": ([CHUNKED + CHUNK + b"0\r\n" + many(60_000) + b"\r\n"], TOO_LARGE),
    "after a chunked body, in pieces": (
        [CHUNKED, CHUNK + b"0\r\n", *in_pieces(many(60_000) + b"\r\n", 9_000)],
        TOO_LARGE,
    ),
    "of a chunk": ([CHUNKED + b"2;x=" + b"y" * 60_000 + b"\r\n{}\r\n0\r\n\r\n"], TOO_LARGE),
}


@pytest.mark.parametrize("pause_s", [0.0, 0.01], ids=["at once", "packet by packet"])
@pytest.mark.parametrize("name", LARGE)
def test_large_headers_are_refused(service: RunningService, name: str, pause_s: float) -> None:
    """A problem document with the limit in its hint, a closed connection, and nobody else is harmed."""
    pieces, expected = LARGE[name]
    assert last_problem(answers(service, pieces, pause_s)) == expected
    assert service.client.get("/livez").status_code == 200


@pytest.mark.parametrize(
    "request_",
    [
        filled(GET + CLOSE, MAX_HEADER_BYTES),
        filled(
            b"GET /livez?" + b"y" * 20_000 + b" HTTP/1.1\r\nHost: 127.0.0.1\r\n" + CLOSE, MAX_HEADER_BYTES
        ),
        filled(GET, 1_000) * 60 + GET + CLOSE + b"\r\n",
        CHUNKED.replace(b"\r\n\r\n", b"\r\n" + CLOSE + b"\r\n") + CHUNK + b"0\r\n" + many(20_000) + b"\r\n",
    ],
    ids=["32 KiB of headers", "a long address", "many requests in one piece", "fields after a body"],
)
@pytest.mark.parametrize("size", [2**20, 5_000], ids=["at once", "in pieces"])
def test_what_is_within_the_limit_passes(service: RunningService, request_: bytes, size: int) -> None:
    """The limit is one of each request, and not of what arrives together."""
    answer = answers(service, in_pieces(request_, size))
    assert answer.startswith(b"HTTP/1.1 200"), answer[:500]
    assert answer.count(b"HTTP/1.1 ") == answer.count(b"HTTP/1.1 200") == max(1, request_.count(GET))
