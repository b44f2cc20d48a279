"""Answers to requests that no route has seen, given while their bodies may still be on the way."""

from __future__ import annotations

import asyncio
import json

from starlette.types import Receive, Scope, Send

from app.errors import ServiceError
from app.http.problems import MEDIA_TYPE, problem_document

LINGER_S = 0.3  # a client that is still sending gets to read the answer before the connection closes


def closing_answer(error: ServiceError, path: str) -> tuple[dict[str, str], bytes]:
    """Headers and content of a problem document after which the connection closes."""
    content = json.dumps(problem_document(error, path)).encode()
    length = str(len(content))
    headers = {"Content-Type": MEDIA_TYPE, "Content-Length": length, **error.headers, "Connection": "close"}
    return headers, content


async def answer_early(error: ServiceError, scope: Scope, receive: Receive, send: Send) -> None:
    """Answer with a problem document; what the client still sends is thrown away for `LINGER_S`."""
    headers, content = closing_answer(error, scope["path"])
    start = [(name.lower().encode(), value.encode()) for name, value in headers.items()]
    await send({"type": "http.response.start", "status": error.status, "headers": start})
    await send({"type": "http.response.body", "body": content, "more_body": True})
    try:
        async with asyncio.timeout(LINGER_S):
            while (message := await receive())["type"] == "http.request" and message.get("more_body"):
                pass
    except TimeoutError:
        pass
    await send({"type": "http.response.body", "body": b"", "more_body": False})
