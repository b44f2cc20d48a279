"""Calls to the operations as a client makes them, and the faults that come back."""

from __future__ import annotations

import copy
import json
import math
import time
from typing import Any

import httpx

from tests.app.request_documents import Document
from tests.app.running_service import RunningService

JSON = {"Content-Type": "application/json"}
ANSWER_S = 1.0  # a bad request is refused within a second
LARGE_ANSWER_S = 5.0  # a body of megabytes is read by a process of its own, 0.5 s on a quiet machine
TRIES = 3


def post(service: RunningService, path: str, document: Any, **headers: str) -> httpx.Response:
    """Post a document as the JSON text that Python makes of it, NaN included."""
    return service.client.post(path, content=json.dumps(document), headers={**JSON, **headers})


def fault(answer: httpx.Response, status: int = 422) -> Document:
    """Give the problem document of an answer."""
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    document: Document = answer.json()
    assert document["status"] == status
    assert document["hint"]
    return document


def prompt_fault(
    service: RunningService, path: str, document: Any, status: int = 422, *, within_s: float = ANSWER_S
) -> Document:
    """Post a bad request and give its problem; the best of some answers comes in time.

    One alone may be held up by whatever else this machine does; the first of all makes the list of fields.
    """
    problem, fastest_s = {}, math.inf
    for _ in range(TRIES):
        start = time.perf_counter()
        problem = fault(post(service, path, document), status)
        fastest_s = min(fastest_s, time.perf_counter() - start)
        if fastest_s < within_s:
            return problem
    raise AssertionError(f"the fastest of {TRIES} answers took {fastest_s:.2f} s: {problem}")


def changed(document: Document, path: str, value: Any) -> Document:
    """Build a request with one field changed; `path` is its JSON pointer."""
    document = copy.deepcopy(document)
    *parents, last = path.strip("/").split("/")
    place: Any = document
    for part in parents:
        place = place[int(part)] if isinstance(place, list) else place.setdefault(part, {})
    place[int(last) if isinstance(place, list) else last] = value
    return document


def assert_named(
    service: RunningService, path: str, document: Document, pointer: str, code: str, words: str
) -> None:
    """A bad request gets pointer, stable code and a hint with the way out, within a second."""
    problem = prompt_fault(service, path, document)
    first = problem["errors"][0]
    assert (first["pointer"], first["code"]) == (pointer, code)
    assert words in first["hint"]
    assert problem["pointer"] == first["pointer"]
