"""JSON bodies of requests: small ones are parsed here, large ones in a process with limits."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Coroutine
from typing import Any

from fastapi import Request, Response
from fastapi.routing import APIRoute
from starlette.datastructures import UploadFile

from app.errors import (
    BodyTooLarge,
    InvalidRequest,
    MalformedBody,
    ServiceBusy,
    SlowBody,
    UnsupportedMediaType,
)
from app.http.context import Service, current_caller
from app.parsing.json_text import parse_json

# a process costs 50 ms; parsing this much blocks the other requests for 10 ms
MAX_BYTES_HERE = 2**19
# errors possible on any route with a body
BODY_ERRORS = (MalformedBody, SlowBody, BodyTooLarge, UnsupportedMediaType, InvalidRequest, ServiceBusy)


def media_type(request: Request) -> str:
    """The media type of the request, without parameters.

    Raises
    ------
    UnsupportedMediaType
        The body is compressed, or its text is not in UTF-8.
    """
    coding = request.headers.get("content-encoding", "identity").strip().lower()
    if coding not in ("identity", ""):
        raise UnsupportedMediaType(
            f"The Content-Encoding of the body is {coding[:40]!r}.",
            "#header/Content-Encoding",
            "Send it uncompressed, without Content-Encoding.",
        )
    kind, *parameters = request.headers.get("content-type", "").lower().split(";")
    for parameter in parameters:
        name, _, value = parameter.strip().partition("=")
        if name == "charset" and value.strip('"') not in ("utf-8", "utf8", "us-ascii"):
            raise UnsupportedMediaType(
                f"The text is announced as {value[:40]!r}.", "#header/Content-Type", "Send UTF-8."
            )
    return kind.strip()


def is_json(kind: str) -> bool:
    """Whether a media type is JSON."""
    return kind == "application/json" or (kind.startswith("application/") and kind.endswith("+json"))


async def json_document(request: Request) -> Any:
    """Read and parse the JSON body of a request; large bodies are stored on disk for their parser.

    Raises
    ------
    MalformedBody
        It is not a valid JSON text.
    ServiceBusy
        Too many large ones are being read.
    """
    service: Service = request.app.state.service
    spool = tempfile.SpooledTemporaryFile(max_size=MAX_BYTES_HERE)  # noqa: SIM115 - closed with its upload
    file = UploadFile(spool, size=0)  # type: ignore[arg-type]  # what it makes of uploads itself
    try:
        async for piece in request.stream():
            await file.write(piece)
        if (file.size or 0) > MAX_BYTES_HERE:
            caller = await current_caller(request)
            return await service.parsers.json_document(caller.owner, file.file)
        await file.seek(0)
        return parse_json(await file.read())
    finally:
        await file.close()


class _ParsedRequest(Request):
    """A request whose JSON body was parsed already."""

    document: Any = None
    empty = True

    async def body(self) -> bytes:
        return b"" if self.empty else b"parsed"  # FastAPI checks only whether there is one

    async def json(self) -> Any:
        return self.document


class JsonRoute(APIRoute):
    """A route whose JSON body is parsed by `json_document` before FastAPI looks at it."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Wrap FastAPI's handler."""
        handler = super().get_route_handler()
        if self.body_field is None:
            return handler

        async def parsed(request: Request) -> Response:
            kind = media_type(request)
            replay = _ParsedRequest(request.scope, request.receive)
            if is_json(kind):
                replay.document = await json_document(request)
                replay.empty = False
            elif kind or await _has_body(request):
                raise UnsupportedMediaType(
                    f"The Content-Type of the body is {kind or 'nothing'!r}.",
                    "#header/Content-Type",
                    "Send JSON with Content-Type: application/json.",
                )
            return await handler(replay)

        return parsed


async def _has_body(request: Request) -> bool:
    async for piece in request.stream():
        if piece:
            return True
    return False
