"""What is refused of a flight, and read of an odd one, alike in every format and inline."""

from __future__ import annotations

import json
from collections.abc import Callable
from datetime import datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io

from morphcore import Trajectory, load_trajectory
from morphcore.errors import InvalidInput
from morphdata.samplefiles.fault import as_sentence
from morphdata.samplefiles.flight import INLINE
from morphdata.samples import InlineSample

ROWS = 40
T = np.arange(ROWS) * 0.01
FLIGHT: dict[str, Any] = {
    "t": T,
    "sweep_left": T,
    "sweep_right": T,
    "phi": 0.1 * T,
    "theta": 0.06 + T,
    "psi": -T,
}
MS = np.int64(1_714_564_800_000) + 10 * np.arange(ROWS)
NS = 1_000_000 * MS


def as_csv(path: Path, columns: dict[str, Any]) -> None:
    """Every number with all its digits."""
    rows = zip(*(np.asarray(column).tolist() for column in columns.values()), strict=True)
    path.write_text("\n".join([",".join(columns), *(",".join(map(str, row)) for row in rows)]))


def as_json(path: Path, columns: dict[str, Any]) -> None:
    """One object of lists."""
    path.write_text(json.dumps({title: np.asarray(column).tolist() for title, column in columns.items()}))


def as_parquet(path: Path, columns: dict[str, Any]) -> None:
    """One table."""
    pq.write_table(pa.table(columns), path)


def as_matlab(path: Path, columns: dict[str, Any]) -> None:
    """Vectors."""
    scipy.io.savemat(path, columns)


WRITERS: dict[str, Callable[[Path, dict[str, Any]], None]] = {
    "csv": as_csv,
    "json": as_json,
    "parquet": as_parquet,
    "mat": as_matlab,
}

BAD: dict[str, tuple[dict[str, Any], str]] = {
    "degrees": ({"theta": np.rad2deg(0.06 + T)}, "theta{} is 3.43775 rad at row 0, beyond pi/2"),
    "steep from a row on": ({"theta": 1.3 + T}, "theta{} is 1.58 rad at row 28, beyond pi/2"),
    "no angle at all": ({"psi": 5000.0 * T}, "psi{} is 1050 rad at row 21, beyond 1000 rad"),
    "milliseconds": ({"t": 100_000.0 * T}, "the flight takes 39000 s"),
    "an hour": ({"t": 100.0 * T + np.where(T > 0.2, 3600.0, 0.0)}, "the flight takes 3639 s"),
    "time that falls": (
        {"t": np.where(np.arange(ROWS) == 19, 0.1, T)},
        "time does not increase at row 19: it goes from 0.18 s to 0.1 s",
    ),
}


@pytest.mark.parametrize("ending", WRITERS)
@pytest.mark.parametrize("bad", BAD)
def test_a_file_is_refused_by_name_in_the_same_words(tmp_path: Path, ending: str, bad: str) -> None:
    """Degrees without their unit, milliseconds without theirs, time that falls: the file and the reason."""
    changes, said = BAD[bad]
    path = tmp_path / f"flight.{ending}"
    WRITERS[ending](path, FLIGHT | changes)
    with pytest.raises(InvalidInput) as caught:
        load_trajectory(path)
    assert str(path) in caught.value.message
    assert said.format("") in caught.value.message
    assert caught.value.hint


@pytest.mark.parametrize("bad", BAD)
def test_an_inline_sample_is_refused_in_the_same_words(bad: str) -> None:
    """The same flight in a request: the field instead of the file."""
    changes, said = BAD[bad]
    document = {INLINE[name]: np.asarray(column).tolist() for name, column in (FLIGHT | changes).items()}
    with pytest.raises(InvalidInput) as caught:
        InlineSample.parse({"name": "x", **document}, "/samples/0")
    assert caught.value.message == as_sentence(said.format("_rad"))
    assert caught.value.pointer.startswith(f"/samples/0/{INLINE[next(iter(changes))]}")
    assert caught.value.hint


def test_the_hint_of_angles_and_times_is_a_unit() -> None:
    """Who forgot the unit is told of it."""
    for bad, unit in (("degrees", "theta_deg"), ("milliseconds", "seconds")):
        document = {INLINE[name]: np.asarray(item).tolist() for name, item in (FLIGHT | BAD[bad][0]).items()}
        with pytest.raises(InvalidInput) as caught:
            InlineSample.parse({"name": "x", **document})
        assert unit in caught.value.hint


@pytest.mark.parametrize("ending", WRITERS)
@pytest.mark.parametrize(
    "times",
    [{"t_ms": MS}, {"t [ns]": NS}, {"t_us": 1000 * MS}, {"t_s": MS * 1e-3}],
    ids=lambda it: next(iter(it)),
)
def test_time_since_an_epoch_is_read_from_every_format(
    tmp_path: Path, ending: str, times: dict[str, Any]
) -> None:
    """It counts from the first row; whole numbers lose no digit, floats what they cannot hold (0.2 us)."""
    title, values = next(iter(times.items()))
    if ending == "mat":
        title = title.replace(" [", "_").rstrip("]")
    path = tmp_path / f"flight.{ending}"
    WRITERS[ending](path, {title: values, **{name: FLIGHT[name] for name in FLIGHT if name != "t"}})
    exact = values.dtype.kind == "i"
    np.testing.assert_allclose(load_trajectory(path).time_s, T, rtol=1e-12, atol=0.0 if exact else 3e-7)


