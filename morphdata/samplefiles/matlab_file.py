"""Flights as MATLAB files: the versions 4, 5 and 7 through scipy, 7.3 through h5py (`matlab_hdf5`)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, BinaryIO

from morphdata.samplefiles.columns import (
    FlightColumns,
    Wanted,
    column_in_si,
    equally_long,
    further_column,
    gathered,
)
from morphdata.samplefiles.comments import is_octave
from morphdata.samplefiles.fault import FileFault, octave_text, shown
from morphdata.samplefiles.frames import QUATERNION
from morphdata.samplefiles.titles import MAX_COLUMNS, chosen, meaning

NUMBERS = frozenset(
    {"double", "single", *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))}
)
CLASSES = {"float64": "double", "float32": "single"}  # numpy -> MATLAB
OBJECTS = frozenset({"opaque", "object", "function"})
OCTAVE_BINARY = b"Octave-1-"
SAVED = "again: save('flight.mat', ..., '-v7')"
HDF5 = b"\x89HDF\r\n\x1a\n"
PLAIN = "t = ts.Time(:); theta = ts.Data(:); save('flight.mat', 't', 'theta', ..., '-v7')"
AS_STRUCT = "s = table2struct(T, 'ToScalar', true); save('flight.mat', 's', '-v7')"

Contents = dict[str, tuple[tuple[int, ...], str]]  # variable -> shape, class


def read_matlab(stream: BinaryIO, wanted: Wanted) -> FlightColumns:
    """Read vectors (rows or columns), or one struct of vectors; variables nobody asked for stay unread.

    Raises
    ------
    FileFault : naming the variable and the row.
    """
    hdf5 = _is_hdf5(stream)
    try:
        if hdf5:
            from morphdata.samplefiles.matlab_hdf5 import read_hdf5

            return read_hdf5(stream, wanted)
        return _read(stream, _contents(stream), wanted)
    except (FileFault, MemoryError):
        raise
    # the reader has no error of its own for a broken file: anything comes out of it
    except Exception as error:  # noqa: BLE001
        words = shown(error) or type(error).__name__
        raise FileFault(
            "not_matlab",
            f"this is not a readable MATLAB file: {words}",
            f"save it {SAVED}",
        ) from None


def _is_hdf5(stream: BinaryIO) -> bool:
    """Whether a file is one of version 7.3, by how it begins.

    Raises
    ------
    FileFault : it is something else; scipy would stumble over it somewhere.
    """
    head = stream.read(1024)
    if head.startswith((HDF5, b"MATLAB 7.3")) or head[512:520] == HDF5:
        return True
    if is_octave(head.decode("latin-1")):
        raise octave_text()
    if head.startswith(OCTAVE_BINARY):
        raise replace(octave_text(), detail="this is an Octave binary file")
    if head and not head.startswith(b"MATLAB") and all(byte >= ord("\t") for byte in head):
        raise FileFault(
            "not_matlab",
            "this is a text, not a MATLAB file",
            f"give a table of text the ending .csv, or save {SAVED}",
        )
    return False


def _contents(stream: BinaryIO) -> Contents:
    """Every variable's shape and class, from the headers alone."""
    from scipy.io import whosmat

    stream.seek(0)
    try:
        return {name or "": (shape, kind) for name, shape, kind in whosmat(stream)}  # type: ignore[arg-type]
    except TypeError:  # the size of MATLAB's own objects is unknown outside of MATLAB
        raise object_fault("") from None


def _read(stream: BinaryIO, contents: Contents, wanted: Wanted) -> FlightColumns:
    if len(contents) > MAX_COLUMNS:
        raise FileFault(
            "too_many_columns", f"the file has {len(contents)} variables", "keep only the six columns needed"
        )
    if not any(is_wanted(name, wanted) for name in contents):
        structs = [name for name, (_, kind) in contents.items() if kind == "struct"]
        if len(structs) == 1:
            fields = _fields(stream, structs[0], contents[structs[0]][0])
            return vectors(dict(zip(wanted.called(fields), fields.values(), strict=True)), wanted)
        refuse_containers(contents, structs)
    named = dict(zip(wanted.called(contents), contents, strict=True))  # ours -> the file's
    names, others = chosen_vectors({name: contents[title] for name, title in named.items()}, wanted)
    unread = [name for name in named if name not in names and name not in others]
    loaded = _loaded(stream, [named[name] for name in (*names, *others)])
    return vectors({name: loaded[named[name]] for name in (*names, *others)}, wanted, unread)


def is_wanted(title: str, wanted: Wanted) -> bool:
    """Whether a variable is a column that counts."""
    return meaning(wanted.declared.called(title), (*wanted.names, *QUATERNION)) is not None


