"""ULog files of a few messages, byte by byte from the format's public definition."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

HEADER = b"\x55\x4c\x6f\x67\x01\x12\x35\x01" + struct.pack("<Q", 1_000_000)
SYNC = b"\x2f\x73\x13\x20\x25\x0c\xbb\x12"
TYPES = {"uint64_t": "Q", "float": "f", "double": "d"}

Fields = Mapping[str, Sequence[Any]]  # "float[4] q" -> rows


def message(kind: str, content: bytes) -> bytes:
    """One message with its head."""
    return struct.pack("<HB", len(content), ord(kind)) + content


def definition(topic: str, fields: Sequence[str]) -> bytes:
    """The format of a topic."""
    return message("F", f"{topic}:{';'.join(fields)};".encode())


def subscription(number: int, topic: str, instance: int) -> bytes:
    """That a topic's data follow under a number."""
    return message("A", struct.pack("<BH", instance, number) + topic.encode())


def data(number: int, fields: Fields, row: int) -> bytes:
    """A row of a topic."""
    content = struct.pack("<H", number)
    for declaration, rows in fields.items():
        kind = TYPES[declaration.split()[0].partition("[")[0]]
        for value in np.atleast_1d(rows[row]):
            content += struct.pack(f"<{kind}", int(value) if kind == "Q" else float(value))
    return message("D", content)


def ulog(topics: Mapping[str, Fields]) -> bytes:
    """A log of topics, ``topic#1`` for a second instance; each has a field ``uint64_t timestamp``."""
    named = [(name.partition("#")[0], int(name.partition("#")[2] or 0)) for name in topics]
    flags = message("B", bytes(40))
    formats = {
        topic: definition(topic, list(fields))
        for (topic, _), fields in zip(named, topics.values(), strict=True)
    }
    added = [subscription(number, *name) for number, name in enumerate(named)]
    rows = sorted(
        (int(fields["uint64_t timestamp"][row]), number, data(number, fields, row))
        for number, fields in enumerate(topics.values())
        for row in range(len(fields["uint64_t timestamp"]))
    )
    return b"".join([HEADER, flags, *formats.values(), *added, *(content for _, _, content in rows)])
