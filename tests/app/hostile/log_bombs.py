"""HDF5 files and logs that are small on the wire and enormous when they are read."""

from __future__ import annotations

import io
import struct
from collections.abc import Callable
from typing import Any

import h5py
import numpy as np

from tests.morphdata.samplefiles.ulog import HEADER, SYNC, definition, message, subscription

NAMES = ("t", "sweep_left", "sweep_right", "phi", "theta", "psi")
MIB = 2**20


def hdf5(spoil: Callable[[Any], None], without: str = "theta") -> bytes:
    """A flight of a hundred rows, and what `spoil` adds."""
    stream = io.BytesIO()
    with h5py.File(stream, "w") as file:
        for name in NAMES:
            if name != without:
                file[name] = 0.01 * np.arange(100)
        spoil(file)
    return stream.getvalue()


def hdf5_of_a_huge_piece() -> bytes:
    """A hundred numbers in one piece that unpacks to a gigabyte."""

    def spoil(file: Any) -> None:
        plist = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        plist.set_chunk((2**27,))
        plist.set_deflate(9)
        space = h5py.h5s.create_simple((100,), (h5py.h5s.UNLIMITED,))
        h5py.h5d.create(file.id, b"theta", h5py.h5t.IEEE_F64LE, space, plist)

    return hdf5(spoil)


def hdf5_of_terabytes() -> bytes:
    """A vector that claims a trillion numbers and brings none."""
    return hdf5(lambda file: file.create_dataset("theta", (10**12,), "f8", chunks=(1000,)))


def hdf5_of_many_groups() -> bytes:
    """Twenty thousand structs."""
    return hdf5(lambda file: [file.create_group(f"g{number}") for number in range(20_000)])


def hdf5_of_cycles() -> bytes:
    """Groups that hold each other, and links that lead to themselves."""

    def spoil(file: Any) -> None:
        first, second = file.create_group("a"), file.create_group("b")
        first["b"], second["a"] = second, first
        file["theta"] = h5py.SoftLink("/theta")

    return hdf5(spoil)


def hdf5_of_long_strings() -> bytes:
    """A column of texts of variable length, and a class of a megabyte."""

    def spoil(file: Any) -> None:
        file.create_dataset("theta", data=["x" * MIB] * 12)
        file["a"] = np.zeros(100)
        file["a"].attrs.create("MATLAB_class", np.bytes_("x" * 60_000))

    return hdf5(spoil)


def hdf5_cut_in_the_middle() -> bytes:
    """Half a file."""
    whole = hdf5(lambda file: file.create_dataset("theta", data=np.zeros(100)))
    return whole[: len(whole) // 2]


def log_of_nested_types() -> bytes:
    """A type of sixty thousand types of sixty thousand types."""
    types = [definition(f"t{number}", [f"t{number + 1}[60000] x"]) for number in range(6)]
    types.append(definition("t6", ["uint8_t[60000] x"]))
    types.append(definition("vehicle_attitude", ["uint64_t timestamp", "t0[60000] q"]))
    return b"".join([HEADER, *types, subscription(0, "vehicle_attitude", 0)])


def log_of_a_type_in_itself() -> bytes:
    """Endless."""
    own = definition("vehicle_attitude", ["uint64_t timestamp", "vehicle_attitude q"])
    return HEADER + own + subscription(0, "vehicle_attitude", 0)


def log_of_tiny_messages() -> bytes:
    """Four million messages of a byte."""
    return HEADER + message("L", b"x") * 4_000_000


def log_of_damage() -> bytes:
    """Nothing but damage and marks for going on."""
    return HEADER + (b"\xff" * 20 + message("S", SYNC)) * 400_000


def log_of_appended_data() -> bytes:
    """Offsets that lead back to the beginning, again and again."""
    flags = bytes(8) + bytes([1]) + bytes(7) + struct.pack("<3Q", 16, 16, 16)
    return HEADER + message("B", flags) + message("L", bytes(20)) * 500_000


LOG_BOMBS = {
    f"{made.__name__}{ending}": (ending, made)
    for ending, made in (
        (".mat", hdf5_of_a_huge_piece),
        (".mat", hdf5_of_terabytes),
        (".mat", hdf5_of_many_groups),
        (".mat", hdf5_of_cycles),
        (".mat", hdf5_of_long_strings),
        (".mat", hdf5_cut_in_the_middle),
        (".ulg", log_of_nested_types),
        (".ulg", log_of_a_type_in_itself),
        (".ulg", log_of_tiny_messages),
        (".ulg", log_of_damage),
        (".ulg", log_of_appended_data),
    )
}