def chosen_vectors(contents: Contents, wanted: Wanted) -> tuple[list[str], list[str]]:
    """Variables that are columns which count, and further ones that are read, as long as those."""
    found = chosen(list(contents), wanted.names, wanted.optional)
    names = [list(contents)[position] for position, _ in found.values()]
    for name in names:
        require_vector(name, *contents[name], wanted)
    length = max(contents[names[0]][0], default=0)
    alike = [
        name
        for name, (shape, kind) in contents.items()
        if name not in names and kind in NUMBERS and _is_vector(shape) and max(shape) == length
    ]
    return names, wanted.further(alike)


def refuse_containers(contents: Contents, structs: list[str]) -> None:
    """Raise FileFault where what is wanted stands in several structs, or in an object."""
    objects = [name for name, (_, kind) in contents.items() if kind in OBJECTS]
    if len(structs) > 1:
        listed = ", ".join(shown(name) for name in structs[:5])
        raise FileFault(
            "several_structs", f"the file holds several structs: {listed}", "save one flight a file"
        )
    if objects:
        raise object_fault(objects[0])


def object_fault(name: str) -> FileFault:
    """The fault of an object of MATLAB."""
    return FileFault(
        "matlab_object",
        f"{shown(name) or 'a variable'} is an object (timeseries, table, ...), which only MATLAB can read",
        f"save plain vectors: {PLAIN}; or a struct: {AS_STRUCT}",
        title=name,
    )


def require_vector(name: str, shape: tuple[int, ...], kind: str, wanted: Wanted) -> None:
    """Raise FileFault where a variable is no vector of numbers that is short enough."""
    if kind in OBJECTS:
        raise object_fault(name)
    if kind not in NUMBERS:
        hint = "save it as a vector of doubles: theta = double(theta(:))"
        raise FileFault("not_numbers", f"{shown(name)} is of the class {shown(kind)}", hint, title=name)
    if not _is_vector(shape):
        size = " x ".join(map(str, shape))
        raise FileFault("not_a_vector", f"{shown(name)} is {size}", "give one row or column", title=name)
    if max(shape) > wanted.max_rows:
        raise wanted.too_many_rows()


def _is_vector(shape: tuple[int, ...]) -> bool:
    return len(shape) == 2 and min(shape) == 1


def _loaded(stream: BinaryIO, names: list[str]) -> dict[str, Any]:
    from scipy.io import loadmat

    stream.seek(0)
    read = loadmat(stream, variable_names=names)  # type: ignore[arg-type]  # takes streams too
    return {name: item for name, item in read.items() if name in names}


def _fields(stream: BinaryIO, name: str, shape: tuple[int, ...]) -> dict[str, Any]:
    """The fields of the one struct."""
    if set(shape) != {1}:
        size = " x ".join(map(str, shape))
        raise FileFault("not_a_vector", f"{shown(name)} is a {size} array of structs", AS_STRUCT, title=name)
    struct = _loaded(stream, [name])[name]
    if struct.dtype.names is None:
        raise object_fault(name)
    record = struct[0, 0]
    return {field: record[field] for field in struct.dtype.names}


def vectors(arrays: Mapping[str, Any], wanted: Wanted, unread: Sequence[str] = ()) -> FlightColumns:
    """The flight that arrays hold, by the names of their columns.

    Parameters
    ----------
    arrays : vectors of numpy.
    unread : names of further variables, which were not read.
    """
    titles = list(arrays)
    found = chosen(titles, wanted.names, wanted.optional)
    names = {name: titles[position] for name, (position, _) in found.items()}
    values = {}
    for name, title in names.items():
        item = arrays[title]
        kind = CLASSES.get(item.dtype.name, item.dtype.name) if hasattr(item, "ravel") else "sparse"
        require_vector(title, item.shape, kind, wanted)
        # Python's own numbers: whole ones of 64 bits are subtracted from each other exactly
        values[name] = column_in_si(name, item.ravel().tolist(), found[name][1], title)
    columns = equally_long(FlightColumns(values), names)
    if not len(values[wanted.names[0]]):
        raise FileFault("no_rows", "the vectors are empty", "give rows of numbers")
    further = [title for title in titles if title not in names.values()]
    faults = _keep_numbers(columns, {title: arrays[title] for title in wanted.further(further)})
    return gathered(wanted, [*further, *unread], columns, faults=faults)


def _keep_numbers(columns: FlightColumns, arrays: Mapping[str, Any]) -> dict[str, FileFault]:
    """Add what is as long as the rest and holds nothing but numbers; what is wrong with the others."""
    rows = len(next(iter(columns.values.values())))
    faults = {}
    for title, item in arrays.items():
        if getattr(item, "size", 0) == rows and item.dtype.kind in "iuf":
            try:
                columns.others[title] = further_column(item.ravel().astype(float).tolist(), title)
            except FileFault as fault:
                faults[title] = fault
    return faults
