"""Laws of request ids."""

from __future__ import annotations

import asyncio

import httpx
import pytest
from fastapi import FastAPI

from app.http.middleware import MAX_ID_CHARACTERS, RequestId
from app.http.problems import install_problem_handlers
from app.observability.context import current_request_id
from tests.app.running_service import RunningService


def test_a_sane_id_comes_back(service: RunningService) -> None:
    """The caller's own id is taken over, in good answers and in refusals, and in the problem document."""
    sent = {"X-Request-ID": "trace-7.a:B_c"}
    for path in ("/livez", "/jobs", "/nothing", "/jobs/job_none"):
        answer = service.client.get(path, headers=sent)
        assert answer.headers.get_list("x-request-id") == ["trace-7.a:B_c"]
    assert answer.json()["request_id"] == "trace-7.a:B_c"


@pytest.mark.parametrize(
    "insane",
    [b"", b"a b", b'"; drop', b"a" * (MAX_ID_CHARACTERS + 1), "é".encode(), b"-rf", b"a\tb", b"{}", b"%0a"],
)
def test_an_insane_id_is_replaced(service: RunningService, insane: bytes) -> None:
    """What is too long or could mean something to a log or a shell gives way to an id of our own."""
    answer = service.client.get("/nothing", headers=[(b"X-Request-ID", insane)])
    made = answer.headers["x-request-id"]
    assert made.startswith("req_")
    assert answer.json()["request_id"] == made


def test_ids_are_unique(service: RunningService) -> None:
    """Two requests never share an id that we made."""
    made = {service.client.get("/livez").headers["x-request-id"] for _ in range(20)}
    assert len(made) == 20


def test_a_body_that_is_too_large_has_an_id(service: RunningService) -> None:
    """The refusal that comes before any routing carries the id too."""
    too_long = b"x" * (service.settings.max_body_bytes + 1)
    answer = service.client.post("/identify", content=too_long, headers={"X-Request-ID": "big"})
    assert answer.status_code == 413
    assert answer.headers["x-request-id"] == answer.json()["request_id"] == "big"


def test_unforeseen_errors_have_an_id() -> None:
    """Even the answer to an error that nobody foresaw leads to the log."""
    app = FastAPI()
    install_problem_handlers(app)
    seen: list[str] = []

    @app.get("/")
    def fail() -> None:
        seen.append(current_request_id())
        raise RuntimeError

    async def ask() -> httpx.Response:
        transport = httpx.ASGITransport(RequestId(app), raise_app_exceptions=False)
        async with httpx.AsyncClient(transport=transport, base_url="http://test") as client:
            return await client.get("/")

    answer = asyncio.run(ask())
    assert answer.status_code == 500
    assert seen == [answer.headers["x-request-id"]] == [answer.json()["request_id"]]
    assert current_request_id() == ""
