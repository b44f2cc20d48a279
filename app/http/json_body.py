"""Reading JSON bodies: bounded work, no duplicate keys, and a sentence for whatever is wrong."""

from __future__ import annotations

import json
from collections.abc import Callable, Coroutine
from typing import Any

from fastapi import Request, Response
from fastapi.routing import APIRoute

from app.errors import MalformedBody, UnsupportedMediaType

MAX_LISTS = 100_000  # a byte of "[" costs sixty of memory
MAX_OBJECTS = 10_000
MAX_VALUES = 3_000_000  # 500,000 rows of samples; parsing more takes longer than a second
MAX_KEYS = 100  # of one object; none of ours has more than twenty


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    if len(pairs) > MAX_KEYS:
        raise MalformedBody(f"An object has more than {MAX_KEYS} fields.", hint="See /docs for the fields.")
    document = dict(pairs)
    if len(document) != len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for number, key in enumerate(keys) if key in keys[:number])
        raise MalformedBody(f"The key {twice[:60]!r} appears twice in one object.", hint="Keep one.")
    return document


def parse_json(body: bytes) -> Any:
    """Parse a JSON text.

    NaN and Infinity are read here, so that the schema can refuse them by the name of their field.

    Raises
    ------
    MalformedBody
        When it is not JSON, is nested too deeply, repeats a key or holds far too many items.
    """
    objects, lists, values = body.count(b"{"), body.count(b"["), body.count(b",")
    if objects > MAX_OBJECTS or lists > MAX_LISTS or values > MAX_VALUES:
        raise MalformedBody(
            f"The body holds {objects} objects, {lists} lists and {values} further values.",
            "/samples" if b'"samples"' in body else "",  # nothing else can be that large but schedules
            f"At most {MAX_VALUES} numbers a body: leave out rows (10 ms steps suffice) or upload flights.",
        )
    try:
        return json.loads(body, object_pairs_hook=_object)
    except json.JSONDecodeError as error:
        raise MalformedBody(
            f"Not JSON: {error.msg} at line {error.lineno}, column {error.colno}.",
            hint="Check the text with a JSON validator.",
        ) from None
    except UnicodeDecodeError:
        raise MalformedBody("The text is not UTF-8.", hint="Encode the body as UTF-8.") from None
    except RecursionError:
        raise MalformedBody("The text is nested too deeply.", hint="Six levels are enough.") from None
    except ValueError as error:
        # an integer of thousands of digits
        raise MalformedBody(f"Not JSON: {str(error)[:80]}.", hint="Shorten the number.") from None


class _ParsedRequest(Request):
    """A request whose JSON was parsed by `parse_json`."""

    document: Any = None

    async def json(self) -> Any:
        return self.document


class JsonRoute(APIRoute):
    """A route that parses its JSON body with `parse_json` before FastAPI looks at it."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Wrap FastAPI's handler."""
        handler = super().get_route_handler()
        if self.body_field is None:
            return handler

        async def parsed(request: Request) -> Response:
            replay = _ParsedRequest(request.scope, request.receive)
            body = await replay.body()
            kind = request.headers.get("content-type", "").split(";")[0].strip().lower()
            if body and kind != "application/json" and not kind.endswith("+json"):
                raise UnsupportedMediaType(
                    f"The body is announced as {kind or 'nothing'!r}.",
                    "#header/Content-Type",
                    "Send JSON with Content-Type: application/json.",
                )
            if body:
                replay.document = parse_json(body)
            return await handler(replay)

        return parsed
