"""Error responses: problem documents (RFC 9457) for every error."""

from __future__ import annotations

import asyncio
import contextlib
import http
import json
import logging
from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import Response
from pydantic import BaseModel
from sqlalchemy.exc import SQLAlchemyError
from starlette.exceptions import HTTPException
from starlette.routing import compile_path
from starlette.types import Receive, Scope, Send

from app.database_errors import DatabaseTrouble, trouble_of
from app.documents import finite
from app.errors import DatabaseAway, HttpError, InvalidRequest, ServiceError, StorageFull
from app.observability.context import current_request_id
from morphdata.faults import Fault, InvalidInput
from morphdata.refusals import MAX_FAULTS, faults_of

MEDIA_TYPE = "application/problem+json"
PROBLEM = {"$ref": "#/components/schemas/Problem"}
LINGER_S = (
    0.3  # gives a client that is still sending the time to read the response before the connection closes
)
HTTP_HINTS = {404: "GET /openapi.json lists every path.", 405: "See the Allow header or /docs."}

logger = logging.getLogger(__name__)


def problem_document(error: ServiceError, instance: str) -> dict[str, Any]:
    """Return the problem document of an error."""
    return {
        "type": f"urn:morphid:problem:{error.code}",
        "title": error.title,
        "status": error.status,
        "detail": error.detail or error.title,
        "code": error.code,
        "instance": instance,
        "request_id": current_request_id(),
        "pointer": error.pointer,
        "hint": error.hint,
        "errors": [asdict(fault) for fault in error.faults[:MAX_FAULTS]],
        **error.members,
    }


def problem_response(
    error: ServiceError, request: Request, headers: Mapping[str, str] | None = None
) -> Response:
    """Answer a request with a problem document."""
    # ASCII only: half of a surrogate pair in a field's name must not break the response
    body = json.dumps(finite(problem_document(error, request.url.path)))
    return Response(body, error.status, headers=headers, media_type=MEDIA_TYPE)


def closing_answer(error: ServiceError, path: str) -> tuple[dict[str, str], bytes]:
    """Headers and content of a problem document after which the connection closes."""
    content = json.dumps(problem_document(error, path)).encode()
    length = str(len(content))
    headers = {"Content-Type": MEDIA_TYPE, "Content-Length": length, **error.headers, "Connection": "close"}
    return headers, content


async def answer_early(error: ServiceError, scope: Scope, receive: Receive, send: Send) -> None:
    """Respond before routing; further data from the client are discarded for `LINGER_S`."""
    headers, content = closing_answer(error, scope["path"])
    start = [(name.lower().encode(), value.encode()) for name, value in headers.items()]
    await send({"type": "http.response.start", "status": error.status, "headers": start})
    await send({"type": "http.response.body", "body": content, "more_body": True})
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(LINGER_S):
            while (message := await receive())["type"] == "http.request" and message.get("more_body"):
                pass
    await send({"type": "http.response.body", "body": b"", "more_body": False})


def documented(*errors: type[ServiceError]) -> dict[int | str, dict[str, Any]]:
    """OpenAPI responses of an operation that can fail with `errors`."""
    found: dict[int | str, dict[str, Any]] = {}
    for error in errors:
        sentence = f"`{error.code}`: {error.title}"
        if error.status in found:
            found[error.status]["description"] += f"; {sentence}"
        else:
            found[error.status] = {"description": sentence, "content": {MEDIA_TYPE: {"schema": PROBLEM}}}
    return found


def _request_faults(request: Request, error: RequestValidationError) -> list[Fault]:
    """Convert FastAPI's validation errors of the body, or else of path, query and headers."""
    errors = [dict(item) for item in error.errors()]
    inside = [{**item, "loc": item["loc"][1:]} for item in errors if item["loc"][0] == "body"]
    if inside:
        return faults_of(inside, error.body, request.scope["route"].body_field.field_info.annotation)
    places = {item["loc"][0]: {item["loc"][1]: item["input"]} for item in errors}
    return [
        replace(fault, pointer=f"#{fault.pointer.removeprefix('/')}")
        for fault in faults_of(errors, places, BaseModel)
    ]


def allowed_methods(document: Mapping[str, Any], path: str) -> str:
    """Return the value of the Allow header of `path`: its methods in the OpenAPI document.

    Pages and files are not in the document and are read-only. Wherever there is GET there is HEAD.
    """
    methods: set[str] = set()
    for template, operations in document["paths"].items():
        if compile_path(template)[0].match(path):
            methods.update(name.upper() for name in operations)
    if not methods or "GET" in methods:
        methods |= {"GET", "HEAD"}
    return ", ".join(sorted(methods))


def install_problem_handlers(app: FastAPI) -> None:
    """Make `app` answer every error with a problem document."""

    @app.exception_handler(ServiceError)
    async def _service_error(request: Request, error: ServiceError) -> Response:
        return problem_response(error, request, error.headers)

    @app.exception_handler(RequestValidationError)
    async def _invalid(request: Request, error: RequestValidationError) -> Response:
        return problem_response(InvalidRequest.of(_request_faults(request, error)), request)

    @app.exception_handler(InvalidInput)
    async def _refused(request: Request, error: InvalidInput) -> Response:
        return problem_response(InvalidRequest.of(error.faults), request)

    @app.exception_handler(HTTPException)
    async def _http(request: Request, error: HTTPException) -> Response:
        headers = dict(error.headers or {})
        if error.status_code == http.HTTPStatus.METHOD_NOT_ALLOWED:
            # the router only reports the methods of the first route
            headers["allow"] = allowed_methods(app.openapi(), request.url.path)
            headers.pop("Allow", None)
        phrase = http.HTTPStatus(error.status_code).phrase
        code = phrase.lower().replace(" ", "_").replace("-", "_")
        hint = HTTP_HINTS.get(error.status_code, "")
        problem = HttpError(error.status_code, code, phrase, str(error.detail), hint)
        return problem_response(problem, request, headers)

    @app.exception_handler(SQLAlchemyError)
    async def _database(request: Request, error: SQLAlchemyError) -> Response:
        trouble = trouble_of(error)
        if trouble is None:
            return await _unforeseen(request, error)
        logger.warning("%s %s: the database is %s", request.method, request.url.path, trouble.value)
        problem = StorageFull() if trouble is DatabaseTrouble.FULL else DatabaseAway()
        return problem_response(problem, request, problem.headers)

    @app.exception_handler(Exception)
    async def _unforeseen(request: Request, error: Exception) -> Response:
        logger.error("%s %s failed", request.method, request.url.path, exc_info=error)
        hint = "This is a fault of the service; its log has details."
        return problem_response(ServiceError("An unexpected error.", hint=hint), request)
