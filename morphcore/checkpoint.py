"""The state of long work as bytes: dataclasses, numbers, texts and arrays, all exactly as they were."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from morphcore.errors import MorphError

Value = TypeVar("Value")

ARRAY = "$array"  # stands in the JSON for an array beside it


class UnreadableCheckpoint(MorphError):
    """A checkpoint is damaged or was written by another version."""

    code = "unreadable_checkpoint"


def pack(value: Any, version: str) -> bytes:
    """A tree of dataclasses, dicts, lists, tuples, numbers, texts, None and arrays as bytes.

    Numbers are written so that they come back exactly. ``version`` names what the tree means.
    """
    arrays: list[NDArray[Any]] = []
    header = json.dumps({"version": version, "value": _plain(value, arrays)})
    named = {str(i): array for i, array in enumerate(arrays)}
    out = io.BytesIO()
    np.savez(out, header=np.frombuffer(header.encode(), dtype=np.uint8), **named)  # type: ignore[arg-type]
    return out.getvalue()


def unpack(checkpoint: bytes, version: str, build: Callable[[Any], Value]) -> Value:
    """What ``build`` makes of the tree that ``pack`` wrote, its dataclasses and tuples as dicts and lists.

    Raises
    ------
    UnreadableCheckpoint : the bytes are damaged, of another version, or not what ``build`` knows.
    """
    try:
        with np.load(io.BytesIO(checkpoint), allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
        header = json.loads(arrays.pop("header").tobytes())
        if header["version"] != version:
            raise UnreadableCheckpoint(
                f"the checkpoint is of {header['version']!r}, not {version!r}", hint="start anew"
            )
        return build(_filled(header["value"], arrays))
    except (ValueError, KeyError, TypeError, AttributeError, OSError, EOFError, zipfile.BadZipFile) as error:
        raise UnreadableCheckpoint(f"the checkpoint cannot be read: {error}", hint="start anew") from None


def _plain(value: Any, arrays: list[NDArray[Any]]) -> Any:
    if isinstance(value, np.ndarray):
        arrays.append(value)
        return {ARRAY: len(arrays) - 1}
    if isinstance(value, np.generic):
        return value.item()
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: _plain(getattr(value, field.name), arrays) for field in fields(value)}
    if isinstance(value, dict):
        return {key: _plain(item, arrays) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item, arrays) for item in value]
    return value


def _filled(value: Any, arrays: dict[str, NDArray[Any]]) -> Any:
    if isinstance(value, dict):
        if ARRAY in value:
            return arrays[str(value[ARRAY])]
        return {key: _filled(item, arrays) for key, item in value.items()}
    if isinstance(value, list):
        return [_filled(item, arrays) for item in value]
    return value
