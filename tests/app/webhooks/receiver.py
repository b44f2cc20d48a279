"""Receivers of webhooks as they are out there: honest, slow, redirecting, with all kinds of certificates."""

from __future__ import annotations

import json
import ssl
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import trustme

from app.webhooks.addresses import AddressPolicy
from tests.waiting import until

HOST = "hooks.example.test"  # what the certificate is made out to
NOBODY = f"https://{HOST}:1024/hook"  # nothing listens there
PLEASE_STOP_S = 5.0


@dataclass(frozen=True)
class Received:
    """One request that came in."""

    path: str
    headers: dict[str, str]
    body: bytes


@dataclass
class Receiver:
    """A server on loopback and the messages it received.

    Attributes
    ----------
    answer : callable
        ``(handler, number of the request)``: sends the answer.
    received, challenges : list
        What came; challenges are kept apart, and answered as documented.
    answers_challenges : bool
        Where it is False they are messages like others.
    connections : int
        Accepted, whatever came of them.
    """

    port: int = 0
    scheme: str = "https"
    received: list[Received] = field(default_factory=list)
    challenges: list[Received] = field(default_factory=list)
    answers_challenges: bool = True
    connections: int = 0
    answer: Callable[[BaseHTTPRequestHandler, int], None] = field(
        default=lambda handler, _: status(handler, 204)
    )

    def url(self, path: str = "/hook?token=1") -> str:
        """Address under the certificate's name (over TLS) or of this machine."""
        host = HOST if self.scheme == "https" else "127.0.0.1"
        return f"{self.scheme}://{host}:{self.port}{path}"

    def wait_for(self, count: int, within_s: float = 20.0) -> list[Received]:
        """Wait until so many requests have come."""
        until(lambda: len(self.received) >= count, within_s, seen=lambda: f"{len(self.received)} of {count}")
        return self.received


def status(handler: BaseHTTPRequestHandler, code: int, **headers: str) -> None:
    """Answer with a status alone."""
    handler.send_response(code)
    for name, value in headers.items():
        handler.send_header(name.replace("_", "-"), value)
    handler.send_header("Content-Length", "0")
    handler.end_headers()


def content(handler: BaseHTTPRequestHandler, sent: bytes) -> None:
    """Answer 200 with these bytes."""
    handler.send_response(200)
    handler.send_header("Content-Length", str(len(sent)))
    handler.end_headers()
    handler.wfile.write(sent)


def answer_json(handler: BaseHTTPRequestHandler, document: object) -> None:
    """Answer 200 with a JSON document."""
    content(handler, json.dumps(document).encode())


def challenge_in(body: bytes) -> str | None:
    """The challenge of a message that is one."""
    message = json.loads(body)
    return message["data"]["challenge"] if message["type"] == "webhook.challenge" else None


@contextmanager
def receiver(tls: ssl.SSLContext | None = None) -> Iterator[Receiver]:
    """Run a receiver on loopback while the block lasts."""
    state = Receiver(scheme="http" if tls is None else "https")

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers.get("Content-Length", "0")))
            headers = {name.lower(): value for name, value in self.headers.items()}
            came = Received(self.path, headers, body)
            if state.answers_challenges and (challenge := challenge_in(body)) is not None:
                state.challenges.append(came)
                answer_json(self, {"challenge": challenge})
                return
            state.received.append(came)
            state.answer(self, len(state.received))

        def log_message(self, *_words: object) -> None:
            pass

    class Server(ThreadingHTTPServer):
        daemon_threads = True

        def get_request(self) -> tuple[ssl.SSLSocket, object]:
            connection, address = self.socket.accept()
            state.connections += 1
            if tls is not None:
                connection.settimeout(PLEASE_STOP_S)
                connection = tls.wrap_socket(connection, server_side=True)
            return connection, address

        def handle_error(self, *_: object) -> None:
            pass  # senders that hang up are what the tests are about

    server = Server(("127.0.0.1", 0), Handler)
    state.port = server.server_address[1]
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True)
    thread.start()
    try:
        yield state
    finally:
        server.shutdown()
        server.server_close()
        thread.join(PLEASE_STOP_S)


@dataclass(frozen=True)
class Authority:
    """A certificate authority of the test."""

    authority: trustme.CA = field(default_factory=trustme.CA)

    def server(self, name: str = HOST) -> ssl.SSLContext:
        """TLS of a server that bears `name`."""
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        self.authority.issue_cert(name).configure_cert(context)
        return context

    def trust(self) -> ssl.SSLContext:
        """What a sender believes who believes this authority alone."""
        context = ssl.create_default_context()
        self.authority.configure_trust(context)
        return context


def at_loopback(_host: str, _port: int) -> list[str]:
    """Resolve every name to this machine."""
    return ["127.0.0.1"]


TO_LOOPBACK = AddressPolicy(allow_private=True, resolve=at_loopback)  # as if loopback were the internet
