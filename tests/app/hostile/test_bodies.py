"""JSON bodies and requests that mean harm: every one gets a documented 4xx with a way out, never a 5xx."""

from __future__ import annotations

import gzip
import json
from typing import Any

import httpx
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.app.calls import JSON, changed
from tests.app.request_documents import identify_document, sample_document
from tests.app.running_service import RunningService

PATHS = ("/identify", "/study", "/simulate", "/optimize", "/validate/identify", "/trajectories", "/webhooks")
DOCUMENTED = frozenset({400, 408, 413, 415, 422})
LARGE = 600_000  # bytes: beyond this a body is parsed by a process of its own


def send(service: RunningService, path: str, body: bytes, **headers: str) -> httpx.Response:
    """Post bytes."""
    return service.client.post(path, content=body, headers={**JSON, **headers})


def refused(answer: httpx.Response, status: int | None = None) -> dict[str, Any]:
    """The problem document of an answer that refuses."""
    assert answer.status_code in DOCUMENTED if status is None else answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    problem: dict[str, Any] = answer.json()
    assert problem["code"]
    assert problem["detail"]
    assert problem["hint"]
    assert "pointer" in problem
    return problem


def text(document: Any) -> bytes:
    """JSON as Python writes it."""
    return json.dumps(document).encode()


HUGE_KEY = b'{"' + b"x" * LARGE + b'": 1}'
MANY_KEYS = b"{" + b",".join(b'"%x":1' % number for number in range(700_000)) + b"}"
BODIES: dict[str, tuple[bytes, int]] = {
    "nothing": (b"", 400),
    "blank": (b"   ", 400),
    "not an object": (b"[1, 2, 3]", 422),
    "a number": (b"7", 422),
    "null": (b"null", 422),
    "NaN": (b'{"aircraft": NaN}', 422),
    "1e400": (b'{"aircraft": 1e400}', 422),
    "nested 100,000 deep": (b"[" * 100_000 + b"]" * 100_000, 400),
    "objects nested 9,000 deep": (b'{"a":' * 9_000 + b"1" + b"}" * 9_000, 400),
    "nested in a large body": (
        b'{"a": "' + b"x" * LARGE + b'", "b":' + b"[" * 90_000 + b"]" * 90_000 + b"}",
        400,
    ),
    "duplicate keys": (b'{"aircraft": 1, "aircraft": 2}', 400),
    "a lone surrogate": (rb'{"\ud800": "\udfff"}', 400),
    "the character zero": (rb'{"aircraft": "\u0000"}', 400),
    "a raw zero": (b'{"aircraft": "\x00"}', 400),
    "a huge integer": (b'{"aircraft": 1' + b"0" * 4000 + b"}", 422),
    "an integer of too many digits": (b'{"aircraft": 1' + b"0" * 5000 + b"}", 400),
    "very many keys": (MANY_KEYS, 400),
    "a huge key": (HUGE_KEY, 422),
    "five megabytes of text": (text({"aircraft": "x" * 5_000_000}), 400),
    "a byte order mark": ("{}".encode("utf-8-sig"), 400),
    "UTF-16": ("{}".encode("utf-16"), 400),
    "Latin-1": ('{"aircraft": "é"}'.encode("latin-1"), 400),
    "not JSON": (b"<aircraft/>", 400),
    "two documents": (b"{}{}", 400),
}


@pytest.mark.parametrize("name", BODIES)
def test_hostile_bodies_are_refused(service: RunningService, name: str) -> None:
    """On every route that takes JSON."""
    body, status = BODIES[name]
    for path in PATHS if len(body) < LARGE else PATHS[:1]:
        refused(send(service, path, body), status)
    assert service.client.get("/livez").status_code == 200