@pytest.mark.parametrize("unit", ["ms", "us", "ns"])
@pytest.mark.parametrize("zone", [None, "UTC"])
def test_moments_of_a_parquet_file_are_times(tmp_path: Path, unit: str, zone: str | None) -> None:
    """Moments and durations, as pandas and polars write them, whatever the title says."""
    per_ms = {"ms": 1, "us": 1000, "ns": 1_000_000}[unit]
    rest = {name: FLIGHT[name] for name in FLIGHT if name != "t"}
    moments = pa.array((MS * per_ms).tolist(), pa.timestamp(unit, zone))
    durations = pa.array((10 * per_ms * np.arange(ROWS)).tolist(), pa.duration(unit))
    for number, times in enumerate((moments, durations)):
        path = tmp_path / f"{number}.parquet"
        pq.write_table(pa.table({"time": times, **rest}), path)
        np.testing.assert_allclose(load_trajectory(path).time_s, T, rtol=1e-12)


def test_dates_of_a_json_file_are_times(tmp_path: Path) -> None:
    """Dates of ISO 8601 in a list; a word among them is named with its row."""
    begin = datetime(2024, 5, 1, 12, tzinfo=timezone(timedelta(hours=2)))
    dates = [(begin + timedelta(milliseconds=10 * row)).isoformat() for row in range(ROWS)]
    path = tmp_path / "flight.json"
    rest = {name: FLIGHT[name].tolist() for name in FLIGHT if name != "t"}
    path.write_text(json.dumps({"t": dates, **rest}))
    np.testing.assert_allclose(load_trajectory(path).time_s, T, rtol=1e-12)
    path.write_text(json.dumps({"t": [*dates[:7], "noon", *dates[8:]], **rest}))
    with pytest.raises(InvalidInput, match=r"row 7 \(from 0\): t is 'noon'"):
        load_trajectory(path)


def test_an_inline_sample_may_count_from_an_epoch() -> None:
    """As a file does."""
    document = {INLINE[name]: column.tolist() for name, column in FLIGHT.items()}
    document["time_s"] = (MS * 1e-3).tolist()
    flown = Trajectory.of(InlineSample.parse({"name": "x", **document}))
    np.testing.assert_allclose(flown.time_s, T, atol=3e-7)
    assert not flown.time_s.flags.writeable


@pytest.mark.parametrize(
    "further",
    [
        pa.array((NS + 1).tolist(), pa.int64()),
        pa.array([2**64 - 1] * ROWS, pa.uint64()),
        pa.array([None] * ROWS, pa.int64()),
        pa.array(["a"] * ROWS),
        pa.array([[1.0]] * ROWS),
        pa.array(NS.tolist(), pa.timestamp("ns")),
        pa.array([10**60] * ROWS, pa.decimal256(70, 0)),
    ],
    ids=lambda column: str(column.type),
)
def test_a_further_column_spoils_no_flight(tmp_path: Path, further: Any) -> None:
    """Whole numbers beyond 2^53, gaps, words, lists, dates: the six columns are read all the same."""
    path = tmp_path / "flight.parquet"
    pq.write_table(pa.table({"stamp": further, **FLIGHT}), path)
    flown = load_trajectory(path)
    np.testing.assert_array_equal(flown.theta, FLIGHT["theta"])
    if "stamp" in flown.extra:
        np.testing.assert_allclose(flown.extra["stamp"], [float(item) for item in further.to_pylist()])


@pytest.mark.parametrize("ending", ["json", "mat"])
def test_a_further_column_spoils_no_other_file(tmp_path: Path, ending: str) -> None:
    """The same in JSON and MATLAB files."""
    path = tmp_path / f"flight.{ending}"
    WRITERS[ending](path, {"stamp": NS + 1, **FLIGHT})
    np.testing.assert_allclose(load_trajectory(path).extra["stamp"], (NS + 1).astype(float))


@pytest.mark.parametrize("comment", ["# by logger", "// by logger", "% by logger\n\n# twice"])
def test_comment_lines_in_json_are_passed_over(tmp_path: Path, comment: str) -> None:
    """Above the text, amid it and below; what looks like one inside a string is none."""
    path = tmp_path / "flight.json"
    as_json(path, FLIGHT)
    text = path.read_text().replace("], ", f"],\n  {comment}\n", 1)
    path.write_text(f'{comment}\n{text[:-1]}, "note": "# 1 // 2"}}\n{comment}\n')
    np.testing.assert_array_equal(load_trajectory(path).theta, FLIGHT["theta"])


@pytest.mark.parametrize("ending", ["mat", "csv", "txt", "json"])
def test_an_octave_text_file_is_known_under_any_name(tmp_path: Path, ending: str) -> None:
    """Octave's `save` writes text unless it is told otherwise."""
    path = tmp_path / f"flight.{ending}"
    path.write_text(
        "# Created by Octave 8.4.0, Mon May 01 12:00:00 2024 <u@h>\n# name: t\n# type: matrix\n 0\n"
    )
    with pytest.raises(InvalidInput, match="Octave text file") as caught:
        load_trajectory(path)
    assert "save -v7" in caught.value.hint


@pytest.mark.parametrize(
    ("content", "said", "way_out"),
    [
        (b"Octave-1-L\x00\x01\x00", "Octave binary", "save -v7"),
        (b"t,theta\n0,0\n", "a text, not a MATLAB file", ".csv"),
        (b'{"t": [0]}', "a text, not a MATLAB file", ".csv"),
    ],
)
def test_other_files_called_mat_are_known(tmp_path: Path, content: bytes, said: str, way_out: str) -> None:
    """What a file is tells its begin; nobody is told of an index of some reader's list."""
    (tmp_path / "x.mat").write_bytes(content)
    with pytest.raises(InvalidInput, match=said) as caught:
        load_trajectory(tmp_path / "x.mat")
    assert way_out in caught.value.hint
