"""Flights as MATLAB files of version 7.3, which are HDF5, through h5py.

Such a file may come from anybody. Nothing in it is followed: no link, no reference, no data in other files,
no filter beyond those of HDF5 itself; and what a dataset claims is checked before a byte of it is read.
"""

from __future__ import annotations

import math
from typing import Any, BinaryIO

from morphdata.samplefiles.columns import FlightColumns, Wanted
from morphdata.samplefiles.fault import FileFault, shown
from morphdata.samplefiles.matlab_file import (
    AS_STRUCT,
    CLASSES,
    Contents,
    chosen_vectors,
    is_wanted,
    refuse_containers,
    vectors,
)
from morphdata.samplefiles.titles import MAX_COLUMNS

HIDDEN = ("#refs#", "#subsystem#")  # groups of MATLAB's own
FILTERS = frozenset((1, 2, 3))  # deflate, shuffle, fletcher32: HDF5's own, no plug-in
MAX_CHUNK_BYTES = 64 * 2**20  # what one chunk is unpacked to
MAX_CLASS = 40  # characters of a class


def read_hdf5(stream: BinaryIO, wanted: Wanted) -> FlightColumns:
    """Read vectors (rows or columns), or one struct of vectors; variables nobody asked for stay unread.

    Raises
    ------
    FileFault : naming the variable and the row; or h5py is missing.
    """
    try:
        import h5py
    except ImportError:
        raise FileFault(
            "needs_h5py",
            "this is a MATLAB 7.3 (HDF5) file, which is read by h5py, which is not installed",
            "pip install 'morphid[formats]', or save it as version 7: save('flight.mat', ..., '-v7')",
        ) from None
    stream.seek(0)
    with h5py.File(stream, "r") as file:
        return _read(file, wanted)


def _read(file: Any, wanted: Wanted) -> FlightColumns:
    contents = _contents(file, "")
    if not any(is_wanted(name, wanted) for name in contents):
        structs = [name for name, (_, kind) in contents.items() if kind == "struct"]
        if len(structs) == 1:
            return _columns(file[structs[0]], f"{structs[0]}.", wanted)
        refuse_containers(contents, structs)
    return _columns(file, "", wanted)


def _columns(group: Any, where: str, wanted: Wanted) -> FlightColumns:
    """The flight in the datasets of a group."""
    contents = _contents(group, where)
    named = dict(zip(wanted.called(contents), contents, strict=True))  # ours -> the file's
    names, others = chosen_vectors({name: contents[title] for name, title in named.items()}, wanted)
    for name in names:
        _require_readable(group[named[name]], f"{where}{named[name]}")
    others = [name for name in others if _is_readable(group[named[name]])]
    unread = [name for name in named if name not in names and name not in others]
    read = {name: group[named[name]][()].ravel() for name in (*names, *others)}
    return vectors({name: values[None, :] for name, values in read.items()}, wanted, unread)


def _contents(group: Any, where: str) -> Contents:
    """Shape and class of everything in a group, which is not followed any deeper."""
    if len(group) > MAX_COLUMNS + len(HIDDEN):
        detail = f"{shown(where) or 'the file'} has {len(group)} variables"
        raise FileFault("too_many_columns", detail, "keep only the columns needed")
    return {name: _facts(group, name) for name in group if name not in HIDDEN}


def _facts(group: Any, name: str) -> tuple[tuple[int, ...], str]:
    """Shape, as MATLAB has it, and class of a variable."""
    import h5py

    if not isinstance(group.get(name, getlink=True), h5py.HardLink):
        return (), "link"  # to another place or another file
    item = group[name]
    kind = _class(item)
    if isinstance(item, h5py.Group):
        return (), kind or "struct"
    if not isinstance(item, h5py.Dataset) or item.shape is None:
        return (), "nothing"
    if "MATLAB_empty" in item.attrs:
        return (0, 0), kind or "double"
    shape = (1, *item.shape) if len(item.shape) == 1 else item.shape
    return tuple(map(int, shape)), _number_class(item, kind)


def _class(item: Any) -> str:
    """The class that MATLAB says a variable has; "" where it says nothing."""
    if "MATLAB_object_decode" in item.attrs:
        return "object"
    if "MATLAB_class" not in item.attrs:
        return ""
    attribute = item.attrs.get_id("MATLAB_class")
    if attribute.shape != () or attribute.dtype.kind != "S" or attribute.dtype.itemsize > MAX_CLASS:
        return "unknown"
    return bytes(item.attrs["MATLAB_class"]).decode("ascii", "replace")


def _number_class(item: Any, kind: str) -> str:
    """The class of a dataset, by what MATLAB says and by what is in it."""
    if item.dtype.kind == "O":
        return "cell"  # references: cells, and arrays of structs
    if item.dtype.kind not in "iuf" or item.dtype.itemsize > 8:
        return kind if kind and kind not in CLASSES.values() else f"{item.dtype.name}"
    # a vector that no MATLAB wrote has no class; chars and logicals are stored as whole numbers
    return kind or CLASSES.get(item.dtype.name, item.dtype.name)


def _require_readable(item: Any, name: str) -> None:
    if not _is_readable(item):
        raise FileFault(
            "not_plain",
            f"{shown(name)} is stored in other files, in huge pieces, or packed by a filter that is not read",
            f"save it from MATLAB, as plain vectors or as a struct: {AS_STRUCT}",
            title=name,
        )


def _is_readable(item: Any) -> bool:
    """Whether the numbers of a dataset stand in this file and can be unpacked in little memory."""
    creation = item.id.get_create_plist()
    filters = {creation.get_filter(number)[0] for number in range(creation.get_nfilters())}
    chunk = 0 if item.chunks is None else math.prod(item.chunks) * item.dtype.itemsize
    in_other_files = item.is_virtual or creation.get_external_count() > 0
    return filters <= FILTERS and chunk <= MAX_CHUNK_BYTES and not in_other_files
