"""Clients that take their time, and those that speak no HTTP: hung up on, while the others are served."""

from __future__ import annotations

import json
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress

import pytest

from tests.app.hostile.api_process import ApiProcess, Onlooker, api_process, read_all
from tests.app.request_documents import identify_document
from tests.waiting import until

LIMIT_S = 1.0  # of headers, bodies and readers in these tests
PATIENCE_S = 15.0  # the machine of the tests is a busy one
MAX_CONNECTIONS = 260
SLOW = 200
GET = b"GET /livez HTTP/1.1\r\nHost: 127.0.0.1\r\n"
POST = b"POST /identify HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n"


@pytest.fixture(scope="module")
def api(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ApiProcess]:
    """An API with little patience."""
    with api_process(
        tmp_path_factory.mktemp("api"),
        header_timeout_s=LIMIT_S,
        body_grace_s=LIMIT_S,
        write_timeout_s=LIMIT_S,
        keep_alive_s=0.5,
        max_connections=MAX_CONNECTIONS,
    ) as running:
        yield running


def problem(answer: bytes) -> tuple[int, str]:
    """Status and code of a raw answer that is a problem document."""
    head, _, body = answer.partition(b"\r\n\r\n")
    assert b"application/problem+json" in head.lower(), answer
    document = json.loads(body)
    assert document["hint"]
    return int(head.split()[1]), document["code"]


def dribble(link: socket.socket, piece: bytes) -> bytes:
    """Send a piece every tenth of a second until the other end hangs up; give what it said."""
    link.settimeout(0.1)
    said = b""
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        with suppress(TimeoutError):
            try:
                link.sendall(piece)
                got = link.recv(65_536)
            except (BrokenPipeError, ConnectionResetError):
                return said
            if not got:
                return said
            said += got
    pytest.fail("the server goes on waiting")


def test_headers_that_dribble_are_cut_off(api: ApiProcess) -> None:
    """A header a tenth of a second prolongs nothing: 408, and the connection is closed."""
    with api.connect() as link:
        link.sendall(GET)
        assert problem(dribble(link, b"X: y\r\n")) == (408, "slow_headers")


def test_silence_is_cut_off(api: ApiProcess) -> None:
    """A connection without a request is closed without a word."""
    with api.connect() as link:
        assert read_all(link) == b""


@pytest.mark.slow
def test_silence_after_an_answer_is_cut_off(api: ApiProcess) -> None:
    """A connection that is kept for a next request is closed when none comes."""
    with api.connect() as link:
        link.sendall(GET + b"\r\n")
        answer = read_all(link)  # to the end of the connection
        assert answer.startswith(b"HTTP/1.1 200")


def test_the_second_request_has_its_own_time(api: ApiProcess) -> None:
    """On a kept connection a dribbled second header is cut off as the first would be."""
    with api.connect() as link:
        link.sendall(GET + b"\r\n")
        assert link.recv(65_536).startswith(b"HTTP/1.1 200")
        link.sendall(GET)
        assert b"slow_headers" in dribble(link, b"X: y\r\n")


@pytest.mark.parametrize(
    "framing", [b"Content-Length: 100000\r\n\r\n", b"Transfer-Encoding: chunked\r\n\r\n"]
)
def test_bodies_that_dribble_are_cut_off(api: ApiProcess, framing: bytes) -> None:
    """With or without a length: 408 when the time is over that its bytes have earned."""
    with api.connect() as link:
        link.sendall(POST + framing)
        piece = b"1\r\n \r\n" if b"chunked" in framing else b" "
        assert problem(dribble(link, piece)) == (408, "slow_body")


def test_forms_that_dribble_are_cut_off(api: ApiProcess) -> None:
    """An upload is no exception."""
    head = b"POST /trajectories HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 100000\r\n"
    head += b"Content-Type: multipart/form-data; boundary=b\r\n\r\n"
    with api.connect() as link:
        link.sendall(head + b'--b\r\nContent-Disposition: form-data; name="file"; filename="x.csv"\r\n\r\n')
        assert problem(dribble(link, b"1")) == (408, "slow_body")


def test_a_body_nobody_reads_holds_no_connection(api: ApiProcess) -> None:
    """A request that is answered before its body was sent is over soon after."""
    with api.connect() as link:
        link.sendall(b"POST /nowhere HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 100000\r\n\r\n")
        assert b"404" in dribble(link, b" ")[:20]


