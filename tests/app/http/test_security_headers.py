"""Laws of the headers that make browsers careful."""

from __future__ import annotations

from typing import Any

import pytest
from starlette.types import Message, Receive, Scope, Send

from app.http.middleware import HSTS, SecurityHeaders
from tests.app.running_service import RunningService


@pytest.mark.parametrize(
    ("method", "path"),
    [
        *(("GET", path) for path in ("/", "/docs", "/jobs", "/livez", "/openapi.json", "/static/app.js")),
        *(("GET", path) for path in ("/nothing", "/jobs/none", "/static/nothing.js")),
        *(("POST", "/simulate"), ("PUT", "/jobs"), ("HEAD", "/")),
    ],
)
def test_every_answer_is_careful(service: RunningService, method: str, path: str) -> None:
    """No guessing of types, no frames, no referrer, a policy for whatever might run; errors too."""
    headers = service.client.request(method, path).headers
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["referrer-policy"] == "no-referrer"
    assert headers["x-frame-options"] == "DENY"
    assert headers["cross-origin-resource-policy"] == "same-origin"
    assert "frame-ancestors 'none'" in headers["content-security-policy"]
    assert "strict-transport-security" not in headers, "this is plain http"
    assert "server" not in headers or "uvicorn" in headers["server"]


def test_refusals_of_the_gate_and_of_the_body_limit_are_careful(service: RunningService) -> None:
    """Also answers that no route has seen."""
    foreign = service.client.get("/jobs", headers={"Sec-Fetch-Site": "cross-site"})
    large = service.client.post("/simulate", content=b"x" * (service.settings.max_body_bytes + 1))
    assert (foreign.status_code, large.status_code) == (403, 413)
    for answer in (foreign, large):
        assert answer.headers["x-content-type-options"] == "nosniff"


def test_pages_run_their_own_scripts_only(service: RunningService) -> None:
    """Neither page lets in inline scripts or other hosts; an API answer lets in nothing."""
    for path in ("/", "/docs"):
        policy = dict(
            part.strip().split(" ", 1)
            for part in service.client.get(path).headers["content-security-policy"].split(";")
        )
        assert policy["default-src"] == "'none'"
        assert policy["script-src"] == policy["connect-src"] == "'self'"
    assert "default-src 'none'" in service.client.get("/jobs").headers["content-security-policy"]


def test_https_is_remembered(service: RunningService) -> None:
    """Responses to requests by https (as reported by a proxy) require https from then on."""
    answer = service.client.get("/livez", headers={"X-Forwarded-Proto": "https"})
    assert answer.headers["strict-transport-security"] == HSTS


def test_what_an_answer_says_itself_stays() -> None:
    """A route's own policy is stricter or wider for a reason."""
    sent: list[Message] = []

    async def route(_scope: Scope, _receive: Receive, send: Send) -> None:
        own = [(b"content-security-policy", b"sandbox")]
        await send({"type": "http.response.start", "status": 200, "headers": own})

    async def collect(message: Message) -> None:
        sent.append(message)

    async def nothing() -> Any:
        raise AssertionError

    running = SecurityHeaders(route)({"type": "http", "headers": []}, nothing, collect)
    with pytest.raises(StopIteration):
        running.send(None)  # nothing in it waits
    policies = [value for name, value in sent[0]["headers"] if name == b"content-security-policy"]
    assert policies == [b"sandbox"]
