"""Laws of problem documents."""

from __future__ import annotations

import asyncio

import httpx
import pytest
from fastapi import FastAPI

from app.http.parameters import wait_seconds
from app.http.problems import install_problem_handlers
from app.schemas.problem import Problem
from morphdata.refusals import escaped
from tests.app.running_service import RunningService


@pytest.mark.parametrize(
    ("method", "path", "status", "code"),
    [
        ("GET", "/nothing", 404, "not_found"),
        ("PUT", "/jobs", 405, "method_not_allowed"),
        ("GET", "/jobs/job_none", 404, "job_not_found"),
        ("GET", "/jobs/../etc", 404, "not_found"),
        ("GET", "/jobs/a%20b", 422, "invalid_request"),
        ("GET", "/jobs?limit=0", 422, "invalid_request"),
        ("GET", "/jobs?status=lost", 422, "invalid_request"),
        ("GET", "/models/model_none", 404, "model_not_found"),
        ("GET", "/trajectories/traj_none", 404, "trajectory_not_found"),
        ("GET", "/static/../main.py", 404, "not_found"),
        ("GET", "/static/%2e%2e/endpoints.py", 404, "not_found"),
    ],
)
def test_every_refusal_is_a_problem(
    service: RunningService, method: str, path: str, status: int, code: str
) -> None:
    """Refusals by router, schema or store are all the same kind of document with a stable code."""
    answer = service.client.request(method, path)
    assert answer.status_code == status
    assert answer.headers["content-type"] == "application/problem+json"
    problem = Problem.model_validate(answer.json())
    assert (problem.status, problem.code) == (status, code)


@pytest.mark.parametrize(
    ("path", "allow"),
    [
        ("/jobs", "GET, HEAD"),
        ("/jobs/job_x", "DELETE, GET, HEAD"),
        ("/identify", "POST"),
        ("/docs", "GET, HEAD"),
        ("/static/app.js", "GET, HEAD"),
    ],
)
def test_allow_header_names_every_method(service: RunningService, path: str, allow: str) -> None:
    """405 lists all methods of the path."""
    answer = service.client.put(path)
    assert (answer.status_code, answer.headers["allow"]) == (405, allow)


def test_unforeseen_error_tells_nothing_of_itself() -> None:
    """An error that nobody foresaw is a 500 problem without its text."""
    app = FastAPI()
    install_problem_handlers(app)

    @app.get("/")
    def fail() -> None:
        raise RuntimeError("secret of the house")

    async def ask() -> httpx.Response:
        transport = httpx.ASGITransport(app, raise_app_exceptions=False)
        async with httpx.AsyncClient(transport=transport, base_url="http://service") as client:
            return await client.get("/")

    answer = asyncio.run(ask())
    assert answer.status_code == 500
    assert answer.json()["code"] == "internal_error"
    assert "secret" not in answer.text


def test_strange_names_do_not_spoil_the_answer(service: RunningService) -> None:
    """Slashes and megabytes in a field's name are answered like any unknown field."""
    for name in ("a/b~c", "x" * 10**6):
        body = f'{{"{name}": 1}}'
        answer = service.client.post(
            "/identify", content=body.encode(), headers={"Content-Type": "application/json"}
        )
        assert answer.status_code == 422
        assert len(answer.content) < 10_000
        assert answer.json()["errors"]


def test_pointers_are_escaped() -> None:
    """Tokens of a JSON pointer are written as RFC 6901 says."""
    assert escaped("a/b~c") == "a~1b~0c"


@pytest.mark.parametrize(
    ("prefer", "seconds"),
    [
        (None, 0.0),
        ("wait=5", 5.0),
        ("respond-async; wait=7", 7.0),
        ("wait=900", 60.0),
        ("wait=x", 0.0),
        ("await=5", 0.0),
    ],
)
def test_prefer_is_read(prefer: str | None, seconds: float) -> None:
    """`Prefer: wait=n` is honoured up to the service's limit; anything else is no wish."""
    assert wait_seconds(prefer, 60.0) == seconds