@pytest.mark.slow
def test_a_steady_body_is_waited_for(api: ApiProcess) -> None:
    """A body slower than its grace but faster than the least rate is read to its end."""
    body = json.dumps(identify_document()).encode()
    pieces = [body[at : at + 8192] for at in range(0, len(body), 8192)]
    with api.connect() as link:
        link.sendall(POST + b"Content-Length: %d\r\nConnection: close\r\n\r\n" % len(body))
        start = time.monotonic()
        for piece in pieces:
            link.sendall(piece)
            time.sleep(0.25)  # 32 kB/s
        assert time.monotonic() - start > LIMIT_S
        assert b"202" in read_all(link)[:20]


@pytest.mark.slow
def test_a_reader_that_does_not_read_is_cut_off(api: ApiProcess) -> None:
    """A large answer is not kept for a client that takes nothing of it."""
    rows = "".join(f"{0.005 * i:.3f},0.1234567,0.1234567,0.1234567,0.1234567,{i}e-6\n" for i in range(60_000))
    content = ("t,sweep_left,sweep_right,phi,theta,psi\n" + rows).encode()
    stored = api.client.post("/trajectories", files={"file": ("x.csv", content)})
    assert stored.status_code == 201, stored.text
    whole = len(api.client.get(stored.headers["location"]).content)
    with socket.socket() as link:
        link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        link.connect(("127.0.0.1", api.port))
        link.sendall(f"GET {stored.headers['location']} HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode())
        time.sleep(4 * LIMIT_S)
        link.settimeout(PATIENCE_S)
        assert len(read_all(link)) < whole


@pytest.mark.slow
def test_an_idle_event_stream_is_left_alone(api: ApiProcess) -> None:
    """Nothing to say is no offence: a stream lives on beyond all limits, with its signs of life."""
    job = api.client.post("/identify", json=identify_document()).json()["id"]
    with api.client.stream("GET", f"/jobs/{job}/events") as stream:
        start = time.monotonic()
        for line in stream.iter_lines():
            if line.startswith(":") and time.monotonic() - start > 4 * LIMIT_S:
                break
        else:
            pytest.fail("the stream ended")


ATTACKS: dict[str, tuple[bytes, bytes]] = {
    "headers": (GET, b"X: y\r\n"),
    "bodies": (POST + b"Content-Length: 100000\r\n\r\n", b" "),
    "silence": (b"", b""),
}


@pytest.mark.parametrize(
    "kind",
    [
        "headers",
        pytest.param("bodies", marks=pytest.mark.slow),
        pytest.param("silence", marks=pytest.mark.slow),
    ],
)
def test_many_slow_clients_hold_up_nobody(api: ApiProcess, kind: str) -> None:
    """Two hundred at once: the others are answered, and all two hundred are gone soon after."""
    start, piece = ATTACKS[kind]
    with ExitStack() as stack, Onlooker(api) as onlooker:
        links = [stack.enter_context(api.connect()) for _ in range(SLOW)]
        for link in links:
            link.sendall(start)

        def gone() -> bool:
            links[:] = [link for link in links if not hung_up(link, piece)]
            return not links

        until(gone, PATIENCE_S, 0.1, seen=lambda: f"{len(links)} are still there")
    print(
        f"{kind}: {onlooker.answers} answers, slowest {1000 * onlooker.slowest_s:.0f} ms, "
        f"+{onlooker.grown_mib:.0f} MiB"
    )
    assert onlooker.failures == []
    assert onlooker.answers > 0
    assert onlooker.slowest_s < 3.0
    assert onlooker.grown_mib < 64.0


def hung_up(link: socket.socket, piece: bytes) -> bool:
    """Send a piece; whether the other end is gone."""
    link.settimeout(0.0)
    try:
        link.send(piece)
        return link.recv(65_536) == b""
    except BlockingIOError:
        return False
    except OSError:
        return True


def test_one_connection_too_many_is_reported(api: ApiProcess) -> None:
    """Beyond the limit a connection gets 503 at once; when others end there is room again."""
    answers = []

    def is_refused() -> bool:
        """Ask while all connections are taken; on a busy machine these may reach their time limit before."""
        with ExitStack() as stack:
            for _ in range(MAX_CONNECTIONS):
                stack.enter_context(api.connect())
            answers.append([api.raw(GET + b"\r\n") for _ in range(5)][-1])
        return not answers[-1].startswith(b"HTTP/1.1 200")

    until(is_refused, PATIENCE_S, 0.1)
    assert problem(answers[-1]) == (503, "service_busy")
    assert b"retry-after" in answers[-1].lower()
    requested = GET + b"Connection: close\r\n\r\n"
    until(lambda: api.raw(requested).startswith(b"HTTP/1.1 200"), PATIENCE_S, 0.1)


GARBAGE: dict[str, tuple[bytes, int]] = {
    "no HTTP": (b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + b"x" * 100 + b"\r\n\r\n", 400),
    "HTTP/2": (b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n", 421),
    "a path that is no ASCII": (b"GET /\xff\xfe HTTP/1.1\r\nHost: x\r\n\r\n", 400),
    "a space in the path": (b"GET /a b HTTP/1.1\r\nHost: x\r\n\r\n", 400),
    "a header with a zero": (GET + b"X: \x00\r\n\r\n", 400),
    "a header without a name": (GET + b": x\r\n\r\n", 400),
    "no host": (b"GET /livez HTTP/1.1\r\n\r\n", 400),
    "a header of a megabyte": (GET + b"X: " + b"y" * 2**20 + b"\r\n\r\n", 431),
    "a path of a megabyte": (b"GET /" + b"y" * 2**20 + b" HTTP/1.1\r\n\r\n", 414),
    "a hundred thousand headers": (GET + b"X: y\r\n" * 100_000 + b"\r\n", 431),
    "two lengths": (POST + b"Content-Length: 5\r\nContent-Length: 6\r\n\r\nabcde", 400),
    "a negative length": (POST + b"Content-Length: -5\r\n\r\nabcde", 400),
    "a length in words": (POST + b"Content-Length: five\r\n\r\nabcde", 400),
    "a chunk that is none": (POST + b"Transfer-Encoding: chunked\r\n\r\nxyz\r\n", 400),
    "an unknown coding": (POST + b"Transfer-Encoding: gzip, chunked\r\n\r\n0\r\n\r\n", 400),
}


@pytest.mark.parametrize("name", GARBAGE)
def test_what_is_no_request_is_reported(api: ApiProcess, name: str) -> None:
    """A problem document and a closed connection."""
    request, status = GARBAGE[name]
    got, _ = problem(api.raw(request))
    if name == "an unknown coding":
        assert got in (400, 501)
    else:
        assert got == status
    assert api.client.get("/livez").status_code == 200


@pytest.mark.parametrize(
    "act",
    [
        lambda link: link.shutdown(socket.SHUT_WR),
        lambda link: link.close(),
        lambda link: (
            link.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0"),
            link.close(),
        ),
    ],
    ids=["half closed", "closed", "reset"],
)
def test_bodies_that_end_early_harm_nobody(api: ApiProcess, act: Callable[[socket.socket], object]) -> None:
    """A length that promises more than comes is nobody's 500."""
    before = api.log.read_text().count("Traceback")
    link = api.connect()
    link.sendall(POST + b"Content-Length: 100\r\n\r\n{")
    time.sleep(0.2)
    act(link)
    link.close()
    assert api.client.get("/livez").status_code == 200
    time.sleep(0.2)
    assert api.log.read_text().count("Traceback") == before


def test_a_body_longer_than_announced_is_the_next_request(api: ApiProcess) -> None:
    """What comes after the announced length is read as the next request, and is none."""
    answer = api.raw(POST + b"Content-Length: 2\r\n\r\n{}garbage\r\n\r\n")
    assert answer.startswith(b"HTTP/1.1 422")
    assert b"HTTP/1.1 400" in answer


def test_pipelined_requests_are_answered_in_order(api: ApiProcess) -> None:
    """Many requests in one piece are as good as one after the other."""
    last = GET + b"Connection: close\r\n\r\n"
    answer = api.raw((GET + b"\r\n") * 20 + last)
    assert answer.count(b"HTTP/1.1 200") == 21


def test_nothing_of_all_this_was_an_error_of_the_service(api: ApiProcess) -> None:
    """No traceback in the log, no thread left behind."""
    assert "Traceback" not in api.log.read_text()
    assert threading.active_count() < 20
