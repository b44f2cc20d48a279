"""Errors on the wire: problem documents (RFC 9457) for everything that can go wrong."""

from __future__ import annotations

import difflib
import http
import json
import logging
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import Response
from sqlalchemy.exc import SQLAlchemyError
from starlette.exceptions import HTTPException
from starlette.routing import compile_path

from app.database_errors import DatabaseTrouble, trouble_of
from app.documents import finite
from app.errors import DatabaseAway, InvalidRequest, ServiceError, StorageFull
from app.http.request_id import current_request_id
from app.schemas.problem import Problem
from morphdata.faults import Fault

MEDIA_TYPE = "application/problem+json"
MAX_FAULTS = 20
MAX_POINTER = 300  # characters: a field's name may be a megabyte
SHOWN_CHARACTERS = 60  # of an offending value

logger = logging.getLogger(__name__)

HINTS = {
    "missing": "Add this field.",
    "finite_number": "Remove or repair the row: NaN and infinity are not numbers.",
    "float_type": "Give a number (not text) in the unit of the field's name.",
    "int_type": "Give a whole number.",
    "list_type": "Give a list.",
    "dict_type": "Give an object.",
    "model_type": "Give an object.",
    "model_attributes_type": "Give a JSON object.",
    "bool_type": "Give true or false.",
    "string_type": "Give a text.",
    "string_pattern_mismatch": "Use letters, digits, . - and _, starting with a letter or digit.",
    "too_short": "Give more items.",
    "too_long": "Give fewer items: leave out rows (10 ms steps are enough) or split the flight.",
}


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
        "errors": [
            {"code": fault.code, "detail": fault.detail, "pointer": fault.pointer, "hint": fault.hint}
            for fault in error.faults[:MAX_FAULTS]
        ],
        **error.members,
    }


def problem_response(
    error: ServiceError, request: Request, headers: Mapping[str, str] | None = None
) -> Response:
    """Answer a request with a problem document."""
    # ASCII only: half of a surrogate pair in a field's name must not spoil the answer
    body = json.dumps(finite(problem_document(error, request.url.path)))
    return Response(body, error.status, headers=headers, media_type=MEDIA_TYPE)


def documented(*errors: type[ServiceError]) -> dict[int | str, dict[str, Any]]:
    """OpenAPI responses of an operation that may fail with `errors`."""
    found: dict[int | str, dict[str, Any]] = {}
    for error in errors:
        entry = found.setdefault(error.status, {"model": Problem, "description": ""})
        entry["description"] = "; ".join(
            filter(None, (entry["description"], f"`{error.code}`: {error.title}"))
        )
    return found


def escaped(part: object) -> str:
    """One token of a JSON pointer (RFC 6901)."""
    return str(part).replace("~", "~0").replace("/", "~1")


def _pointer(location: Sequence[str | int], body: Any, *, missing: bool) -> str:
    """Turn pydantic's location into a JSON pointer, leaving out the names of union members."""
    source, *path = location
    if source != "body":
        return f"#{source}/{'/'.join(str(part) for part in path)}"
    value = body
    tokens: list[str] = []
    for position, part in enumerate(path):
        inside_list = isinstance(value, list) and isinstance(part, int) and part < len(value)
        if inside_list or (isinstance(value, dict) and part in value):
            value = value[part]
        elif not (missing and position == len(path) - 1):
            continue  # a tag such as "inline" or "float": not part of the document
        tokens.append(f"/{escaped(part)}")
    return "".join(tokens)[:MAX_POINTER]


def _shown(value: Any) -> str:
    if isinstance(value, (dict, list)):
        return ""
    text = repr(value)
    return f" (got {text[:SHOWN_CHARACTERS]}{'…' if len(text) > SHOWN_CHARACTERS else ''})"


def _sentence(item: Mapping[str, Any], pointer: str) -> str:
    context = item.get("ctx") or {}
    if item["type"] == "too_long" and context.get("actual_length") is not None:
        return f"{context['actual_length']} items are too many: at most {context['max_length']}"
    if item["type"] == "too_short":
        return f"{context['actual_length']} items are too few: at least {context['min_length']}"
    if str(item["type"]).startswith(("greater", "less")):
        names = [part for part in pointer.split("/") if not part.isdecimal()]
        row = f" at row {item['loc'][-1]}" if isinstance(item["loc"][-1], int) else ""
        value = item["input"]
        number = f"{value:g}" if isinstance(value, float) else str(value)[:SHOWN_CHARACTERS]
        return f"{names[-1]} is {number}{row}"
    return str(item["msg"]).removeprefix("Value error, ")


