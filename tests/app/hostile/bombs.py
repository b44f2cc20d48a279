"""Files that are small on the wire and enormous when they are read, made here and never stored."""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Callable

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

MIB = 2**20
GIB = 2**30  # twice what a parser may use
TITLES = "t,sweep_left,sweep_right,phi,theta,psi\n"
NAMES = TITLES.strip().split(",")
ROWS = "".join(f"{0.01 * i:.2f},0,0,0,0,0\n" for i in range(100))
MATLAB_HEAD = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x0100) + b"IM"
ZEROS = bytes(MIB)
DOUBLE, STRUCT, CELL, OBJECT = 6, 2, 1, 3


def csv_of_a_million_columns() -> bytes:
    """A title line of a million titles."""
    return (TITLES.strip() + ",x" * 1_000_000 + "\n" + ROWS).encode()


def csv_of_one_endless_line() -> bytes:
    """Sixteen megabytes without a line end."""
    return TITLES.encode() + b"1" * (16 * MIB)


def csv_of_one_endless_cell() -> bytes:
    """A quote that is never closed."""
    return TITLES.encode() + b'"' + b"1\n" * (8 * MIB)


def csv_of_blank_lines() -> bytes:
    """Sixteen million lines without anything."""
    return TITLES.encode() + b"\n" * (16 * MIB)


def csv_of_many_short_rows() -> bytes:
    """More rows than a flight has."""
    return TITLES.encode() + b"0,0,0,0,0,0\n" * 700_000


def element(kind: int, data: bytes) -> bytes:
    """A MATLAB version 5 data element."""
    return struct.pack("<II", kind, len(data)) + data + b"\0" * (-len(data) % 8)


def matrix_head(kind: int, shape: tuple[int, ...], name: str) -> bytes:
    """Flags, dimensions and name of a MATLAB array."""
    flags = element(6, struct.pack("<II", kind, 0))
    return flags + element(5, struct.pack(f"<{len(shape)}i", *shape)) + element(1, name.encode())


def squeezed(head: bytes, kind: int, zeros: int) -> bytes:
    """A compressed matrix of `zeros` bytes: a thousandth of that on the wire."""
    whole, rest = divmod(zeros, MIB)
    packer = zlib.compressobj(9)
    start = (
        struct.pack("<II", 14, len(head) + 8 + zeros) + head + struct.pack("<II", kind, zeros) + bytes(rest)
    )
    packed = packer.compress(start) + packer.flush(zlib.Z_FULL_FLUSH)
    block = packer.compress(bytes(MIB)) + packer.flush(zlib.Z_FULL_FLUSH)  # stands for itself: repeated below
    check = zlib.adler32(start)
    for _ in range(whole):
        check = zlib.adler32(ZEROS, check)
    packed += block * whole + packer.flush()[:-4] + struct.pack(">I", check)
    return struct.pack("<II", 15, len(packed)) + packed


def honest(name: str) -> bytes:
    """A vector of a hundred zeros."""
    return squeezed(matrix_head(DOUBLE, (1, 100), name), 9, 800)


