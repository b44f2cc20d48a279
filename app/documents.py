"""Documents as rows: deflated JSON, without NaN or infinity, with a digest that ignores the order of keys."""

from __future__ import annotations

import hashlib
import json
import math
import zlib
from dataclasses import dataclass
from typing import Any

from pydantic_core import to_json

Document = dict[str, Any]

CONTAINERS = frozenset({dict, list, tuple})

# trajectories shrink threefold in a few milliseconds; level 6 gains 10 per cent for four times the time
DEFLATE_LEVEL = 1


def finite(value: Any) -> Any:
    """Copy a JSON value with every NaN and infinity replaced by None (JSON cannot express them)."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(item) for item in value]
    return value


def json_bytes(document: Any) -> bytes:
    """Compact JSON in UTF-8 with sorted keys; numbers keep every digit, NaN and infinity become null."""
    # ten times as fast as json.dumps, which would block every other request while it writes a long flight
    return to_json(_sorted(document), inf_nan_mode="null")


def _sorted(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _sorted(value[key]) for key in sorted(value)}
    if isinstance(value, (list, tuple)) and not CONTAINERS.isdisjoint(map(type, value)):
        return [_sorted(item) for item in value]
    return value


def packed(document: Any) -> bytes:
    """Return the document in its stored form."""
    return zlib.compress(json_bytes(document), DEFLATE_LEVEL)


def unpacked(data: bytes) -> Any:
    """Undo `packed`."""
    return json.loads(zlib.decompress(data))


def unpacked_json(data: bytes) -> bytes:
    """Return the stored JSON text itself, for answers that pass it on unchanged."""
    return zlib.decompress(data)


@dataclass(frozen=True, slots=True)
class Sealed:
    """A document ready to be stored: deflated, with the SHA-256 of its canonical JSON as hexadecimal text."""

    data: bytes
    sha256: str


def sealed(document: Any) -> Sealed:
    """Compress and hash a document once; megabytes take a while, so do it before a transaction begins."""
    text = json_bytes(document)
    return Sealed(zlib.compress(text, DEFLATE_LEVEL), hashlib.sha256(text).hexdigest())
