"""Flights as Parquet files, through pyarrow."""

from __future__ import annotations

from array import array
from typing import Any, BinaryIO

from morphdata.samplefiles.columns import (
    FlightColumns,
    Wanted,
    column_in_si,
    further_column,
    gathered,
    not_finite,
)
from morphdata.samplefiles.fault import FileFault, shown
from morphdata.samplefiles.titles import MAX_COLUMNS, chosen

BATCH_ROWS = 16_384
CLOCK_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}  # of Arrow's moments and durations, s
MAX_THRIFT = 10_000_000  # bytes and items of the footer; what it claims is allocated before it is read


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
            thrift_string_size_limit=MAX_THRIFT,
            thrift_container_size_limit=MAX_THRIFT,
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
    if file.metadata.num_rows > wanted.max_rows:
        raise wanted.too_many_rows()
    if file.metadata.num_columns > MAX_COLUMNS:
        raise FileFault(
            "too_many_columns", f"the file has {file.metadata.num_columns} columns", "keep the six that count"
        )
    schema = file.schema_arrow
    titles = list(schema.names)
    called = wanted.called(titles)
    found = chosen(called, wanted.names, wanted.optional)
    requested = {titles[position]: name for name, (position, _) in found.items()}
    for title, name in requested.items():
        _require_numbers(schema.field(title).type, title, dates=name == "t")
    numeric = [
        title
        for title in dict.fromkeys(titles)
        if title not in requested and titles.count(title) == 1 and _numeric(schema, title)
    ]
    names = dict(zip(titles, called, strict=True))
    further_names = set(wanted.further(names[title] for title in numeric))
    others = [title for title in numeric if names[title] in further_names]
    read, further = _decoded(file, list(requested), others, wanted)
    if not len(read[next(iter(requested))]):
        raise FileFault("no_rows", "the file holds no rows", "give rows of numbers")
    values = {}
    for name, (position, factor) in found.items():
        title = titles[position]
        own = CLOCK_UNITS.get(getattr(schema.field(title).type, "unit", ""), factor)
        values[name] = column_in_si(name, read[title], own, title)
    columns, faults = FlightColumns(values), {}
    for title, raw in further.items():
        try:
            columns.others[names[title]] = further_column(raw, names[title])
        except FileFault as fault:
            faults[names[title]] = fault
    rest = [names[title] for title in titles if title not in requested]
    return gathered(wanted, rest, columns, faults=faults)


def _decoded(
    file: Any, requested: list[str], others: list[str], wanted: Wanted
) -> tuple[dict[str, Any], dict[str, array[float]]]:
    """Read columns batch by batch, counting rows: the footer may lie."""
    import pyarrow as pa

    read: dict[str, Any] = {title: [] for title in requested}
    further = {title: array("d") for title in others}
    rows = 0
    for batch in file.iter_batches(batch_size=BATCH_ROWS, columns=[*requested, *others], use_threads=False):
        if rows + batch.num_rows > wanted.max_rows:
            raise wanted.too_many_rows()
        for title in requested:
            column = batch.column(title)
            if column.null_count:
                raise not_finite(title, None, rows + column.is_valid().to_pylist().index(False))
            read[title] += _numbers(column)
        for title in tuple(further):
            try:
                # whole numbers beyond 2^53 lose digits: nobody asked for this column, and it spoils no flight
                floats = batch.column(title).cast("float64", safe=False)
            except pa.ArrowException:
                del further[title]
            else:
                further[title].frombytes(floats.to_numpy(zero_copy_only=False).tobytes())
        rows += batch.num_rows
    return read, further


def _numbers(column: Any) -> list[Any]:
    """Python's numbers: whole ones, and moments as such, with all their digits."""
    from pyarrow import types

    if types.is_timestamp(column.type) or types.is_duration(column.type):
        column = column.cast("int64")
    elif not types.is_integer(column.type):
        column = column.cast("float64")
    return list(column.to_pylist())


def _require_numbers(kind: Any, title: str, *, dates: bool) -> None:
    from pyarrow import types

    if not _number_type(kind) and not (dates and (types.is_timestamp(kind) or types.is_duration(kind))):
        hint = "write seconds and radians as floating point numbers"
        raise FileFault("not_numbers", f"{shown(title)} holds {shown(kind)}, not numbers", hint, title=title)


def _numeric(schema: Any, title: str) -> bool:
    return _number_type(schema.field(title).type)


def _number_type(kind: Any) -> bool:
    from pyarrow import types

    return bool(types.is_integer(kind) or types.is_floating(kind) or types.is_decimal(kind))
