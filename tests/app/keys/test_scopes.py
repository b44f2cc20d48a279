"""Laws of scopes: every route says what it demands, and gets it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any

import pytest
from fastapi.routing import APIRoute
from starlette.routing import BaseRoute, Mount, Route

from app.http.gate import PUBLIC_FOLDER, PUBLIC_PATHS
from app.keys.records import EVERY_SCOPE, Scope
from app.main import routed_app
from app.openapi import openapi_document
from tests.app.key_holders import holder, make_key
from tests.app.running_service import RunningService

ANY_KEY = {("GET", "/me")}  # only reports on the caller itself


def routes() -> Iterator[BaseRoute]:
    """Every route of the service, those of included routers too."""
    pending = list(routed_app().routes)
    while pending:
        route = pending.pop()
        included = getattr(route, "original_router", None)  # how newer versions of FastAPI include a router
        if included is None:
            yield route
        else:
            pending.extend(included.routes)


def demanded(operation: dict[str, Any]) -> set[str]:
    """Scopes that an operation of the OpenAPI document demands."""
    return {name for entry in operation.get("security", ()) for name in entry["api_key"]}


@lru_cache(maxsize=1)
def operations() -> list[tuple[str, str, dict[str, Any]]]:
    """Every documented operation: method, path, description."""
    paths = openapi_document(routed_app())["paths"]
    return [
        (method.upper(), path, reported)
        for path, found in paths.items()
        for method, reported in found.items()
    ]


def test_every_route_demands_a_scope_or_is_public() -> None:
    """No route of the application is open by mistake; the public ones are exactly the short list."""
    documented = {(method, path): reported for method, path, reported in operations()}
    public = set()
    for route in routes():
        if isinstance(route, Mount):
            assert f"{route.path}/".startswith(PUBLIC_FOLDER)
            continue
        assert isinstance(route, Route | APIRoute), route
        for method in set(route.methods or ()) - {"HEAD"}:
            operation = documented.get((method, route.path))
            if route.path in PUBLIC_PATHS:
                public.add(route.path)
                assert operation is None or "security" not in operation
            else:
                assert operation is not None, f"{method} {route.path} is not documented"
                assert "security" in operation, f"{method} {route.path} demands no key"
                assert demanded(operation) or (method, route.path) in ANY_KEY, f"{method} {route.path}"
    assert public == PUBLIC_PATHS


def test_the_paper_names_every_scope_and_public_path(root: Path) -> None:
    """docs/security.md agrees with the code."""
    text = (root / "docs/security.md").read_text(encoding="utf-8")
    assert set(re.findall(r"^\| `([a-z:]+)` \|", text, re.MULTILINE)) == set(EVERY_SCOPE)
    (public,) = re.findall(r"^Public: (.*)\.\s+`GET /me`", text, re.MULTILINE)
    assert set(re.findall(r"`([^`]+)`", public)) == {*PUBLIC_PATHS, PUBLIC_FOLDER}


def test_every_scope_is_demanded_somewhere() -> None:
    """There is no scope that opens nothing."""
    assert set().union(*(demanded(reported) for _, _, reported in operations())) == set(EVERY_SCOPE)


def test_reading_scopes_change_nothing() -> None:
    """What a reading scope opens is only read: every other method demands a scope to write."""
    for method, path, reported in operations():
        if demanded(reported) & {Scope.JOBS_READ, Scope.DATA_READ, Scope.METRICS}:
            assert method == "GET", path


def test_refusals_are_documented_everywhere() -> None:
    """401, 403, 421 and 429 stand in the document wherever a key is demanded, with their headers."""
    for method, path, reported in operations():
        wanted = {"401", "403", "421", "429"} if "security" in reported else {"403", "421"}
        assert wanted <= set(reported["responses"]), f"{method} {path}"
        if "security" in reported:
            assert "WWW-Authenticate" in reported["responses"]["401"]["headers"]
            assert "Retry-After" in reported["responses"]["429"]["headers"]


@pytest.mark.parametrize("scope", sorted(EVERY_SCOPE))
def test_a_key_opens_what_its_scope_says(keyed_on_sqlite: RunningService, scope: Scope) -> None:
    """Each operation accepts a key with only its scope, and tells other keys which scope is missing."""
    key = make_key(keyed_on_sqlite.database, scopes=[scope])
    with holder(keyed_on_sqlite, key.text) as client:
        for method, path, reported in operations():
            if "security" not in reported:
                continue
            place = path.replace("{", "").replace("}", "")
            answer = client.request(method, place, headers={"Accept": "application/json"}, content=b"")
            if demanded(reported) <= {scope}:
                assert answer.status_code not in (401, 403), f"{method} {path}"
            elif answer.status_code != 403:
                # the framework looks at parameters and body before a route's scope; it did nothing else
                assert answer.status_code in (400, 415, 422), f"{method} {path}: {answer.status_code}"
            else:
                assert answer.json()["code"] == "missing_scope"
                (enough,) = re.findall(r' scope="([^"]*)"', answer.headers["www-authenticate"])
                assert set(enough.split()) == demanded(reported)
