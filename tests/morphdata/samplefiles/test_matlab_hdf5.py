"""MATLAB 7.3 files as sample flights, and HDF5 files that are something else or mean harm."""

from __future__ import annotations

import builtins
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from morphcore import load_trajectory
from morphcore.errors import InvalidInput

T = 0.01 * np.arange(50)
COLUMNS: dict[str, Any] = {
    "t_ms": 1000.0 * T,
    "sweep_left": T,
    "sweep_right_deg": np.rad2deg(2.0 * T),
    "phi": 0.0 * T,
    "theta": 0.5 * T,
    "psi": -T,
}
HEAD = b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM"


def as_matlab(path: Path, columns: dict[str, Any], struct: str = "", *, turned: bool = False) -> None:
    """A file as MATLAB writes it: a header of its own before the HDF5, classes as attributes, packed data."""
    with h5py.File(path, "w", userblock_size=512) as file:
        group = file.create_group(struct) if struct else file
        if struct:
            group.attrs["MATLAB_class"] = np.bytes_("struct")
        for name, item in columns.items():
            values = np.asarray(item)
            shaped = values[None, :] if turned else values[:, None]
            made = group.create_dataset(name, data=shaped, compression="gzip", shuffle=True)
            kinds = {"float64": "double", "float32": "single"}
            made.attrs["MATLAB_class"] = np.bytes_(kinds.get(values.dtype.name, values.dtype.name))
    with path.open("r+b") as stream:
        stream.write(HEAD)


@pytest.mark.parametrize("struct", ["", "flight"])
@pytest.mark.parametrize("turned", [False, True])
def test_version_73_gives_the_same_flight(tmp_path: Path, struct: str, turned: Any) -> None:
    """Rows or columns, variables or the fields of one struct; channels with gaps."""
    gapped = np.where(T > 0.4, np.nan, T)
    as_matlab(tmp_path / "a.mat", {**COLUMNS, "q_deg_s": gapped, "nz": T.astype("f4")}, struct, turned=turned)
    flown = load_trajectory(tmp_path / "a.mat")
    np.testing.assert_allclose(flown.time_s, T, atol=1e-15)
    np.testing.assert_allclose(flown.sweep_right, 2.0 * T, atol=1e-15)
    np.testing.assert_array_equal(flown.psi, -T)
    np.testing.assert_allclose(flown.channels["q"], np.deg2rad(gapped), rtol=1e-14)
    np.testing.assert_allclose(flown.channels["nz"], T, rtol=1e-6)


def test_plain_hdf5_and_whole_numbers_are_read(tmp_path: Path) -> None:
    """A file that no MATLAB wrote, with vectors of one dimension; nanoseconds since 1970 lose no digit."""
    with h5py.File(tmp_path / "a.mat", "w") as file:
        for name, item in {**COLUMNS, "t_ns": 1_714_564_800_000_000_001 + 10_000_000 * np.arange(50)}.items():
            if name != "t_ms":
                file[name] = item
    flown = load_trajectory(tmp_path / "a.mat")
    np.testing.assert_array_equal(flown.time_s, 1e-9 * (10_000_000 * np.arange(50)))


def test_columns_are_declared_in_a_struct(tmp_path: Path) -> None:
    """By the names of its fields."""
    renamed = {"PITCH" if name == "theta" else name: item for name, item in COLUMNS.items()}
    as_matlab(tmp_path / "a.mat", renamed, "flight")
    flown = load_trajectory(tmp_path / "a.mat", columns={"theta": "PITCH*2"})
    np.testing.assert_allclose(flown.theta, T, rtol=1e-15)


def spoilt(path: Path, name: str, spoil: Callable[[Any, str], None]) -> None:
    """A flight with one variable made by `spoil`."""
    as_matlab(path, {title: item for title, item in COLUMNS.items() if title != name})
    with h5py.File(path, "r+") as file:
        spoil(file, name)


def with_class(kind: str) -> Callable[[Any, str], None]:
    """Numbers that MATLAB says are something else."""

    def spoil(file: Any, name: str) -> None:
        file[name] = np.zeros((50, 1), "u2")
        file[name].attrs["MATLAB_class"] = np.bytes_(kind)

    return spoil


def in_another_file(file: Any, name: str) -> None:
    """Numbers of a file beside it."""
    file.create_dataset(name, (50, 1), "f8", external=[("secret.bin", 0, h5py.h5f.UNLIMITED)])


def virtual(file: Any, name: str) -> None:
    """A view of another file's numbers."""
    layout = h5py.VirtualLayout((50, 1), "f8")
    layout[:] = h5py.VirtualSource("other.h5", "theta", (50, 1))
    file.create_virtual_dataset(name, layout)


def linked(link: Any) -> Callable[[Any, str], None]:
    """A link in the place of a dataset."""

    def spoil(file: Any, name: str) -> None:
        file[name] = link

    return spoil


def references(file: Any, name: str) -> None:
    """A cell, as MATLAB stores it."""
    cell = file.create_dataset(name, (50, 1), h5py.ref_dtype)
    cell[0, 0] = file["phi"].ref
    cell.attrs["MATLAB_class"] = np.bytes_("cell")


