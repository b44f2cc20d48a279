"""Parses JSON texts: bounded work, no duplicate keys, and a message for every error."""

from __future__ import annotations

import codecs
import json
import re
from typing import Any

from app.errors import MalformedBody

MAX_LISTS = 100_000  # a byte of "[" costs sixty of memory
MAX_OBJECTS = 10_000
MAX_VALUES = 3_000_000  # 500,000 rows of samples
MAX_KEYS = 100  # of one object; none of ours has more than twenty
UTF8 = "Encode the body as UTF-8, without a byte order mark."
UTF16_MARKS = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)  # those of UTF-32 begin with them or with zeros
SUSPECT = re.compile(rb"\\u(?:0000|[dD][89a-fA-F])")  # the only spellings of forbidden characters in JSON
UNSTORABLE = re.compile(r"[\x00\ud800-\udfff]")


def parse_json(body: bytes) -> Any:
    """Parse a JSON text. NaN and Infinity are accepted here; the schema refuses them by field.

    Raises `MalformedBody` if it is not JSON in UTF-8, is nested too deeply, repeats a key, has far too many
    items, or contains text that databases cannot store (an unpaired surrogate, a null character).
    """
    if not body:
        raise MalformedBody("There is no body.", hint="Send a JSON object; /docs shows examples.")
    objects, lists, values = body.count(b"{"), body.count(b"["), body.count(b",")
    if objects > MAX_OBJECTS or lists > MAX_LISTS or values > MAX_VALUES:
        raise MalformedBody(
            f"The body holds {objects} objects, {lists} lists and {values} further values.",
            "/samples" if b'"samples"' in body else "",  # besides samples only schedules can be that large
            f"At most {MAX_VALUES} numbers a body: leave out rows (10 ms steps suffice) or upload flights.",
        )
    try:
        document = json.loads(_decoded(body), object_pairs_hook=_object)
    except json.JSONDecodeError as error:
        raise MalformedBody(
            f"Not JSON: {error.msg} at line {error.lineno}, column {error.colno}.",
            hint="Check the text with a JSON validator.",
        ) from None
    except RecursionError:
        raise MalformedBody("The text is nested too deeply.", hint="Six levels are enough.") from None
    except ValueError as error:
        # an integer of thousands of digits
        raise MalformedBody(f"Not JSON: {str(error)[:80]}.", hint="Shorten the number.") from None
    if SUSPECT.search(body):
        _refuse_unstorable(document)
    return document


def _decoded(body: bytes) -> str:
    if body.startswith(codecs.BOM_UTF8):
        raise MalformedBody("The text begins with a byte order mark.", hint=UTF8)
    if body.startswith(UTF16_MARKS) or b"\x00" in body[:4]:
        raise MalformedBody("The text is in UTF-16 or UTF-32.", hint=UTF8)
    try:
        return body.decode("utf-8")
    except UnicodeDecodeError as error:
        raise MalformedBody(f"The text is not UTF-8: byte {error.start}.", hint=UTF8) from None


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    if len(pairs) > MAX_KEYS:
        raise MalformedBody(f"An object has more than {MAX_KEYS} fields.", hint="See /docs for the fields.")
    document = dict(pairs)
    if len(document) != len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for number, key in enumerate(keys) if key in keys[:number])
        raise MalformedBody(f"The key {twice[:60]!r} appears twice in one object.", hint="Keep one.")
    return document


def _refuse_unstorable(document: Any) -> None:
    """Refuse text that databases cannot store and UTF-8 responses cannot repeat."""
    waiting: list[tuple[str, Any]] = [("", document)]
    while waiting:
        pointer, value = waiting.pop()
        texts = [value] if isinstance(value, str) else list(value) if isinstance(value, dict) else []
        if any(UNSTORABLE.search(text) for text in texts):
            raise MalformedBody(
                "A string contains a null character or an unpaired surrogate.",
                pointer,
                "Remove it; write characters beyond U+FFFF directly or as a complete pair.",
            )
        if isinstance(value, dict):
            waiting += [(f"{pointer}/{token(key)}", item) for key, item in value.items()]
        elif isinstance(value, list):
            waiting += [
                (f"{pointer}/{number}", item)
                for number, item in enumerate(value)
                if isinstance(item, (str, dict, list))
            ]


def token(key: str) -> str:
    """One token of a JSON pointer (RFC 6901)."""
    return key[:60].replace("~", "~0").replace("/", "~1")
