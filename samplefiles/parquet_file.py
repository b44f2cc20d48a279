"""Flights as Parquet files, through pyarrow."""

from __future__ import annotations

from array import array
from typing import Any, BinaryIO

from samplefiles.columns import FlightColumns, Wanted, in_si, not_finite
from samplefiles.fault import FileFault, shown
from samplefiles.titles import MOST_COLUMNS, chosen

BATCH_ROWS = 16_384
MOST_THRIFT = 10_000_000  # bytes and items of the footer; what it claims is allocated before it is read


def read_parquet(stream: BinaryIO, wanted: Wanted) -> FlightColumns:
    """Read the columns of numbers of a Parquet file; those that nobody asked for are never decoded.

    Raises
    ------
    FileFault : naming column and row.
    """
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError:
        raise FileFault(
            "needs_pyarrow",
            "Parquet files are read by pyarrow, which is not installed",
            "pip install pyarrow, or save the flight as CSV",
        ) from None
    try:
        file = pq.ParquetFile(
            stream,
            pre_buffer=False,
            thrift_string_size_limit=MOST_THRIFT,
            thrift_container_size_limit=MOST_THRIFT,
        )
        return _read(file, wanted)
    except (pa.ArrowException, OSError, ValueError, TypeError, OverflowError) as error:
        words = shown(str(error).splitlines()[0] if str(error) else type(error).__name__)
        raise FileFault(
            "not_parquet",
            f"this is not a readable Parquet file: {words}",
            "write it again, or save it as CSV",
        ) from None


def _read(file: Any, wanted: Wanted) -> FlightColumns:
    if file.metadata.num_rows > wanted.most_rows:
        raise wanted.too_many_rows()
    if file.metadata.num_columns > MOST_COLUMNS:
        raise FileFault(
            "too_many_columns", f"the file has {file.metadata.num_columns} columns", "keep the six that count"
        )
    schema = file.schema_arrow
    titles = list(schema.names)
    found = chosen(titles, wanted.names)
    asked = {titles[position]: factor for position, factor in found.values()}
    for title in asked:
        _require_numbers(schema.field(title).type, title)
    others = [
        title
        for title in dict.fromkeys(titles)
        if wanted.others and title not in asked and titles.count(title) == 1 and _numeric(schema, title)
    ]
    read = _decoded(file, [*asked, *others], wanted, set(asked))
    if not len(read[next(iter(asked))]):
        raise FileFault("no_rows", "the file holds no rows", "give rows of numbers")
    kept = {}
    for title in others:
        try:
            kept[title] = in_si(read[title], 1.0, title)
        except FileFault:
            continue
    values = {
        name: in_si(read[titles[found[name][0]]], found[name][1], titles[found[name][0]])
        for name in wanted.names
    }
    return FlightColumns(values, kept)


def _decoded(file: Any, titles: list[str], wanted: Wanted, strict: set[str]) -> dict[str, array[float]]:
    """Read columns batch by batch, counting rows: the footer may lie."""
    read = {title: array("d") for title in titles}
    for batch in file.iter_batches(batch_size=BATCH_ROWS, columns=titles, use_threads=False):
        before = len(read[titles[0]])
        if before + batch.num_rows > wanted.most_rows:
            raise wanted.too_many_rows()
        for title in titles:
            column = batch.column(title)
            if column.null_count and title in strict:
                row = column.is_valid().to_pylist().index(False)
                raise not_finite(title, None, before + row)
            read[title].frombytes(column.cast("float64").to_numpy(zero_copy_only=False).tobytes())
    return read


def _require_numbers(kind: Any, title: str) -> None:
    if not _number_type(kind):
        hint = "write seconds and radians as floating point numbers"
        raise FileFault("not_numbers", f"{shown(title)} holds {shown(kind)}, not numbers", hint, title=title)


def _numeric(schema: Any, title: str) -> bool:
    return _number_type(schema.field(title).type)


def _number_type(kind: Any) -> bool:
    from pyarrow import types

    return bool(types.is_integer(kind) or types.is_floating(kind) or types.is_decimal(kind))