def timeseries(file: Any, name: str) -> None:
    """An object of MATLAB's."""
    file[name] = np.zeros((1, 6), "u4")
    file[name].attrs["MATLAB_class"] = np.bytes_("timeseries")
    file[name].attrs["MATLAB_object_decode"] = np.int32(3)


def huge_chunks(file: Any, name: str) -> None:
    """Fifty numbers in one piece that claims a gigabyte."""
    space = h5py.h5s.create_simple((50, 1), (h5py.h5s.UNLIMITED, 1))
    plist = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    plist.set_chunk((2**27, 1))
    plist.set_deflate(4)
    h5py.h5d.create(file.id, name.encode(), h5py.h5t.IEEE_F64LE, space, plist)


def nested(file: Any, name: str) -> None:
    """A group that holds itself."""
    group = file.create_group(name)
    group["self"] = group


def terabytes(file: Any, name: str) -> None:
    """A claim that costs nothing."""
    file.create_dataset(name, (10**12, 1), "f8", chunks=(100, 1))


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda file, name: file.create_group(name), "theta is of the class struct"),
        (nested, "theta is of the class struct"),
        (terabytes, "more than 100000 rows"),
        (lambda file, name: file.create_dataset(name, data=np.zeros((50, 3))), "theta is 50 x 3"),
        (lambda file, name: file.create_dataset(name, data=np.zeros((2, 5, 5))), "theta is 2 x 5 x 5"),
        (lambda file, name: file.create_dataset(name, data=1.0), "theta is "),
        (lambda file, name: file.create_dataset(name, data=h5py.Empty("f8")), "class nothing"),
        (lambda file, name: file.create_dataset(name, data=np.zeros((50, 1), "c16")), "class complex128"),
        (lambda file, name: file.create_dataset(name, data=[["a"]] * 50), "class cell"),
        (lambda file, name: file.create_dataset(name, data=np.zeros((49, 1))), "theta has 49 rows"),
        (with_class("char"), "class char"),
        (with_class("logical"), "class logical"),
        (with_class("x" * 1000), "class unknown"),
        (references, "class cell"),
        (timeseries, "is an object"),
        (in_another_file, "stored in other files"),
        (virtual, "stored in other files"),
        (huge_chunks, "huge pieces"),
        (linked(h5py.SoftLink("/theta")), "class link"),
        (linked(h5py.ExternalLink("other.h5", "/theta")), "class link"),
    ],
)  # fmt: skip
def test_what_is_no_vector_of_numbers_is_named(
    tmp_path: Path, spoil: Callable[[Any, str], None], said: str
) -> None:
    """Groups, cycles, claims of terabytes, cells, objects, links and data in other files: by the variable."""
    spoilt(tmp_path / "a.mat", "theta", spoil)
    with pytest.raises(InvalidInput, match=said) as caught:
        load_trajectory(tmp_path / "a.mat")
    assert caught.value.hint


def test_what_nobody_needs_spoils_nothing(tmp_path: Path) -> None:
    """The same under another name."""
    for spoil in (nested, references, timeseries, in_another_file, virtual, huge_chunks, with_class("char")):
        as_matlab(tmp_path / "a.mat", COLUMNS)
        with h5py.File(tmp_path / "a.mat", "r+") as file:
            spoil(file, "tip_left_z")
        flown = load_trajectory(tmp_path / "a.mat")
        assert not flown.channels
        assert "does not hold numbers" in flown.unreadable["tip_left_z"]


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (len, "no column t"),
        (lambda file: file.create_group("flight"), "no column t"),
        (lambda file: file.__setitem__("self", file["/"]), "no column t"),
        (lambda file: [file.create_group(name) for name in "ab"], "several structs: a, b"),
        (lambda file: [file.create_group(f"g{number}") for number in range(1100)], "1100 variables"),
    ],
)
def test_files_without_a_flight_are_refused(tmp_path: Path, make: Callable[[Any], Any], said: str) -> None:
    """Empty ones, a root that holds itself, too much."""
    with h5py.File(tmp_path / "a.mat", "w") as file:
        make(file)
    with pytest.raises(InvalidInput, match=said):
        load_trajectory(tmp_path / "a.mat")


def test_a_cut_file_is_refused(tmp_path: Path) -> None:
    """At whatever byte."""
    as_matlab(tmp_path / "whole.mat", COLUMNS)
    content = (tmp_path / "whole.mat").read_bytes()
    for end in range(600, len(content) - 8, len(content) // 23):
        (tmp_path / "a.mat").write_bytes(content[:end])
        with pytest.raises(InvalidInput):
            load_trajectory(tmp_path / "a.mat")


def test_without_its_reader_the_extra_is_named(tmp_path: Path, monkeypatch: Any) -> None:
    """Which extra to install, or how to save the file otherwise."""
    as_matlab(tmp_path / "a.mat", COLUMNS)
    real = builtins.__import__

    def without(name: str, *rest: Any) -> Any:
        if name.startswith("h5py"):
            raise ImportError(name)
        return real(name, *rest)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(InvalidInput, match="h5py") as caught:
        load_trajectory(tmp_path / "a.mat")
    assert "morphid[formats]" in caught.value.hint
    assert "-v7" in caught.value.hint