def _extra_field_hint(name: str, known: Sequence[str]) -> str:
    if name in known:
        return "It belongs to another object. Leave it out here."
    near = difflib.get_close_matches(name[:SHOWN_CHARACTERS], known, n=1)
    return f"Did you mean {near[0]!r}? Otherwise leave it out." if near else "Leave it out."


def _bound_hint(kind: str, context: Mapping[str, Any]) -> str:
    for key, words in (("ge", "at least"), ("gt", "more than"), ("le", "at most"), ("lt", "less than")):
        if key in context and kind.startswith(("greater", "less")):
            return f"It must be {words} {context[key]:g}."
    if kind.startswith("union_tag"):
        tags = context.get("expected_tags")
        return f"Give {context.get('discriminator', 'a kind')}: {tags or 'one of the documented kinds'}."
    if kind == "literal_error":
        return f"Use {context.get('expected', 'one of the documented words')}."
    return HINTS.get(kind, "See the documentation of this field at /docs.")


def faults_of(error: RequestValidationError, known_fields: Callable[[], Sequence[str]]) -> list[Fault]:
    """Translate pydantic's errors, one per field, the first `MAX_FAULTS`."""
    faults: dict[str, Fault] = {}
    for item in error.errors():
        kind = item["type"]
        pointer = _pointer(item["loc"], error.body, missing=kind in ("missing", "extra_forbidden"))
        if pointer in faults:
            continue
        if kind == "extra_forbidden":
            name = str(item["loc"][-1])
            faults[pointer] = Fault(
                "unknown_field", "There is no such field.", pointer, _extra_field_hint(name, known_fields())
            )
        else:
            message = _sentence(item, pointer)
            bound = kind.startswith(("greater", "less"))
            shown = "" if kind == "missing" or bound else _shown(item.get("input"))
            faults[pointer] = Fault(
                kind, f"{message}{shown}.", pointer, _bound_hint(kind, item.get("ctx") or {})
            )
        if len(faults) == MAX_FAULTS:
            break
    return list(faults.values())


class HttpProblem(ServiceError):
    """What the framework itself refuses: an unknown path, a wrong method."""

    def __init__(self, error: HTTPException) -> None:
        phrase = http.HTTPStatus(error.status_code).phrase
        hints = {404: "GET /openapi.json lists every path.", 405: "See the Allow header or /docs."}
        super().__init__(str(error.detail), hint=hints.get(error.status_code, ""))
        self.status = error.status_code
        self.code = phrase.lower().replace(" ", "_").replace("-", "_")
        self.title = phrase


def allowed_methods(document: Mapping[str, Any], path: str) -> str:
    """Return the value of the Allow header of `path`: every method that the OpenAPI document gives it.

    Pages and files are in no document, and are there to be read. Where there is GET there is HEAD.
    """
    methods: set[str] = set()
    for template, operations in document["paths"].items():
        if compile_path(template)[0].match(path):
            methods.update(name.upper() for name in operations)
    if not methods or "GET" in methods:
        methods |= {"GET", "HEAD"}
    return ", ".join(sorted(methods))


def install_problem_handlers(app: FastAPI, known_fields: Callable[[], Sequence[str]]) -> None:
    """Make `app` answer every error with a problem document.

    Parameters
    ----------
    known_fields
        Gives the names of all fields there are; asked when a request holds an unknown one.
    """

    @app.exception_handler(ServiceError)
    async def _service_error(request: Request, error: ServiceError) -> Response:
        return problem_response(error, request, error.headers)

    @app.exception_handler(RequestValidationError)
    async def _invalid(request: Request, error: RequestValidationError) -> Response:
        return problem_response(InvalidRequest.of(faults_of(error, known_fields)), request)

    @app.exception_handler(HTTPException)
    async def _http(request: Request, error: HTTPException) -> Response:
        headers = dict(error.headers or {})
        if error.status_code == http.HTTPStatus.METHOD_NOT_ALLOWED:
            # the router names the methods of the first route only
            headers["allow"] = allowed_methods(app.openapi(), request.url.path)
            headers.pop("Allow", None)
        return problem_response(HttpProblem(error), request, headers)

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
        hint = "It is not your fault; the service's log tells more."
        return problem_response(ServiceError("An unforeseen error.", hint=hint), request)
