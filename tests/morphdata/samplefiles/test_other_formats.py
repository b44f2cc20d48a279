"""Laws of reading flights from JSON, Parquet and MATLAB files, through the library."""

from __future__ import annotations

import builtins
import json
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
import scipy.sparse

from morphcore import load_trajectory
from morphcore.errors import InvalidInput

ROWS = 50
T = np.arange(ROWS) * 0.01
COLUMNS: dict[str, Any] = {
    "t_ms": 1000.0 * T,
    "sweep_left": T,
    "sweep_right_deg": np.rad2deg(2.0 * T),
    "phi": 0.0 * T,
    "theta": 0.5 * T,
    "psi": -T,
}
Write = Callable[[Path, dict[str, Any]], None]


def as_json(path: Path, columns: dict[str, Any]) -> None:
    """One object of lists."""
    plain = {title: item.tolist() if hasattr(item, "tolist") else item for title, item in columns.items()}
    path.write_text(json.dumps(plain))


def as_parquet(path: Path, columns: dict[str, Any]) -> None:
    """One table in several row groups."""
    pq.write_table(pa.table(columns), path, row_group_size=7)


def as_matlab(version: str, *, packed: bool = False, turned: bool = False, struct_of: str = "") -> Write:
    """Variables or fields of a struct, rows or columns."""

    def write(path: Path, columns: dict[str, Any]) -> None:
        if turned:
            columns = {name: item[:, None] for name, item in columns.items()}
        content = {struct_of: columns} if struct_of else columns
        scipy.io.savemat(path, content, format=version, do_compression=packed)

    return write


FORMATS: dict[str, Write] = {
    "a.json": as_json,
    "a.parquet": as_parquet,
    "b.pq": as_parquet,
    "v4.mat": as_matlab("4"),
    "v5.mat": as_matlab("5"),
    "v7.mat": as_matlab("5", packed=True, turned=True),
    "struct.mat": as_matlab("5", packed=True, struct_of="flight"),
}


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_gives_the_same_flight(tmp_path: Path, name: str) -> None:
    """Units in the names are converted, further columns kept aside, words passed over, in every format."""
    FORMATS[name](tmp_path / name, {**COLUMNS, "q": T**2})
    flown = load_trajectory(tmp_path / name)
    np.testing.assert_allclose(flown.time_s, T, atol=1e-15)
    np.testing.assert_allclose(flown.sweep_right, 2.0 * T, atol=1e-15)
    np.testing.assert_array_equal(flown.psi, -T)
    np.testing.assert_array_equal(flown.extra["q"], T**2)
    assert set(flown.extra) == {"q"}
    assert not flown.theta.flags.writeable


@pytest.mark.parametrize("name", ["a.json", "a.parquet", "v7.mat", "struct.mat"])
@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"theta": None}, "no column theta"),
        ({"theta": np.where(T > 0.2, np.nan, 0.0)}, r"row 21 \(from 0\): theta is 'nan', not a finite"),
        ({"theta_deg": T}, "both give theta"),
        ({"t_ms": T[::-1]}, "time does not increase"),
    ],
)
def test_faults_are_named_alike(tmp_path: Path, name: str, changes: dict[str, Any], said: str) -> None:
    """A missing column, a number that is none, a column twice, falling time: said as for CSV."""
    columns = {title: item for title, item in {**COLUMNS, **changes}.items() if item is not None}
    FORMATS[name](tmp_path / name, columns)
    with pytest.raises(InvalidInput, match=said) as caught:
        load_trajectory(tmp_path / name)
    assert caught.value.hint


@pytest.mark.parametrize(
    ("name", "theta", "said"),
    [
        ("a.json", T[:-1], "theta has 49 rows, t_ms has 50"),
        ("a.json", ["x"] * ROWS, "row 0 .*theta is 'x'"),
        ("a.json", [True] * ROWS, "theta is 'True'"),
        ("a.json", [10**400] * ROWS, "not a finite number"),
        ("a.json", 0.0, "theta is not a list"),
        ("a.parquet", [None, *T[1:]], "row 0 .*theta is missing"),
        ("a.parquet", ["x"] * ROWS, "theta holds string, not numbers"),
        ("a.parquet", [[1.0]] * ROWS, "theta holds list"),
        ("v5.mat", T[:-1], "theta has 49 rows, t_ms has 50"),
        ("v5.mat", np.zeros((5, 10)), "theta is 5 x 10"),
        ("v5.mat", T * 1j, "complex"),
        ("v5.mat", np.array([1.0, "a"], dtype=object), "class cell"),
        ("v5.mat", "text", "class char"),
        ("struct.mat", scipy.sparse.csc_matrix(T), "class sparse"),
        ("struct.mat", {"nested": T}, "theta"),
    ],
)
def test_columns_of_another_kind_are_named(tmp_path: Path, name: str, theta: Any, said: str) -> None:
    """What is no column of numbers is told by its name and class."""
    FORMATS[name](tmp_path / name, {**COLUMNS, "theta": theta})
    with pytest.raises(InvalidInput, match=said) as caught:
        load_trajectory(tmp_path / name)
    assert caught.value.hint


