"""Laws of one POST, against real HTTPS servers with certificates of the test's own authority."""

from __future__ import annotations

import asyncio
import base64
import hmac
import json
import time
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler

import pytest
from standardwebhooks import Webhook, WebhookVerificationError

from app.webhooks.addresses import AddressPolicy
from app.webhooks.posting import MAX_ANSWER_BYTES, Answer, Poster, Timeouts
from app.webhooks.sender import signed_headers
from app.webhooks.service import new_secret
from tests.app.webhooks.receiver import HOST, TO_LOOPBACK, Authority, Receiver, at_loopback, receiver, status

BODY = b'{"type":"webhook.test"}'


@pytest.fixture(scope="module")
def authority() -> Authority:
    """A certificate authority."""
    return Authority()


@pytest.fixture
def server(authority: Authority) -> Iterator[Receiver]:
    """An HTTPS receiver with a certificate for its name."""
    with receiver(authority.server()) as running:
        yield running


def post(
    url: str,
    authority: Authority | None,
    policy: AddressPolicy = TO_LOOPBACK,
    timeouts: Timeouts | None = None,
) -> Answer:
    """Post once, believing `authority` or the usual ones."""

    async def once() -> Answer:
        poster = Poster(policy, authority and authority.trust(), timeouts or Timeouts())
        return await poster.post(url, {"webhook-id": "msg_1"}, BODY)

    return asyncio.run(once())


def test_a_message_arrives_as_it_is(server: Receiver, authority: Authority) -> None:
    """Body, path, query and Host arrive unchanged at the name's pinned address."""
    assert post(server.url("/a%2Fb?token=x%20y"), authority) == Answer(204)
    (got,) = server.received
    assert (got.path, got.body) == ("/a%2Fb?token=x%20y", BODY)
    assert got.headers["host"] == f"{HOST}:{server.port}"
    assert got.headers["content-type"] == "application/json"
    assert got.headers["webhook-id"] == "msg_1"


def test_signature_is_that_of_the_standard() -> None:
    """HMAC-SHA-256 of id, second and body as the standard's text says; refused for any other of these."""
    secret = new_secret()
    headers = signed_headers(secret, "msg_1", time.time(), BODY)
    signed = b"msg_1." + headers["webhook-timestamp"].encode() + b"." + BODY
    key = base64.b64decode(secret.removeprefix("whsec_"))
    mac = base64.b64encode(hmac.digest(key, signed, "sha256")).decode()
    assert headers["webhook-signature"] == f"v1,{mac}"
    assert Webhook(secret).verify(BODY, headers) == json.loads(BODY)
    for other_secret, body, other_headers in (
        (new_secret(), BODY, headers),
        (secret, BODY + b" ", headers),
        (secret, BODY, {**headers, "webhook-id": "msg_2"}),
        (secret, BODY, {**headers, "webhook-timestamp": str(int(time.time()) + 1)}),
    ):
        with pytest.raises(WebhookVerificationError):
            Webhook(other_secret).verify(body, other_headers)


def test_a_name_that_changes_its_mind_is_not_connected_to() -> None:
    """Public when it was checked, loopback when it is sent to: refused, and no connection is ever made."""
    answers = iter([["93.184.216.34"], ["127.0.0.1"], ["::1"], ["::ffff:127.0.0.1"]])
    policy = AddressPolicy(resolve=lambda _host, _port: next(answers))
    with receiver() as inside:
        url = f"https://rebinding.example:{inside.port}/"
        policy.check_now(url)
        for _ in range(3):
            answer = post(url, None, policy)
            assert answer.status is None
            assert (answer.error or "").startswith("Refused:")
        assert inside.connections == 0


def test_each_try_looks_up_once(server: Receiver, authority: Authority) -> None:
    """The address that was checked is the one that is connected to: there is no second look-up."""
    requested: list[str] = []

    def resolve(host: str, _port: int) -> list[str]:
        requested.append(host)
        return ["127.0.0.1"] if len(requested) == 1 else ["127.0.0.99"]

    assert post(server.url(), authority, AddressPolicy(allow_private=True, resolve=resolve)).delivered
    assert requested == [HOST]