def mat_zlib_bomb() -> bytes:
    """A vector theta of a gigabyte, which says so."""
    size = GIB
    others = b"".join(honest(name) for name in NAMES if name != "theta")
    return MATLAB_HEAD + others + squeezed(matrix_head(DOUBLE, (1, size // 8), "theta"), 9, size)


def mat_lying_about_its_length() -> bytes:
    """A vector theta of a hundred doubles, says its head; its data go on for a gigabyte."""
    others = b"".join(honest(name) for name in NAMES if name != "theta")
    return MATLAB_HEAD + others + squeezed(matrix_head(DOUBLE, (1, 100), "theta"), 9, GIB)


def mat_struct_bomb() -> bytes:
    """A struct whose one field holds a gigabyte: the size of fields stands in no head."""
    size = GIB
    fields = element(5, struct.pack("<i", 32)) + element(1, b"theta".ljust(32, b"\0"))
    inner = matrix_head(DOUBLE, (1, size // 8), "")
    outer = matrix_head(STRUCT, (1, 1), "flight") + fields
    head = outer + struct.pack("<II", 14, len(inner) + 8 + size) + inner
    return MATLAB_HEAD + squeezed(head, 9, size)


def mat_claiming_memory() -> bytes:
    """A struct with one field that claims two billion doubles and brings none."""
    inner = element(14, matrix_head(DOUBLE, (1, 2_000_000_000), "") + element(9, b""))
    fields = element(5, struct.pack("<i", 32)) + element(1, b"theta".ljust(32, b"\0"))
    return MATLAB_HEAD + element(14, matrix_head(STRUCT, (1, 1), "flight") + fields + inner)


def mat_of_nested_cells() -> bytes:
    """A hundred thousand cells, each inside the other, in a struct."""
    inner = element(14, matrix_head(DOUBLE, (1, 1), "") + element(9, bytes(8)))
    head = matrix_head(CELL, (1, 1), "")
    depth = 20_000
    start = [struct.pack("<II", 14, 0)] * depth
    size = len(inner)
    for level in range(depth):
        size += len(head)
        start[depth - 1 - level] = struct.pack("<II", 14, size) + head
        size += 8
    nested = b"".join(start) + inner
    fields = element(5, struct.pack("<i", 32)) + element(1, b"theta".ljust(32, b"\0"))
    packed = zlib.compress(element(14, matrix_head(STRUCT, (1, 1), "flight") + fields + nested))
    return MATLAB_HEAD + struct.pack("<II", 15, len(packed)) + packed


def mat_of_many_objects() -> bytes:
    """A cell array of a hundred million empty cells, as the only field of a struct."""
    inner = element(14, matrix_head(CELL, (10_000, 10_000), ""))
    fields = element(5, struct.pack("<i", 32)) + element(1, b"theta".ljust(32, b"\0"))
    return MATLAB_HEAD + element(14, matrix_head(STRUCT, (1, 1), "flight") + fields + inner)


def parquet(table: pa.Table, **options: object) -> bytes:
    """A table as a file."""
    stream = io.BytesIO()
    pq.write_table(table, stream, **options)
    return stream.getvalue()


def parquet_of_many_rows() -> bytes:
    """Four hundred thousand equal rows: some kilobytes."""
    zeros = pa.array(np.zeros(400_000))
    return parquet(pa.table(dict.fromkeys(NAMES, zeros)), compression="zstd")


def parquet_lying_about_its_rows() -> bytes:
    """A million rows; the footer says a hundred."""
    zeros = pa.array(np.zeros(1_100_000))
    true = parquet(pa.table(dict.fromkeys(NAMES, zeros)), compression="zstd")
    lie = bytes(
        [0xC8, 0x81, 0x80, 0x00]
    )  # the number 100 in the four bytes of 1,100,000, as thrift writes it
    assert varint(1_100_000) in true
    return true.replace(varint(1_100_000), lie)


def varint(value: int) -> bytes:
    """A number as compact thrift writes it."""
    left, found = value << 1, b""
    while left >= 0x80:
        found += bytes([left & 0x7F | 0x80])
        left >>= 7
    return found + bytes([left])


def parquet_of_many_columns() -> bytes:
    """Twenty thousand columns."""
    zero = pa.array([0.0])
    return parquet(pa.table({**dict.fromkeys(NAMES, zero), **{f"x{i}": zero for i in range(20_000)}}))


def parquet_of_nested_lists() -> bytes:
    """A column of lists of lists, a hundred deep."""
    kind: pa.DataType = pa.float64()
    value: object = 1.0
    for _ in range(100):
        kind, value = pa.list_(kind), [value]
    columns = {name: pa.array([0.0]) for name in NAMES}
    return parquet(pa.table({**columns, "theta": pa.array([value], kind)}))


def parquet_with_a_huge_footer() -> bytes:
    """A footer that claims to be longer than the file."""
    return b"PAR1" + b"\x15" * MIB + struct.pack("<I", 2**31 - 1) + b"PAR1"


def zip_bomb() -> bytes:
    """Zeros, packed a thousandfold."""
    return zlib.compress(bytes(64 * MIB), 9)


BOMBS: dict[str, tuple[str, Callable[[], bytes]]] = {
    f"{made.__name__}{ending}": (ending, made)
    for ending, made in (
        (".csv", csv_of_a_million_columns),
        (".csv", csv_of_one_endless_line),
        (".csv", csv_of_one_endless_cell),
        (".csv", csv_of_blank_lines),
        (".csv", csv_of_many_short_rows),
        (".csv", zip_bomb),
        (".csv.gz", zip_bomb),
        (".mat", mat_zlib_bomb),
        (".mat", mat_lying_about_its_length),
        (".mat", mat_struct_bomb),
        (".mat", mat_claiming_memory),
        (".mat", mat_of_nested_cells),
        (".mat", mat_of_many_objects),
        (".mat", zip_bomb),
        (".parquet", parquet_of_many_rows),
        (".parquet", parquet_lying_about_its_rows),
        (".parquet", parquet_of_many_columns),
        (".parquet", parquet_of_nested_lists),
        (".parquet", parquet_with_a_huge_footer),
        (".parquet", zip_bomb),
    )
}
