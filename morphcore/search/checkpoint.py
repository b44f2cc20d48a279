"""Serialises the state of long work: plain values, restored exactly."""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import fields, is_dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from morphcore.errors import MorphError

Value = TypeVar("Value")

# keys that mark values that JSON cannot express
ARRAY, BYTES, TUPLE, TYPE = "$array", "$bytes", "$tuple", "$type"

_types: dict[str, type] = {}


def stored(cls: type[Value]) -> type[Value]:
    """Allow values of a dataclass in checkpoints. Its name is part of the format and must be unique."""
    known = _types.setdefault(cls.__name__, cls)
    if (known.__module__, known.__qualname__) != (cls.__module__, cls.__qualname__):
        raise TypeError(f"{known.__module__} already stores values under the name {cls.__name__}")
    _types[cls.__name__] = cls
    return cls


class UnreadableCheckpoint(MorphError):
    """A checkpoint is damaged or was written by another version."""

    code = "unreadable_checkpoint"


def pack(value: Any, version: str) -> bytes:
    """Return a plain value as bytes.

    Parameters
    ----------
    value : dataclasses marked `stored`, dictionaries, lists, tuples, numbers, strings, bytes, None, arrays.
    version : str
        Identifies the format of the value; only the same version is read back.
    """
    arrays: list[NDArray[Any]] = []
    header = json.dumps({"version": version, "value": _plain(value, arrays)})
    named = {str(i): array for i, array in enumerate(arrays)}
    out = io.BytesIO()
    np.savez(out, header=np.frombuffer(header.encode(), dtype=np.uint8), **named)  # type: ignore[arg-type]
    return out.getvalue()


def unpack(checkpoint: bytes, version: str, expected: type[Value]) -> Value:
    """Return the value that `pack` wrote.

    Raises
    ------
    UnreadableCheckpoint : the bytes are damaged, of another version, or of another type.
    """
    try:
        with np.load(io.BytesIO(checkpoint), allow_pickle=False) as content:
            arrays = {name: content[name] for name in content.files}
        header = json.loads(arrays.pop("header").tobytes())
        if header["version"] != version:
            raise UnreadableCheckpoint(
                f"the checkpoint has version {header['version']!r}, not {version!r}", hint="start again"
            )
        value = _filled(header["value"], arrays)
    except (ValueError, KeyError, TypeError, AttributeError, OSError, EOFError, zipfile.BadZipFile) as error:
        raise UnreadableCheckpoint(f"the checkpoint cannot be read: {error}", hint="start again") from None
    if not isinstance(value, expected):
        raise UnreadableCheckpoint(
            f"the checkpoint holds a {type(value).__name__}, not a {expected.__name__}", hint="start again"
        )
    return value


def _plain(value: Any, arrays: list[NDArray[Any]]) -> Any:
    if isinstance(value, np.ndarray):
        arrays.append(value)
        return {ARRAY: len(arrays) - 1}
    if isinstance(value, bytes):
        arrays.append(np.frombuffer(value, dtype=np.uint8))
        return {BYTES: len(arrays) - 1}
    if is_dataclass(value) and not isinstance(value, type):
        if _types.get(type(value).__name__) is not type(value):
            raise TypeError(f"{type(value).__name__} is not marked as stored")
        content = {item.name: getattr(value, item.name) for item in fields(value)}
        value = {TYPE: type(value).__name__, **content}
    if isinstance(value, dict):
        return {key: _plain(item, arrays) for key, item in value.items()}
    if isinstance(value, list | tuple):
        items = [_plain(item, arrays) for item in value]
        return {TUPLE: items} if isinstance(value, tuple) else items
    return value.item() if isinstance(value, np.generic) else value


def _filled(value: Any, arrays: dict[str, NDArray[Any]]) -> Any:
    if isinstance(value, list):
        return [_filled(item, arrays) for item in value]
    if not isinstance(value, dict):
        return value
    if ARRAY in value:
        return arrays[str(value[ARRAY])]
    if BYTES in value:
        return arrays[str(value[BYTES])].tobytes()
    if TUPLE in value:
        return tuple(_filled(item, arrays) for item in value[TUPLE])
    content = {key: _filled(item, arrays) for key, item in value.items()}
    kind = content.pop(TYPE, None)
    return content if kind is None else _types[kind](**content)