def opaque_variable(name: str, class_name: str) -> bytes:
    """A version 5 file with one object as MATLAB writes them (class 17: timeseries, table, string, ...)."""

    def element(kind: int, data: bytes) -> bytes:
        return struct.pack("<II", kind, len(data)) + data + b"\0" * (-len(data) % 8)

    words = [element(1, text.encode()) for text in (name, "MCOS", class_name)]
    flags = element(6, struct.pack("<II", 17, 0))
    inner = flags + b"".join(words)
    data = struct.pack("<II", 14, len(inner)) + inner
    packed = zlib.compress(data)
    head = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x0100) + b"IM"
    return head + struct.pack("<II", 15, len(packed)) + packed


@pytest.mark.parametrize(
    ("name", "content", "said", "way_out"),
    [
        ("hdf.mat", b"MATLAB 7.3 MAT-file".ljust(2000), "not a readable MATLAB", "-v7"),
        ("hdf.mat", b"\x89HDF\r\n\x1a\n".ljust(2000), "not a readable MATLAB", "-v7"),
        ("ts.mat", opaque_variable("theta", "timeseries"), "object", "-v7"),
        ("ts.mat", opaque_variable("flight", "table"), "object", "table2struct"),
        ("x.mat", b"", "not a readable MATLAB", "-v7"),
        ("x.mat", b"MATLAB 5.0 MAT-file".ljust(126) + b"IM" + b"\xff" * 64, "MATLAB", "-v7"),
        ("x.parquet", b"PAR1", "not a readable Parquet", "CSV"),
        ("x.json", b"[1, 2]", "not an object", "lists"),
        ("x.json", b'{"t": [1], "t": [2]}', "'t' appears twice", "one"),
        ("x.json", b"[" * 100_000, "nested", "lists"),
        ("x.json", b"\xff\xfe", "UTF-8", "UTF-8"),
        ("x.xlsx", b"", "'.xlsx' files", "Parquet"),
    ],
)
def test_files_of_another_kind_show_the_way_out(
    tmp_path: Path, name: str, content: bytes, said: str, way_out: str
) -> None:
    """HDF5, objects, broken and foreign files are refused with what to do instead."""
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InvalidInput, match=said) as caught:
        load_trajectory(tmp_path / name)
    assert way_out in caught.value.hint


def test_several_structs_and_arrays_of_structs_are_refused(tmp_path: Path) -> None:
    """One flight a file, as one struct of vectors."""
    scipy.io.savemat(tmp_path / "two.mat", {"a": COLUMNS, "b": COLUMNS})
    with pytest.raises(InvalidInput, match="several structs: a, b"):
        load_trajectory(tmp_path / "two.mat")
    rows = np.array([(1.0, 2.0), (3.0, 4.0)], dtype=[("t", float), ("theta", float)])
    scipy.io.savemat(tmp_path / "rows.mat", {"a": rows})
    with pytest.raises(InvalidInput, match="array of structs") as caught:
        load_trajectory(tmp_path / "rows.mat")
    assert "ToScalar" in caught.value.hint


def test_parquet_without_its_reader_says_what_to_install(tmp_path: Path, monkeypatch: Any) -> None:
    """The library works without pyarrow, and says so when it is needed."""
    as_parquet(tmp_path / "a.parquet", COLUMNS)
    real = builtins.__import__

    def without(name: str, *rest: Any) -> Any:
        if name.startswith("pyarrow"):
            raise ImportError(name)
        return real(name, *rest)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(InvalidInput, match="pyarrow") as caught:
        load_trajectory(tmp_path / "a.parquet")
    assert "pip install pyarrow" in caught.value.hint
