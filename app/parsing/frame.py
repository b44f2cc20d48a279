"""The output of a parser process: a JSON text followed by its long lists of numbers as plain bytes.

The reader does not trust the frame: every length is checked, and only JSON values and lists of numbers are
made from it.
"""

from __future__ import annotations

import json
import struct
from array import array
from typing import Any

MAGIC = b"MPF1"
HEAD = struct.Struct("<4sII")  # magic, bytes of the JSON text, count of arrays
ARRAY = struct.Struct("<cQ")  # type code, bytes
WIDTHS = {b"d": 8, b"q": 8}  # float64, int64
MIN_ARRAY = 64  # items; shorter lists stay in the JSON text
MAX_EXCEPTIONS = 20  # non-numeric items of a list, kept separately so that errors can name their position
MARK = "\x00"  # key of a placeholder; input cannot contain this character
MAX_TEXT_BYTES = 4 * 2**20  # limit for everything except numbers; our requests need a few kilobytes
MAX_EXACT = 2**53  # larger integers are not exact as floats


class BadFrame(ValueError):
    """A parser's output is not a valid frame."""


def pack(value: Any) -> bytes:
    """Make a frame from a JSON value, which may have `array` objects in place of lists.

    Raises `BadFrame` if the non-numeric part exceeds `MAX_TEXT_BYTES`.
    """
    arrays: list[tuple[bytes, bytes]] = []
    text = json.dumps(_skeleton(value, arrays), separators=(",", ":")).encode()
    if len(text) > MAX_TEXT_BYTES:
        raise BadFrame(f"{len(text)} bytes are not a whole number of values")
    parts = [HEAD.pack(MAGIC, len(text), len(arrays)), text]
    for code, data in arrays:
        parts += [ARRAY.pack(code, len(data)), data]
    return b"".join(parts)


def unpack(frame: bytes) -> Any:
    """Read a frame; raise `BadFrame` if it is invalid."""
    try:
        magic, text_bytes, count = HEAD.unpack_from(frame)
        at = HEAD.size + text_bytes
        if magic != MAGIC or text_bytes > MAX_TEXT_BYTES:
            raise BadFrame("not a frame")
        text = frame[HEAD.size : at]
        arrays: list[list[Any]] = []
        for _ in range(count):
            code, length = ARRAY.unpack_from(frame, at)
            at += ARRAY.size
            if length % WIDTHS[code] or at + length > len(frame):
                raise BadFrame("an array of the wrong length")
            arrays.append(array(code.decode(), frame[at : at + length]).tolist())
            at += length
        if at != len(frame):
            raise BadFrame("more bytes than were announced")
        return json.loads(text, object_hook=lambda found: _restored(found, arrays))
    except (struct.error, KeyError, IndexError, TypeError, ValueError, RecursionError) as error:
        raise BadFrame(f"a parser's answer cannot be read: {type(error).__name__}") from None


def _restored(found: dict[str, Any], arrays: list[list[Any]]) -> Any:
    if MARK not in found:
        return found
    numbers = arrays[found[MARK]]
    for position in arrays[found["null"]] if "null" in found else ():
        numbers[position] = None
    for position, item in found["else"]:
        numbers[position] = item
    return numbers


def _skeleton(value: Any, arrays: list[tuple[bytes, bytes]]) -> Any:
    if isinstance(value, array):
        return _placed(value, [], arrays)
    if isinstance(value, dict):
        return {key: _skeleton(item, arrays) for key, item in value.items()}
    if isinstance(value, list):
        if len(value) >= MIN_ARRAY and (found := _numbers(value)) is not None:
            numbers, nulls, exceptions = found
            return _placed(numbers, exceptions, arrays, nulls)
        return [_skeleton(item, arrays) for item in value]
    return value


def _placed(
    numbers: array[Any],
    exceptions: list[Any],
    arrays: list[tuple[bytes, bytes]],
    nulls: array[Any] | None = None,
) -> dict[str, Any]:
    holder: dict[str, Any] = {MARK: len(arrays), "else": exceptions}
    arrays.append((numbers.typecode.encode(), numbers.tobytes()))
    if nulls:
        holder["null"] = len(arrays)
        arrays.append((nulls.typecode.encode(), nulls.tobytes()))
    return holder


def _numbers(items: list[Any]) -> tuple[array[Any], array[Any], list[Any]] | None:
    """A list as an array, the places of its nulls, and the few items that are neither with their places.

    None when it is no such list.
    """
    kinds = set(map(type, items))
    nulls = array("q")
    if kinds == {float}:
        return array("d", items), nulls, []
    exceptions: list[Any] = []
    numbers = array("d" if float in kinds else "q")
    for position, item in enumerate(items):
        number = type(item) is float or (type(item) is int and abs(item) <= MAX_EXACT)
        if item is None:
            nulls.append(position)
        elif not number:
            if len(exceptions) == MAX_EXCEPTIONS or isinstance(item, (dict, list)):
                return None
            exceptions.append([position, item])
        numbers.append(item if number else 0)
    return numbers, nulls, exceptions