@pytest.mark.parametrize(
    ("pointer", "value", "code"),
    [
        ("/samples/0/theta_rad/7", float("nan"), "finite_number"),
        ("/samples/0/theta_rad/7", float("inf"), "finite_number"),
        ("/samples/0/theta_rad/7", 10**400, "finite_number"),
        ("/samples/0/theta_rad/7", "0.1", "float_type"),
        ("/samples/0/theta_rad/7", True, "float_type"),
        ("/samples/0/theta_rad/7", None, "float_type"),
        ("/samples/0/theta_rad/7", [], "float_type"),
        ("/samples/0/time_s/7", 0.0, "time_not_rising"),
        ("/samples/0/theta_rad", {"0": 1.0}, "list_type"),
        ("/samples", {}, "list_type"),
        ("/model/links_per_wing", 10**30, "less_than_equal"),
        ("/model/links_per_wing", 2.5, "int_type"),
        ("/search/seed", 10**40, "less_than_equal"),
        ("/search/seed", -1, "greater_than_equal"),
        ("/aircraft/name", "x" * 10_000, "string_too_long"),
    ],
)
@pytest.mark.parametrize("large", [False, True])
def test_the_field_at_fault_is_named(
    service: RunningService, pointer: str, value: Any, code: str, *, large: bool
) -> None:
    """Pointer and code are the same whether the body was parsed here or in a process."""
    document = changed(identify_document(), pointer, value)
    body = text(document)
    problem = refused(send(service, "/identify", body + b" " * (LARGE if large else 0)), 422)
    assert problem["pointer"] == pointer
    if code != "finite_number" or not isinstance(value, int):
        assert problem["errors"][0]["code"] == code


def test_a_large_body_means_the_same(service: RunningService) -> None:
    """A request parsed in a process starts the same job as one parsed here."""
    body = text(identify_document())
    keys = {"Idempotency-Key": "large-and-small"}
    first, second = (send(service, "/identify", body + padding, **keys) for padding in (b"", b" " * LARGE))
    assert (first.status_code, second.status_code) == (202, 202)
    assert second.headers["idempotency-replayed"] == "true"
    assert first.json()["id"] == second.json()["id"]


@pytest.mark.parametrize(
    ("headers", "pointer"),
    [
        ({"Content-Encoding": "gzip"}, "#header/Content-Encoding"),
        ({"Content-Encoding": "identity, br"}, "#header/Content-Encoding"),
        ({"Content-Type": "application/json; charset=utf-16"}, "#header/Content-Type"),
        ({"Content-Type": "text/plain"}, "#header/Content-Type"),
        ({"Content-Type": "x" * 5000}, "#header/Content-Type"),
        ({"Content-Type": "application/x-www-form-urlencoded"}, "#header/Content-Type"),
    ],
)
def test_other_encodings_are_refused_by_header(
    service: RunningService, headers: dict[str, str], pointer: str
) -> None:
    """Compressed bodies and other encodings are named by the header that announces them."""
    for path in PATHS:
        problem = refused(send(service, path, gzip.compress(b"{}"), **headers), 415)
        assert problem["pointer"] == pointer


def test_compressed_uploads_are_refused(service: RunningService) -> None:
    """A compressed form is not looked at."""
    answer = service.client.post(
        "/trajectories", files={"file": ("x.csv", b"t")}, headers={"Content-Encoding": "gzip"}
    )
    assert refused(answer, 415)["pointer"] == "#header/Content-Encoding"


NASTY = [
    "/jobs/%00",
    "/jobs/%ff%fe",
    "/jobs/..%2f..%2fetc%2fpasswd",
    "/jobs/job_1/artifacts/%00",
    "/jobs/job_1/artifacts/a%00.svg",
    "/jobs/job_1/artifacts/..",
    "/jobs/job_1/artifacts/%2e%2e",
    "/jobs/job_1/artifacts/..%5c..%5cwindows",
    "/jobs/job_1/artifacts/%2fetc%2fpasswd",
    "/jobs/job_1/artifacts/%ed%a0%80",
    "/jobs/job_1/artifacts/" + "a" * 5000,
    "/trajectories/%00",
    "/models/%00",
    "/models/%00/export?format=json",
    "/webhooks/%00",
    "/jobs?cursor=%00",
    "/jobs?cursor=%ff",
    "/jobs?status=%00",
    "/jobs?limit=99999999999999999999999999",
    "/jobs?limit=" + "9" * 6000,
    "/jobs?limit=1e400",
    "/jobs?status=queued" * 50,
    "/jobs?operation=%F0%9F%92%A9",
    "/jobs/job_1/events?after=-1",
    "/static/..%2f..%2fsettings.py",
    "/static/%00",
    "/static/" + "../" * 30 + "etc/passwd",
    "/" + "a" * 10_000,
    "/%",
    "/?" + "x" * 10_000,
]


