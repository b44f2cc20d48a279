"""Laws of authentication over HTTP; those of the rows are in test_keyring, on both databases."""

from __future__ import annotations

import socket
import time

import httpx
import pytest
from sqlalchemy import update

from app.database import database_time
from app.keys import repository
from app.keys.keyring import FRESH_S
from app.keys.refusal_limit import BURST
from app.keys.secret import KeyText
from app.keys.service import revoke_key
from app.tables import api_keys
from tests.app.key_holders import bearer, holder, make_key
from tests.app.request_documents import simulate_document
from tests.app.running_service import RunningService
from tests.waiting import until

FROM_PROXY = "X-Forwarded-For"  # the server believes its own machine: tests come from addresses of their own
PATIENCE_S = 10.0


def requested(service: RunningService, headers: dict[str, str], path: str = "/jobs") -> httpx.Response:
    """Send a request with these headers."""
    return service.client.get(path, headers=headers)


def test_a_key_opens(keyed_on_sqlite: RunningService) -> None:
    """A valid key is let in, and the answer is not to be kept by any cache."""
    with holder(keyed_on_sqlite, make_key(keyed_on_sqlite.database).text) as client:
        answer = client.get("/jobs")
    assert answer.status_code == 200
    assert answer.headers["cache-control"] == "no-store"


def test_whatever_is_wrong_with_a_key_the_answer_is_the_same(keyed_on_sqlite: RunningService) -> None:
    """Unknown, forged, expired, revoked, malformed: one 401 that says how to authenticate, and no more."""
    database = keyed_on_sqlite.database
    good, late, gone = make_key(database), make_key(database, expires_in_s=-1.0), make_key(database)
    with database.write() as session:
        revoke_key(session, gone.key.prefix)
    wrong = {
        "unknown": f"Bearer {KeyText.new().text()}",
        "forged": f"Bearer {KeyText(good.key.prefix, KeyText.new().secret).text()}",
        "expired": f"Bearer {late.text}",
        "revoked": f"Bearer {gone.text}",
        "malformed": "Bearer mid_nothing",
        "basic": "Basic bWlkOm1pZA==",
        "empty": "",
        "no scheme": good.text,
    }
    answers = {"none": requested(keyed_on_sqlite, {"X-Request-ID": "same"})}
    for number, (name, header) in enumerate(wrong.items()):
        reported = {"Authorization": header, "X-Request-ID": "same", FROM_PROXY: f"203.0.113.{number}"}
        answers[name] = requested(keyed_on_sqlite, reported)
    for name, answer in answers.items():
        assert answer.status_code == 401, name
        assert answer.content == answers["none"].content, name
        assert answer.headers["www-authenticate"] == 'Bearer realm="MorphID"'
        assert answer.headers["cache-control"] == "no-store"
        assert answer.json()["code"] == "unauthorized"


def test_two_authorizations_are_none(keyed_on_sqlite: RunningService) -> None:
    """A request that carries two keys, of which a proxy may have checked the other one, is refused."""
    key = make_key(keyed_on_sqlite.database).text
    headers = [("Authorization", f"Bearer {key}"), ("Authorization", f"Bearer {key}")]
    assert keyed_on_sqlite.client.get("/jobs", headers=headers).status_code == 401


def test_keys_are_read_from_the_header_only(keyed_on_sqlite: RunningService) -> None:
    """A key in the address or a cookie, where logs and other pages find it, opens nothing."""
    key = make_key(keyed_on_sqlite.database).text
    for query in ("api_key", "key", "access_token", "token"):
        assert keyed_on_sqlite.client.get("/jobs", params={query: key}).status_code == 401
    assert requested(keyed_on_sqlite, {"Cookie": f"Authorization={key}; api_key={key}"}).status_code == 401
    assert requested(keyed_on_sqlite, {"X-API-Key": key}).status_code == 401


def test_the_scheme_has_no_case(keyed_on_sqlite: RunningService) -> None:
    """``bearer`` is ``Bearer`` (RFC 9110, section 11.1)."""
    key = make_key(keyed_on_sqlite.database).text
    assert requested(keyed_on_sqlite, {"Authorization": f"bEARER {key}"}).status_code == 200


@pytest.mark.parametrize("path", ["/", "/docs", "/openapi.json", "/livez", "/readyz", "/static/app.js"])
def test_the_public_list_needs_no_key(keyed_on_sqlite: RunningService, path: str) -> None:
    """Pages and probes are public, and a wrong key in the request does not matter there."""
    assert requested(keyed_on_sqlite, {}, path).status_code in (200, 503)
    assert requested(keyed_on_sqlite, bearer("nonsense"), path).status_code in (200, 503)


@pytest.mark.parametrize(
    "path",
    [
        *("/static/../jobs", "/static/%2e%2e/jobs", "/static//jobs", "/livez/../jobs", "/docs/..;/jobs"),
        *("//jobs", "/jobs/", "/./jobs", "/JOBS", "/livez/", "/openapi.json/", "/static", "/nothing"),
    ],
)
def test_no_spelling_of_a_path_goes_round_the_gate(keyed_on_sqlite: RunningService, path: str) -> None:
    """Whatever is not exactly on the public list is refused, or is nothing."""
    host, port = keyed_on_sqlite.url.removeprefix("http://").split(":")
    with socket.create_connection((host, int(port)), timeout=PATIENCE_S) as connection:
        connection.sendall(f"GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n".encode())
        status = int(connection.makefile("rb").readline().split()[1])
    assert status in (401, 404)


