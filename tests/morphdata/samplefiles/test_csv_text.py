"""Laws of reading flights from CSV text."""

from __future__ import annotations

import io
import math

import pytest

from morphdata.samplefiles.columns import FlightColumns, Wanted
from morphdata.samplefiles.csv_text import read_csv
from morphdata.samplefiles.fault import FileFault

PLAIN = "t,sweep_left,sweep_right,phi,theta,psi\n0,0,0.5,0,0.1,0\n0.01,0,0.6,0,0.2,0\n"
MAX_ROWS = 1000


def read(text: str, *, others: bool = False) -> FlightColumns:
    """Read a text as an uploaded file is read."""
    return read_csv(io.BytesIO(text.encode()), Wanted(max_rows=MAX_ROWS, others=others))


def test_units_in_names_mean_the_same_flight() -> None:
    """The same flight in degrees, milliradians and milliseconds, with other columns about, reads the same."""
    degrees = 180.0 / math.pi
    titles = " T_ms ;sweep_left_deg;x;Sweep Right [rad];phi(deg);theta_mrad;psi_rad".replace(";", ",")
    rows = [f"{10 * i},0,junk,{0.5 + 0.1 * i!r},{0 * degrees},{100 + 100 * i},0" for i in range(2)]
    plain, other = read(PLAIN).values, read("\n".join([titles, *rows])).values
    assert plain.keys() == other.keys()
    for name, column in plain.items():
        assert list(other[name]) == pytest.approx(list(column), abs=1e-15)


def test_degrees_become_radians() -> None:
    """180 degrees are pi."""
    text = PLAIN.replace("theta", "theta_deg").replace(",0.1,", ",180,")
    assert read(text).values["theta"][0] == pytest.approx(math.pi, rel=1e-15)


def test_windows_files_and_blank_lines_are_read() -> None:
    """A byte order mark, CRLF, quotes and blank lines change nothing but the lines on which rows stand."""
    text = "\ufeff" + PLAIN.replace("\n", "\r\n").replace("0.5", '"0.5"') + "\r\n  ,,,,,\r\n\r\n"
    assert read(text) == read(PLAIN)


def test_further_columns_are_kept_when_asked_for() -> None:
    """Columns of numbers land under their own titles; words, and numbers with gaps, are passed over."""
    text = "t,note,q,gap,sweep_left,sweep_right,phi,theta,psi\n0,a,1,1,0,0,0,0,0\n1,b,2,,0,0,0,0,0\n"
    assert {title: list(values) for title, values in read(text, others=True).others.items()} == {
        "q": [1.0, 2.0]
    }
    assert read(text).others == {}


@pytest.mark.parametrize(
    ("text", "code", "line", "title"),
    [
        ("", "empty_file", None, ""),
        ("t,sweep_left,sweep_right,phi,theta,psi\n", "no_rows", None, ""),
        (PLAIN.replace("psi", "heading"), "missing", None, "titles"),
        (PLAIN.replace("psi", "theta_deg"), "column_twice", None, "titles"),
        (PLAIN.replace("theta", "theta_furlong"), "missing", None, "titles"),
        (PLAIN.replace("0.2", "nan"), "finite_number", 3, "theta"),
        (PLAIN.replace("0.2", "1e999"), "finite_number", 3, "theta"),
        (PLAIN.replace("0.2", "=1+1"), "finite_number", 3, "theta"),
        (PLAIN.replace("0.2", "1_0"), "finite_number", 3, "theta"),
        (PLAIN.replace(",0.2,", ",,"), "finite_number", 3, "theta"),
        (PLAIN.replace(",0.2,0", ""), "uneven_row", 3, ""),
        (PLAIN.replace("0.2", "0,2"), "uneven_row", 3, ""),
        ("t," * 1001 + "\n", "too_many_columns", None, ""),
        ("x" * 100_000, "line_too_long", None, ""),
        ('t,"' + "\n" * 200_000, "not_csv", None, ""),
        (PLAIN.replace(",", " "), "missing", None, "titles"),
        (PLAIN + "1,0,0,0,0,0\n" * MAX_ROWS, "too_many_rows", None, ""),
        (PLAIN + "\n" * 1_000_000, "too_many_rows", None, ""),
    ],
)
def test_bad_files_are_refused_by_place(text: str, code: str, line: int | None, title: str) -> None:
    """Whatever is wrong with a file is told with its place and a way out."""
    with pytest.raises(FileFault) as caught:
        read(text)
    fault = caught.value
    assert (fault.code, fault.line, fault.title) == (code, line, title)
    assert fault.hint


def test_text_that_is_none_is_reported() -> None:
    """Bytes that are no UTF-8 are no CSV."""
    with pytest.raises(FileFault, match="not CSV"):
        read_csv(io.BytesIO(b"\xff\xfe\x00t"), Wanted())