@pytest.mark.parametrize("path", NASTY)
def test_nasty_paths_are_refused(any_service: RunningService, path: str) -> None:
    """Zero bytes, broken UTF-8, other folders, absurd numbers: a 4xx on both databases."""
    answer = any_service.client.get(path)
    if path.startswith("/?"):
        assert answer.status_code == 200  # the page, which reads no query
    else:
        assert 400 <= answer.status_code < 500, answer.text
        assert answer.headers["content-type"] == "application/problem+json"


@pytest.mark.parametrize(
    "headers",
    [
        {"Idempotency-Key": "x" * 300},
        {"Idempotency-Key": "a b"},
        {"Prefer": "wait=" + "9" * 300},
        {"Last-Event-ID": "9" * 40},
        {"Last-Event-ID": "-1"},
        {"Accept": "," * 5000},
        {"X-Request-ID": "x" * 5000},
        {"X-Request-ID": "x;DROP\ty"},
        {"Authorization": "Bearer " + "x" * 5000},
        {"Authorization": "Basic \x7f"},
        {"Traceparent": "00-" + "z" * 50},
        {"Host": "evil.example"},
        {"Range": "bytes=0-" + "9" * 100},
        {"Expect": "nonsense"},
        {"Content-Length": "0"},
        {"Cookie": "=;" * 1000},
    ],
)
def test_nasty_headers_are_survived(any_service: RunningService, headers: dict[str, str]) -> None:
    """Whatever stands in a header, nothing breaks."""
    for path in ("/jobs", "/jobs/job_1/events", "/jobs/job_1"):
        assert any_service.client.get(path, headers=headers).status_code < 500
    if "Content-Length" not in headers:
        answer = any_service.client.post("/simulate", content=b"{}", headers={**JSON, **headers})
        assert answer.status_code < 500


def test_texts_survive_both_databases(any_service: RunningService) -> None:
    """Strange but honest texts are stored and come back; those that cannot be stored were refused before."""
    name = "Ωμέγα 😀 \u202e \x85 '; DROP TABLE jobs; --"
    document = changed(identify_document(), "/aircraft/name", name)
    answer = send(any_service, "/identify", text(document))
    assert answer.status_code == 202, answer.text
    back = any_service.client.get(answer.headers["location"]).json()
    assert back["id"] == answer.json()["id"]
    for bad in (r"\u0000", r"\ud800", r"\udc00\ud800"):
        body = text(document).replace(b"DROP TABLE", bad.encode())
        assert refused(send(any_service, "/identify", body), 400)["pointer"] == "/aircraft/name"


JSON_VALUES = st.recursive(
    st.none()
    | st.booleans()
    | st.floats()
    | st.integers()
    | st.integers(min_value=-(10**500), max_value=10**500)
    | st.text(st.characters(), max_size=8),
    lambda inner: st.lists(inner, max_size=5) | st.dictionaries(st.text(max_size=8), inner, max_size=5),
    max_leaves=25,
)
FUZZ = settings(
    max_examples=60,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)


def pointers(document: Any, here: str = "") -> list[str]:
    """Every place in a request, but few of its rows."""
    found = [here] if here else []
    if isinstance(document, dict):
        for key, value in document.items():
            found += pointers(value, f"{here}/{key}")
    elif isinstance(document, list):
        for number, value in enumerate(document[:2]):
            found += pointers(value, f"{here}/{number}")
    return found


SMALL = {**identify_document(), "samples": [sample_document("train_rate_0.8")]}


@FUZZ
@given(path=st.sampled_from(PATHS), body=st.binary(max_size=200) | JSON_VALUES.map(text))
def test_any_bytes_are_answered(service: RunningService, path: str, body: bytes) -> None:
    """Whatever is sent as JSON is refused with a problem document."""
    refused(send(service, path, body))


@FUZZ
@given(pointer=st.sampled_from(pointers(SMALL)), value=JSON_VALUES)
def test_any_value_in_any_field_is_answered(service: RunningService, pointer: str, value: Any) -> None:
    """A valid request with anything in one of its fields is accepted or refused, never a 5xx."""
    answer = send(service, "/identify", text(changed(SMALL, pointer, value)))
    if answer.status_code != 202:
        refused(answer)