def test_the_next_address_is_tried(server: Receiver, authority: Authority) -> None:
    """Where the first of a name's addresses does not answer, the second does."""
    policy = AddressPolicy(allow_private=True, resolve=lambda _host, _port: ["127.0.0.9", "127.0.0.1"])
    assert post(server.url(), authority, policy).delivered


def test_certificates_are_verified(authority: Authority) -> None:
    """A certificate of another name, or of an authority that is not believed, ends the try unsent."""
    with receiver(authority.server("other.example.test")) as other:
        answer = post(other.url(), authority)
        assert (answer.status, other.received) == (None, [])
        assert "certificate" in (answer.error or "")
    with receiver(authority.server()) as unknown:
        answer = post(unknown.url(), None)
        assert (answer.status, unknown.received) == (None, [])
        assert "certificate" in (answer.error or "")


def test_redirects_are_failures(server: Receiver, authority: Authority) -> None:
    """A redirect is not followed, wherever it leads."""
    with receiver() as inside:

        def redirect(handler: BaseHTTPRequestHandler, _number: int) -> None:
            status(handler, 307, Location=inside.url())

        server.answer = redirect
        answer = post(server.url(), authority)
        assert (answer.status, answer.delivered) == (307, False)
        assert inside.connections == 0


def test_proxies_of_the_environment_are_not_requested(
    server: Receiver, authority: Authority, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A proxy would connect to addresses that nobody has checked."""
    with receiver() as proxy:
        for name in ("HTTPS_PROXY", "https_proxy", "ALL_PROXY", "HTTP_PROXY"):
            monkeypatch.setenv(name, f"http://127.0.0.1:{proxy.port}")
        assert post(server.url(), authority).delivered
        assert proxy.connections == 0


def test_a_slow_drip_ends_with_the_patience(server: Receiver, authority: Authority) -> None:
    """A receiver that sends its headers a byte at a time is given up when the total time is over."""

    def drip(handler: BaseHTTPRequestHandler, _number: int) -> None:
        for byte in b"HTTP/1.1 200 OK\r\nX-Slow: " + b"a" * 400:
            handler.wfile.write(bytes([byte]))
            handler.wfile.flush()
            time.sleep(0.05)

    server.answer = drip
    start = time.monotonic()
    answer = post(server.url(), authority, timeouts=Timeouts(connect_s=5.0, read_s=5.0, total_s=1.0))
    assert (answer.status, answer.error) == (None, "There was no answer in time.")
    assert time.monotonic() - start < 10.0  # the drip would last 20 s


def test_an_endless_answer_is_not_read(server: Receiver, authority: Authority) -> None:
    """Of the body no more than the limit is read; what counts is the status."""
    written = 0

    def flood(handler: BaseHTTPRequestHandler, _number: int) -> None:
        nonlocal written
        handler.send_response(200)
        handler.end_headers()
        for _ in range(1000):
            handler.wfile.write(b"x" * 65536)
            written += 65536

    server.answer = flood
    assert post(server.url(), authority).delivered
    # what is beyond the limit lay in the buffers of two sockets
    assert written < 1000 * 65536
    assert MAX_ANSWER_BYTES == 64 * 1024


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("https://hooks.example.test:1024/", "No (secure) connection"),
        ("https://a..b:8443/", "not known"),
    ],
)
def test_failures_are_answers(url: str, words: str) -> None:
    """Every failure is reported in a sentence and raises nothing."""

    def resolve(host: str, port: int) -> list[str]:
        host.encode("idna")
        return at_loopback(host, port)

    assert words in (post(url, None, AddressPolicy(allow_private=True, resolve=resolve)).error or "")


def test_what_the_receiver_asks_for_is_heard(server: Receiver, authority: Authority) -> None:
    """Retry-After comes with the answer."""
    server.answer = lambda handler, _: status(handler, 503, Retry_After="120")
    assert post(server.url(), authority) == Answer(503, "The receiver answered 503.", 120.0)