def test_no_body_is_read_for_a_stranger(keyed_on_sqlite: RunningService) -> None:
    """The refusal comes while the body is still to be sent."""
    host, port = keyed_on_sqlite.url.removeprefix("http://").split(":")
    with socket.create_connection((host, int(port)), timeout=PATIENCE_S) as connection:
        head = f"POST /identify HTTP/1.1\r\nHost: {host}\r\nContent-Type: application/json\r\n"
        connection.sendall(f"{head}Content-Length: 8000000\r\n\r\n{{".encode())
        assert b" 401 " in connection.makefile("rb").readline()


def test_a_revoked_key_is_refused_within_seconds(keyed_on_sqlite: RunningService) -> None:
    """A key in constant use opens nothing `FRESH_S` after it was revoked."""
    made = make_key(keyed_on_sqlite.database)
    with holder(keyed_on_sqlite, made.text) as client:
        assert client.get("/jobs").status_code == 200
        with keyed_on_sqlite.database.write() as session:
            revoke_key(session, made.key.prefix)
        revoked_at = time.monotonic()
        while client.get("/jobs").status_code == 200:
            # one request may be on its way when the time is over; a busy machine takes its time for it
            assert time.monotonic() - revoked_at < FRESH_S + PATIENCE_S
        print(f"refused {time.monotonic() - revoked_at:.2f} s after it was revoked")


def test_a_stream_ends_with_its_key(keyed_on_sqlite: RunningService) -> None:
    """A client that follows a job gets nothing more once its key is revoked; the service is unaffected."""
    made = make_key(keyed_on_sqlite.database)
    with holder(keyed_on_sqlite, made.text) as client:
        job = client.post("/simulate", json=simulate_document()).raise_for_status().json()["id"]
        claim = keyed_on_sqlite.claim(job)
        with client.stream("GET", f"/jobs/{job}/events") as stream:
            lines = stream.iter_lines()
            assert next(lines)
            with keyed_on_sqlite.database.write() as session:
                revoke_key(session, made.key.prefix)
            deadline = time.monotonic() + FRESH_S + PATIENCE_S
            heard: list[str] = []
            for number in range(10**6):
                keyed_on_sqlite.progress(claim, fraction=0.5, message=f"secret {number}")
                try:
                    heard.append(next(lines))
                except StopIteration:
                    break
                assert time.monotonic() < deadline
        # comes after the end of the stream: the row is there, and nobody with this key hears of it
        assert client.get(f"/jobs/{job}").status_code == 401
    with holder(keyed_on_sqlite, make_key(keyed_on_sqlite.database).text) as client:
        assert client.get(f"/jobs/{job}").json()["status"] == "running"


def test_the_last_use_is_seen(keyed_on_sqlite: RunningService) -> None:
    """The operator sees when a key was last used, though no request waits for the note."""
    made = make_key(keyed_on_sqlite.database)
    with holder(keyed_on_sqlite, made.text) as client:
        assert client.get("/me").status_code == 200

    def last_use() -> object:
        with keyed_on_sqlite.database.read() as session:
            return repository.key_by_id(session, made.key.id).last_used_at

    until(last_use, PATIENCE_S)


def test_guessing_is_limited(keyed_on_sqlite: RunningService) -> None:
    """An address that sends wrong keys has to wait; valid keys there or elsewhere are not delayed."""
    place = {FROM_PROXY: "198.51.100.7"}
    good = make_key(keyed_on_sqlite.database).text
    assert requested(keyed_on_sqlite, {**bearer(good), **place}).status_code == 200
    answers = [
        requested(keyed_on_sqlite, {**bearer(KeyText.new().text()), **place}) for _ in range(BURST + 5)
    ]
    statuses = [answer.status_code for answer in answers]
    assert statuses[:BURST] == [401] * BURST
    # the bucket may refill by one or two on a slow machine
    assert statuses[BURST:].count(429) >= 3
    limited = next(answer for answer in answers if answer.status_code == 429)
    assert limited.json()["code"] == "too_many_refusals"
    assert 1 <= int(limited.headers["retry-after"]) <= 6
    assert requested(keyed_on_sqlite, {**bearer(good), **place}).status_code == 200
    fresh = make_key(keyed_on_sqlite.database).text
    assert requested(keyed_on_sqlite, {**bearer(fresh), FROM_PROXY: "198.51.100.8"}).status_code == 200
    for _ in range(BURST):
        assert (
            requested(keyed_on_sqlite, {FROM_PROXY: "198.51.100.9"}).status_code == 401
        )  # no key is no guess
    assert requested(keyed_on_sqlite, {**bearer(fresh), FROM_PROXY: "198.51.100.9"}).status_code == 200


def test_me_tells_what_a_key_may_do(keyed_on_sqlite: RunningService) -> None:
    """Owner, scopes, quotas and use; never the secret."""
    made = make_key(keyed_on_sqlite.database, "laboratory")
    with keyed_on_sqlite.database.write() as session:
        later = database_time() + 1000.0
        chosen = update(api_keys).where(api_keys.c.id == made.key.id)
        session.execute(chosen.values(max_jobs_in_flight=3, expires_at=later))
    with holder(keyed_on_sqlite, made.text) as client:
        me = client.get("/me").json()
    assert me["owner"] == "laboratory"
    assert me["key"]["prefix"] == made.key.prefix
    assert me["key"]["expires_at"] is not None
    assert me["quotas"]["jobs_in_flight"] == {"used": 0, "limit": 3}
    assert me["quotas"]["flights_per_day"] == {"used": 0, "limit": None}
    assert made.text.rpartition("_")[2] not in str(me)
